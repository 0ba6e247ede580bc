"""Attitude estimators from other packages, for comparison: Madgwick, Mahony, VQF and imufusion."""
