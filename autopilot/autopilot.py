"""The autopilot that steers on the direction cosine matrix: its modes, its state, and one kernel per tick."""

import math
from dataclasses import astuple, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.airframes import AutopilotParams, params_of
from autopilot.guidance import (
    bank_for_heading,
    bank_to_return,
    direction_of_travel,
    gps_age,
    heading_error,
    hold_height,
    throttle_for,
    unseen_turn,
)
from autopilot.interface import MOST_WAYPOINTS, ActuatorCommand, Mode, Setpoint
from autopilot.launch import climb_away, feel_throw
from autopilot.mixer import mix
from autopilot.stabilise import rate_control, rate_demand
from estimator.interface import AttitudeEstimate, HeadingReference, Measurements
from estimator.jit import kernel
from estimator.kernels import clip


def _floats(params: type[Any]) -> np.dtype[Any]:
    return np.dtype([(f.name, "f8") for f in fields(params)], align=True)


_GROUPS: dict[str, Any] = {f.name: f.default_factory for f in fields(AutopilotParams)}
_PARAMS = np.dtype([(name, _floats(group)) for name, group in _GROUPS.items()], align=True)
_NOT_FLOAT: dict[str, Any] = {
    "mode": "i8", "inverted": "i8", "left": "i8", "radio": "i8",
    "rate_b_rad_s": ("f8", (3,)), "route": ("f8", (MOST_WAYPOINTS, 3)),
}  # fmt: skip
_ASKED = np.dtype(
    [*((f.name, _NOT_FLOAT.get(f.name, "f8")) for f in fields(Setpoint)), ("n_waypoints", "i8")], align=True
)
_STATE = np.dtype(
    [
        ("mode", "i8"),  # of the last tick, -1 before the first
        ("roll_integral", "f8"),  # aileron and elevator held by the integrals
        ("pitch_integral", "f8"),
        ("climb_integral_rad", "f8"),  # pitch held by the integral of the climb missing
        ("unseen_turn_rad", "f8"),  # turned, but not yet in the GPS course
        ("outbound", "i8"),  # the launch point was passed and is being left behind
        ("felt_m_s2", "f8"),  # mean acceleration along the nose
        ("thrown_s", "f8"),  # since the throw, -1 before
        ("levelled_off", "i8"),  # the climb after the throw is over
    ],
    align=True,
)
# One array with all that the kernel needs beside the tick's inputs: each array argument costs time per call.
_MEMORY = np.dtype([("p", _PARAMS), ("asked", _ASKED), ("s", _STATE), ("on_nose", "i8")], align=True)

MANUAL, RATE, STABILISE, COURSE, RETURN, LAUNCH, LOITER, WAYPOINTS, CIRCLE, GLIDE, LEVEL = (int(m) for m in Mode)
_WIND_UNKNOWN = np.full(3, np.nan)
_DT_LIMIT_S = 0.1  # a longer sample interval is a gap; the integrals do not take it whole


@kernel
def enter(mode, s):  # type: ignore[no-untyped-def]
    """Change to `mode`: forget what belongs to the mode that is left, keep the trim that was learnt."""
    if mode in (RATE, LAUNCH) or s.mode == RATE:
        s.roll_integral = s.pitch_integral = 0.0
    if mode == LAUNCH:
        s.felt_m_s2 = s.climb_integral_rad = 0.0
        s.thrown_s = -1.0
        s.levelled_off = 0
    s.outbound = 0
    s.mode = mode


@kernel
def head_up(me):  # type: ignore[no-untyped-def]
    """1 for upright flight, -1 where the mode in force is to be flown inverted by an aeroplane that can."""
    on_its_back = me.asked.inverted and (me.s.mode == STABILISE or me.s.mode == COURSE)
    return -1.0 if on_its_back and math.isfinite(me.p.guidance.inverted_airspeed_m_s) else 1.0


@kernel
def guide(R_eb, wind_e_m_s, row, me, dt_s):  # type: ignore[no-untyped-def]
    """Bank and pitch demand, rad, and throttle of the modes that hold an attitude; `me` is the memory."""
    asked, s, p = me.asked, me.s, me.p.guidance
    up = head_up(me)
    if s.mode == STABILISE:
        return asked.bank_rad, asked.pitch_rad, throttle_for(asked.pitch_rad, up, p)
    if s.mode == LAUNCH:
        thrown_s = feel_throw(R_eb, row, s, me.p.launch, dt_s)
        pitch, throttle = climb_away(thrown_s, asked.height_m, row, s, me.p.launch, p, dt_s)
        return 0.0, pitch, throttle
    north, east = direction_of_travel(R_eb, wind_e_m_s, row, s, me.on_nose, p)
    limit_rad = min(asked.bank_limit_rad, p.bank_limit_rad)
    if s.mode == RETURN:
        bank = bank_to_return(north, east, R_eb[2, 1], row, s, limit_rad, p)
    else:
        sine, cosine = heading_error(north, east, math.cos(asked.course_rad), math.sin(asked.course_rad))
        bank = bank_for_heading(sine, cosine, up * R_eb[2, 1], limit_rad, p)
    pitch, throttle = hold_height(asked.height_m, up, row, s, p, dt_s)
    return bank, pitch, throttle


@kernel
def steer(R_eb, omega_b_rad_s, wind_e_m_s, health, rows, k, memory):  # type: ignore[no-untyped-def]  # noqa: ARG001
    """One tick: aileron, elevator, rudder, throttle, mode, bank demand and pitch demand.

    R_eb : shape (3, 3), estimated   omega_b_rad_s : shape (3,), corrected   wind_e_m_s : shape (3,) or NaN
    health : int, what the estimator says of itself
    rows, k : measured log and its row   memory : shape (1,), parameters, set-point and state
    """
    me = memory[0]
    asked, s, row = me.asked, me.s, rows[k]
    dt_s = clip(row.dt_s, 0.0, _DT_LIMIT_S)
    known = math.isfinite(row.dt_s)
    for i in range(3):
        known = known and math.isfinite(omega_b_rad_s[i])
        for j in range(3):
            known = known and math.isfinite(R_eb[i, j])
    if not known:  # whoever does not know the attitude holds still
        return 0.0, 0.0, 0.0, 0.0, asked.mode, math.nan, math.nan
    if asked.mode != s.mode:
        enter(asked.mode, s)
    s.unseen_turn_rad = unseen_turn(s.unseen_turn_rad, R_eb, omega_b_rad_s, gps_age(row, me.p.guidance), dt_s)
    if s.mode == MANUAL:
        throttle = asked.throttle if math.isfinite(asked.throttle) else 0.0
        # The sticks are the surfaces: no trim, no mixing.
        return asked.aileron, asked.elevator, asked.rudder, throttle, asked.mode, math.nan, math.nan

    bank = pitch = math.nan
    airspeed_m_s = me.p.stabilise.airspeed_m_s
    if s.mode == RATE:
        rate = asked.rate_b_rad_s
        demand = (rate[0], rate[1], rate[2])
        throttle = me.p.guidance.throttle_trim
    else:
        bank, pitch, throttle = guide(R_eb, wind_e_m_s, row, me, dt_s)
        demand = rate_demand(R_eb, omega_b_rad_s, bank, pitch, head_up(me), airspeed_m_s, me.p.stabilise)
    in_hand = s.mode == LAUNCH and s.thrown_s < 0.0
    still_s = 0.0 if in_hand else dt_s
    control = rate_control(demand, R_eb, omega_b_rad_s, airspeed_m_s, s, me.p.stabilise, still_s)
    if math.isfinite(asked.throttle) and not in_hand:
        throttle = asked.throttle
    aileron, elevator, rudder, throttle = mix(control[0], control[1], control[2], throttle, me.p.mixer)
    return aileron, elevator, rudder, throttle, asked.mode, bank, pitch


def _write(setpoint: Setpoint, asked: Any) -> None:
    """Copy `setpoint` into the record `asked`; rows of the route that nobody asked for are NaN."""
    for f in fields(Setpoint):
        if f.name != "route":
            asked[f.name] = getattr(setpoint, f.name)
    n = asked["n_waypoints"] = len(setpoint.route)
    asked["route"] = np.nan
    if n:
        asked["route"][:n] = setpoint.route


class Snapshot(NamedTuple):
    """State of a `DcmAutopilot` between two ticks; opaque."""

    memory: NDArray[Any]
    setpoint: Setpoint | None


class DcmAutopilot:
    """Stabilises and leads the aeroplane on the direction cosine matrix (Premerlani & Bizard).

    Needs no airspeed and no barometer: speed is guarded by pitch limits and by a throttle that follows the
    climb demand, or, without a motor, by the pitch of the glide; height and position come from the GPS.  In
    flight it never raises; an attitude that is not finite gets neutral controls, motor off.

    Parameters
    ----------
    params              gains and limits; None is those of the aircraft
    heading_reference   what the first column of the estimator's matrix points along: the "course" over the
                        ground, or the "nose", which is steered by with the estimated wind; may be set later
                        and holds from the next `reset` on
    aircraft            name of what is flown, see `autopilot.airframes`; ValueError where nobody has tuned for it
    """

    def __init__(
        self,
        params: AutopilotParams | None = None,
        heading_reference: HeadingReference = "course",
        aircraft: str = "endurance",
    ) -> None:
        self.params = params or params_of(aircraft)
        self.heading_reference = heading_reference
        self.reset()

    def reset(self) -> None:
        """Forget everything, as before the first flight.  ValueError for an unknown `heading_reference`."""
        if self.heading_reference not in ("course", "nose"):
            raise ValueError(f"heading_reference {self.heading_reference!r}: must be 'course' or 'nose'")
        self._memory = np.zeros(1, _MEMORY)
        me = self._memory[0]
        for group in _GROUPS:
            me["p"][group] = astuple(getattr(self.params, group))
        me["s"]["mode"] = me["s"]["thrown_s"] = -1
        me["on_nose"] = self.heading_reference == "nose"
        self._setpoint: Setpoint | None = None

    def update(self, estimate: AttitudeEstimate, m: Measurements, setpoint: Setpoint) -> ActuatorCommand:
        """Steer for one tick: `steer` above, on the estimate, the row of measurements and the set-point."""
        if setpoint is not self._setpoint:
            _write(setpoint, self._memory["asked"][0])
            self._setpoint = setpoint
        R_eb, omega, wind = estimate.R_eb, estimate.omega_b_rad_s, estimate.wind_e_m_s
        if wind is None:
            wind = _WIND_UNKNOWN
        if not (R_eb.__class__ is omega.__class__ is wind.__class__ is np.ndarray):  # somebody's lists
            R_eb, omega, wind = (np.ascontiguousarray(x, np.float64) for x in (R_eb, omega, wind))
        return ActuatorCommand._make(steer(R_eb, omega, wind, int(estimate.health), m.rows, m.k, self._memory))

    def snapshot(self) -> Snapshot:
        """All that changes in flight, for `restore`."""
        return Snapshot(self._memory.copy(), self._setpoint)

    def restore(self, snapshot: Snapshot) -> None:
        """Continue exactly where `snapshot` was taken."""
        self._memory = snapshot.memory.copy()
        self._setpoint = snapshot.setpoint
