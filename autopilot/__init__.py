"""Autopilots: they steer on the estimate and the measurements, never on the truth."""
