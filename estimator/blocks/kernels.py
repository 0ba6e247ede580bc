"""Small compiled functions that all kernels share; your own estimator can use them too.

NumPy takes 16 microseconds for the cross product of two 3-vectors; these take a fraction of one.
"""

import numpy as np

from estimator.compiler.jit import inlined, kernel


@kernel
def clip(x: float, low: float, high: float) -> float:
    """`x` limited to low..high."""
    return min(max(x, low), high)


@kernel
def wrap(angle_rad: float) -> float:
    """`angle_rad` wrapped to -pi..pi."""
    return angle_rad - 2.0 * np.pi * np.floor((angle_rad + np.pi) / (2.0 * np.pi))


@inlined
def dot(a, b):  # type: ignore[no-untyped-def]
    """Scalar product of two vectors of three, arrays or tuples."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a, b):  # type: ignore[no-untyped-def]
    """Vector product of two vectors of three, a tuple: nothing is allocated."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def plus(a, factor, b):  # type: ignore[no-untyped-def]
    """``a + factor b`` of two vectors of three, a tuple."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


@inlined
def put(target, factor, a):  # type: ignore[no-untyped-def]
    """Set `target`, shape (3,), to ``factor a``."""
    target[0], target[1], target[2] = factor * a[0], factor * a[1], factor * a[2]
