"""Faults of the sensors: what a channel does wrong in a window of time."""

import numpy as np

from estimator.jit import kernel

FAULT = np.dtype([("kind", "i8"), ("channel", "i8"), ("first", "i8"), ("last", "i8"), ("value", "f8")], align=True)


@kernel
def spoil(truth, measured, k, faults):  # type: ignore[no-untyped-def]
    """Apply to the measured row `k` the faults, shape (n,) of FAULT, whose window holds it, in their order."""
