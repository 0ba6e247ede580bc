"""Faults of the fixes of a GPS receiver: their default values, their limits, and what each does to a fix.

outage           no new fix, the last good one is held
jump             the position is displaced
stuck            repeats the last fix before the window with new time stamps, or gives no fix if there was none
frozen_course    keeps the last reported course, 0 before the first; the velocity points along it
frozen_velocity  keeps the last reported velocity, course and speed, 0 before the first; the position is right
frozen_position  keeps the last reported position, the launch point before the first; the velocity is right
whole_degrees    rounds the course to whole degrees; the velocity points along it, as in a message with speed and course
rate             fewer fixes: only those whose time stamp is a multiple of the new interval
drift            the position drifts away at a steady velocity, which is also added to the reported velocity, as by a
                 transmitter that imitates satellites; it begins at the last fix before the window
nan, spikes      numbers that are NaN; positions off by an amplitude in any direction
"""

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Final

import numpy as np

from estimator.compiler.jit import kernel
from sim.sensors.fault_kinds import Kind
from sim.sensors.receiver import hold

OF_FIXES: Final = (
    "outage", "jump", "frozen_course", "frozen_velocity", "frozen_position", "whole_degrees", "rate", "drift", "stuck",
    "nan", "spikes",
)  # fmt: skip
DEFAULTS: Final = {"jump": (50.0, 0.0), "rate": (1.0,), "drift": (1.0, 0.0)}
BY_AXIS: Final = ("jump", "drift")  # their values are north, east
UNITS: Final = {"rate": "Hz", "drift": "m/s"}  # metres otherwise
SLOWEST_HZ, FASTEST_DRIFT_M_S = 0.1, 100.0
_TWO_PI: Final = 2.0 * math.pi


def why_impossible(kind: str, values: Sequence[float]) -> str:
    """What would be right, empty if the finite `values` of a fault of the fixes are possible."""
    if kind == "rate" and values[0] < SLOWEST_HZ:
        return f"must be at least {SLOWEST_HZ:g} Hz; for no fixes use outage"
    if kind == "drift" and max(abs(value) for value in values) > FASTEST_DRIFT_M_S:
        return f"must be at most {FASTEST_DRIFT_M_S:g} m/s north and east"
    return ""


def why_no_such_rate(rate_hz: float, gps_hz: float) -> str:
    """What would be right where `rate_hz` does not divide the rate of the receiver, else empty."""
    if (Fraction(str(gps_hz)) / Fraction(str(rate_hz))).denominator == 1:
        return ""
    slower = ", ".join(f"{gps_hz / n:g}" for n in range(1, 6))
    return f"the rate must divide the {gps_hz:g} Hz of the receiver: choose {slower} Hz or another whole part of it"


@kernel
def spoil_fix(measured, k, fault):  # type: ignore[no-untyped-def]
    """Apply a fault to the fix that arrives in row `k`; the columns hold it until the next fix."""
    row, before = measured[k], measured[fault.before]
    if fault.kind == Kind.OUTAGE or (fault.kind == Kind.STUCK and not before.gps_valid):
        _lose(measured, k)
    elif fault.kind == Kind.RATE:
        turns = row.gps_t_s * fault.value
        if abs(turns - np.rint(turns)) > 1e-6:
            _lose(measured, k)
    elif fault.kind == Kind.STUCK:
        stamp_s = row.gps_t_s
        hold(before, row)
        row.gps_t_s = stamp_s
    elif fault.kind == Kind.NAN:
        for i in range(3):
            row.gps_p_e_m[i] = row.gps_v_e_m_s[i] = np.nan
        row.gps_course_rad = row.gps_speed_m_s = np.nan
    elif fault.kind == Kind.FROZEN_COURSE:
        row.gps_course_rad = before.gps_course_rad
        _point_along(row)
    elif fault.kind == Kind.WHOLE_DEGREES:
        row.gps_course_rad = np.rint(row.gps_course_rad * (360.0 / _TWO_PI)) % 360.0 * (_TWO_PI / 360.0)
        _point_along(row)
    elif fault.kind == Kind.FROZEN_VELOCITY:
        for i in range(3):
            row.gps_v_e_m_s[i] = before.gps_v_e_m_s[i]
        row.gps_course_rad, row.gps_speed_m_s = before.gps_course_rad, before.gps_speed_m_s
    elif fault.kind == Kind.FROZEN_POSITION:
        for i in range(3):
            row.gps_p_e_m[i] = before.gps_p_e_m[i]
    elif fault.kind == Kind.DRIFT:
        row.gps_p_e_m[fault.axis] += fault.value * (row.gps_t_s - before.gps_t_s)
        row.gps_v_e_m_s[fault.axis] += fault.value
        north, east = row.gps_v_e_m_s[0], row.gps_v_e_m_s[1]
        row.gps_speed_m_s, row.gps_course_rad = np.hypot(north, east), np.arctan2(east, north) % _TWO_PI
    else:  # jump or spike
        row.gps_p_e_m[fault.axis] += fault.value


@kernel
def _lose(measured, k):  # type: ignore[no-untyped-def]
    """Take back the fix of row `k`; no fix arrives in row 0."""
    measured[k].gps_new = 0
    hold(measured[k - 1], measured[k])


@kernel
def _point_along(row):  # type: ignore[no-untyped-def]
    """Turn the horizontal velocity of the fix to its course."""
    row.gps_v_e_m_s[0] = row.gps_speed_m_s * np.cos(row.gps_course_rad)
    row.gps_v_e_m_s[1] = row.gps_speed_m_s * np.sin(row.gps_course_rad)
