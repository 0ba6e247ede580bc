"""Gains of the drift controller from a recovery time, by the linearised loop.

"The practical realities of the wind and gyro saturation favor using weights and gains that are large enough to recover
in about 10 seconds. In the feedback loop, the DCM algorithm is a nonlinear integrator. Therefore, you can select the
gains for the linearized equivalent dynamic model of the complete loop."  That model (`estimator.blocks.pi`), for a
small error e of a loop of weight W, is

    s^2 + K_P W s + K_I W = 0        natural frequency sqrt(K_I W), damping K_P / 2 sqrt(W / K_I)

and after a disturbance the error is ``e(t) / e(0) = (s1 exp(s1 t) - s2 exp(s2 t)) / (s1 - s2)``.

References
----------
W. Premerlani and P. Bizard, "Direction Cosine Matrix IMU: Theory", 2009, section "Feedback controller".
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from estimator.interface import Array
from estimator.params.premerlani import PremerlaniParams

PHASE_MARGIN_RAD = math.radians(60.0)  # of a yaw loop that has the receiver's lag in it
_LATEST, _STEPS = 100.0, 3000  # how far to look for the last crossing, in time constants 1 / (K_P W), in steps


def eigenvalues(weight: float, k_p: float, k_i: float) -> tuple[complex, complex]:
    """Both roots of ``s^2 + K_P W s + K_I W``, 1/s, the slower one first."""
    half = 0.5 * k_p * weight
    root = complex(half * half - k_i * weight) ** 0.5
    return -half + root, -half - root


def error_after(t_s: ArrayLike, weight: float, k_p: float, k_i: float) -> Array:
    """Remainder at `t_s` of a unit error at time zero, by the linearised loop."""
    t = np.asarray(t_s, np.float64)
    slow, fast = eigenvalues(weight, k_p, k_i)
    if abs(fast - slow) < 1e-6 * abs(fast):  # critical damping: the limit of the quotient
        return np.asarray((1.0 + fast.real * t) * np.exp(fast.real * t))
    return np.asarray(np.real((fast * np.exp(fast * t) - slow * np.exp(slow * t)) / (fast - slow)))


def recovery_time_s(weight: float, k_p: float, k_i: float, remaining: float = 0.1) -> float:
    """Time after which no more than the share `remaining` of a disturbance is left for good; inf if never."""
    if k_p * weight <= 0.0:
        return math.inf
    t = np.linspace(0.0, _LATEST / (k_p * weight), _STEPS)
    last = int(np.flatnonzero(np.abs(error_after(t, weight, k_p, k_i)) > remaining)[-1])
    if last + 1 == _STEPS:
        return math.inf
    before, after = float(t[last]), float(t[last + 1])
    while after - before > 1e-9 * after:
        middle = 0.5 * (before + after)
        if abs(error_after(middle, weight, k_p, k_i)) > remaining:
            before = middle
        else:
            after = middle
    return after


def recommended_gains(
    recovery_s: float = 10.0,
    *,
    yaw_recovery_s: float | None = None,
    remaining: float = 0.1,
    damping: float = 1.5,
    base: PremerlaniParams | None = None,
) -> PremerlaniParams:
    """Weights and gains with which the estimate recovers in `recovery_s`.

    The roll-pitch loop determines K_I; the yaw loop shares it and is faster by its weight alone.  If the lag of the
    receiver is in the yaw loop (``rotate_history`` off), that weight is limited so that the loop keeps a phase margin
    of 60 degrees: K_P W_Y (filter + latency) at most 30 degrees in radians.

    Parameters
    ----------
    recovery_s : until no more than `remaining` of a tilt is left
    yaw_recovery_s : the same for the heading; a quarter of `recovery_s` by default ("it is best to use a large weight
        for the yaw drift correction")
    remaining : share of the disturbance, 0..1
    damping : of the roll-pitch loop.  Higher: less overshoot and less noise in the learnt offset, learnt more slowly;
        from 1.4 on, the overshoot stays below a tenth
    base : source of all other parameters, K_P and the lag of the receiver too; the defaults if None

    Returns
    -------
    PremerlaniParams    `base` with w_rp, w_y and k_i replaced

    Raises
    ------
    ValueError    a time, share or damping out of range
    """
    base = base or PremerlaniParams()
    yaw_s = recovery_s / 4.0 if yaw_recovery_s is None else yaw_recovery_s
    for name, value, most in (
        ("recovery_s", recovery_s, math.inf),
        ("yaw_recovery_s", yaw_s, math.inf),
        ("remaining", remaining, 1.0),
        ("damping", damping, 100.0),
        ("k_p", base.k_p, math.inf),
    ):
        if not 0.0 < value < most:
            raise ValueError(f"{name} is {value}; it must be more than 0 and less than {most}")
    # With K_P = 1 and a given damping, time scales with 1 / W: one loop of weight one is enough.
    unit_s = recovery_time_s(1.0, 1.0, 0.25 / damping**2, remaining)
    if not math.isfinite(unit_s):
        raise ValueError(f"damping is {damping}; the error then fades too slowly to {remaining}; 1 to 3 is usual")
    w_rp = unit_s / (recovery_s * base.k_p)
    k_i = w_rp * base.k_p**2 * 0.25 / damping**2
    w_y = _weight(yaw_s, base.k_p, k_i, remaining)
    if not base.rotate_history and base.gps_lag_filter:
        lag_s = base.gps_filter_s + base.gps_latency_s
        w_y = min(w_y, (0.5 * math.pi - PHASE_MARGIN_RAD) / (base.k_p * lag_s)) if lag_s > 0.0 else w_y
    return replace(base, w_rp=w_rp, w_y=w_y, k_i=k_i)


def _weight(recovery_s: float, k_p: float, k_i: float, remaining: float) -> float:
    """Smallest weight (to a thousandth) that recovers in `recovery_s` with these gains, by bisection."""
    low, high = 0.0, 1.0 / (k_p * recovery_s)
    while recovery_time_s(high, k_p, k_i, remaining) > recovery_s:
        low, high = high, 2.0 * high
    while high - low > 1e-3 * high:
        middle = 0.5 * (low + high)
        if recovery_time_s(middle, k_p, k_i, remaining) > recovery_s:
            low = middle
        else:
            high = middle
    return high
