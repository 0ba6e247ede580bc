"""Attitude estimators of other packages, flown for comparison: Madgwick, Mahony, VQF and imufusion."""
