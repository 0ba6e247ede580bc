"""The autopilot that steers on the direction cosine matrix: its modes, its state, and one kernel per tick."""

import math
from dataclasses import astuple, fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.airframes import AutopilotParams, params_of
from autopilot.energy import (
    believe_airspeed,
    believe_headwind,
    hold_height,
    steepest_bank,
    throttle_for,
    throttle_to_recover,
    want_airspeed,
)
from autopilot.failsafe import circle, end_blind_climb, examine, listen, mode_in_force
from autopilot.fence import FenceParams, ceiling
from autopilot.fixes import take_in
from autopilot.guidance import (
    agility,
    bank_for_heading,
    bank_to_return,
    direction_of_travel,
    gps_age,
    heading_error,
    height,
    turn_rate,
    unseen_turn,
    way_wanted,
)
from autopilot.interface import (
    CIRCLE,
    COURSE,
    GLIDE,
    LAND,
    LAUNCH,
    LEVEL,
    LOITER,
    LOW,
    MANUAL,
    MOST_WAYPOINTS,
    RATE,
    RETURN,
    STABILISE,
    WAYPOINTS,
    ActuatorCommand,
    Setpoint,
)
from autopilot.launch import climb_away, feel_throw, reckon_throw, steepest_rate
from autopilot.lift import feel_lift
from autopilot.mixer import mix
from autopilot.route import bank_along_route, bank_to_circle
from autopilot.stabilise import rate_control, rate_demand
from estimator.blocks.gps_integrity import WATCH
from estimator.blocks.kernels import clip
from estimator.compiler.jit import kernel
from estimator.interface import MEASURED_DTYPE, AttitudeEstimate, HeadingReference, Measurements


def _floats(params: type[Any]) -> np.dtype[Any]:
    return np.dtype([(f.name, "f8") for f in fields(params)], align=True)


_GROUPS: dict[str, Any] = {f.name: f.default_factory for f in fields(AutopilotParams)}
_PARAMS = np.dtype([(name, _floats(group)) for name, group in _GROUPS.items()], align=True)
_NOT_FLOAT: dict[str, Any] = {
    "mode": "i8", "inverted": "i8", "left": "i8", "radio": "i8",
    "rate_b_rad_s": ("f8", (3,)), "route": ("f8", (MOST_WAYPOINTS, 3)),
}  # fmt: skip
_SETPOINT = np.dtype(
    [*((f.name, _NOT_FLOAT.get(f.name, "f8")) for f in fields(Setpoint)), ("n_waypoints", "i8")], align=True
)
_STATE = np.dtype(
    [
        ("mode", "i8"),  # active in the last tick, -1 before the first
        ("setpoint_mode", "i8"),  # of the setpoint in the last tick
        ("led_by", "i8"),  # mode that determines the course
        ("roll_integral", "f8"),  # aileron and elevator of the integrators
        ("pitch_integral", "f8"),
        ("climb_integral_rad", "f8"),  # pitch of the integrated climb error
        ("throttle_integral", "f8"),  # throttle of the integrated energy error
        ("inverted", "i8"),  # flying inverted
        ("airspeed_m_s", "f8"),  # best knowledge, equivalent
        ("true_factor", "f8"),  # true over equivalent airspeed
        ("airspeed_known", "i8"),  # measured, or from GPS and wind
        ("lift_m_s", "f8"),  # airspeed from the elevator, 0 if unknown
        ("elevator", "f8"),  # last command
        ("refused", "i8"),  # contradicted by throttle and elevator
        ("doubt_s", "f8"),  # how long it has been contradicted, decreasing while it is not
        ("by_throttle_m_s", "f8"),  # airspeed that goes with throttle and climb, 0 before the first
        ("throttle", "f8"),  # last command
        ("air_left_s", "f8"),  # remaining time for which the last measured airspeed is used
        ("airspeed_wanted_m_s", "f8"),
        ("ground_m_s", "f8"),  # speed over the ground, NaN if unknown
        ("wind_seen_e_m_s", "f8", (2,)),  # largest tailwind, north and east
        ("headwind_m_s", "f8"),  # along the desired track
        ("unseen_turn_rad", "f8"),  # turn not yet visible in the GPS course
        ("outbound", "i8"),  # flying away from the launch point after passing it
        ("felt_m_s2", "f8"),  # mean acceleration along the nose
        ("gained_m_s", "f8"),  # speed along the nose gained by pushing, slowly forgotten
        ("ahead_m_s", "f8"),  # velocity along the nose and below it, from the throw
        ("below_m_s", "f8"),
        ("peak_m_s2", "f8"),  # largest mean acceleration of the push
        ("thrown_s", "f8"),  # since the end of the throw, 0 during its push, -1 before it
        ("levelled_off", "i8"),  # the climb after the throw has ended
        ("next_waypoint", "i8"),  # of the route
        ("on_leg", "i8"),  # flying towards it, from
        ("leg_from_m", "f8", (3,)),  # north, east, height
        ("silent_s", "f8"),  # since the last fix arrived
        ("heard_s", "f8"),  # since the last GPS outage
        ("circled_s", "f8"),  # in circles without a position
        ("fixed", "i8"),  # a fix has arrived at some time
        ("unheard_s", "f8"),  # since the radio link was lost
        ("setpoints", "i8"),  # number of different setpoints received
        ("fenced", "i8"),  # the fence determines the mode
        ("fenced_by", "i8"),  # number of the setpoint under which it acted
        ("low", "i8"),  # too close to the ground
        ("believed", "i8"),  # whether the estimator is trusted
        ("healthy_once", "i8"),
        ("poor_s", "f8"),  # time the estimator has been unhealthy, decreasing while it is healthy
        ("apart_s", "f8"),  # time it has been no number, or POOR and far from the standby attitude
        ("unwell_s", "f8"),  # since the last healthy estimate
        ("alone_s", "f8"),  # in LEVEL without GPS or radio link
        ("helped_s", "f8"),  # in LEVEL with both
        ("R_kept_eb", "f8", (3, 3)),  # the standby attitude: that of the last healthy estimate, carried on
        ("bias_kept_b_rad_s", "f8", (3,)),  # its gyro bias
        ("wind_kept_e_m_s", "f8", (3,)),  # the last healthy wind, NaN if unknown
        ("omega_kept_b_rad_s", "f8", (3,)),  # rate of the standby attitude
        ("turn_kept_b_rad_s", "f8", (3,)),  # the same with the corrections
        ("force_last_b_m_s2", "f8", (3,)),  # last specific force
        ("force_frozen_s", "f8"),  # time for which it has not changed
        ("height_kept_m", "f8"),  # at the start of LEVEL
        ("fix_held_back", "i8"),  # the last fix cannot be true
        *((c.name, "i8" if c.integer else "f8", c.shape) for c in WATCH),
    ],
    align=True,
)
# One array with everything the kernel needs besides the inputs of a tick: each array argument costs time per call.
_MEMORY = np.dtype(
    [("p", _PARAMS), ("setpoint", _SETPOINT), ("s", _STATE), ("on_nose", "i8"), ("seen", MEASURED_DTYPE)], align=True
)

_WIND_UNKNOWN = np.full(3, np.nan)
_DT_LIMIT_S = 0.1  # longer sample intervals are gaps and are not integrated in full


@kernel
def ask(mode, s):  # type: ignore[no-untyped-def]
    """Handle a new mode of the setpoint: each launch waits for a new throw."""
    if mode == LAUNCH:
        s.roll_integral = s.pitch_integral = s.felt_m_s2 = s.climb_integral_rad = s.throttle_integral = 0.0
        s.gained_m_s = 0.0
        s.thrown_s = -1.0
        s.levelled_off = 0
    s.setpoint_mode = mode


@kernel
def enter(mode, led_by, height_m, s):  # type: ignore[no-untyped-def]
    """Change to `mode` with course by `led_by`: reset the state of the previous mode, but keep the learnt trim."""
    if mode != s.mode:
        if RATE in (mode, s.mode):
            s.roll_integral = s.pitch_integral = 0.0
        s.height_kept_m = height_m
        s.mode = mode
    if led_by != s.led_by:
        s.outbound = s.on_leg = 0
        s.led_by = led_by


@kernel
def reckon_speed(wind_e_m_s, row, me, dt_s):  # type: ignore[no-untyped-def]
    """Update inverted flight, desired airspeed and known speeds in the state."""
    s, e = me.s, me.p.energy
    s.inverted = me.setpoint.inverted and s.mode in (STABILISE, COURSE) and math.isfinite(e.inverted_m_s)
    travels = s.led_by in (COURSE, RETURN, LOITER, WAYPOINTS)
    if travels:
        towards_north, towards_east = way_wanted(me.setpoint, row, s, me.p.guidance)
        circles = s.led_by in (LOITER, WAYPOINTS) and e.throttle_per_climb_s_m > 0.0  # a sailplane pays with height
        believe_headwind(towards_north, towards_east, circles, wind_e_m_s, row, s, me.p, dt_s)
    want_airspeed(me.setpoint, travels, s, e)
    believe_airspeed(wind_e_m_s, row, s, me.p, dt_s)


@kernel
def lead(R_eb, wind_e_m_s, row, height_m, me, dt_s):  # type: ignore[no-untyped-def]
    """Bank and pitch demand, rad, and throttle of the navigation modes, which all hold a height."""
    setpoint, s, p, failsafe = me.setpoint, me.s, me.p.guidance, me.p.failsafe
    blown = s.led_by in (LOITER, WAYPOINTS) and s.headwind_m_s > p.blown * me.p.energy.airspeed_m_s
    north, east = direction_of_travel(R_eb, wind_e_m_s, row, s, me.on_nose, blown, p)
    limit_rad, wanted_m = min(setpoint.bank_limit_rad, p.bank_limit_rad), setpoint.height_m
    if s.led_by != setpoint.mode or not setpoint.radio:  # return even if the last bank limit was tiny
        limit_rad = max(limit_rad, failsafe.bank_rad)
    if s.fenced:
        limit_rad = max(limit_rad, min(me.p.fence.bank_rad, p.bank_limit_rad))
    if s.mode == LOW:
        limit_rad = min(limit_rad, failsafe.low_bank_rad)
    limit_rad = min(limit_rad, max(steepest_bank(s, me.p.energy), failsafe.low_bank_rad))
    if not me.on_nose:
        limit_rad *= agility(s, s.true_factor * me.p.energy.airspeed_m_s, p)
    r_zy = -R_eb[2, 1] if s.inverted else R_eb[2, 1]
    if s.led_by == RETURN:
        bank = bank_to_return(north, east, r_zy, row, s, limit_rad, p)
    elif s.led_by == LOITER:
        centre_north, centre_east, radius_m = setpoint.north_m, setpoint.east_m, setpoint.radius_m
        if s.fenced:
            centre_north, centre_east, radius_m = 0.0, 0.0, min(radius_m, 0.5 * me.p.fence.radius_m)
        bank = bank_to_circle(
            north, east, r_zy, row, s, limit_rad, centre_north, centre_east, radius_m, setpoint.left, me.p.route, p
        )
    elif s.led_by == WAYPOINTS:
        bank, wanted_m = bank_along_route(
            north, east, r_zy, wind_e_m_s, row, height_m, setpoint, s, limit_rad, me.p.route, p
        )
    else:
        sine, cosine = heading_error(north, east, math.cos(setpoint.course_rad), math.sin(setpoint.course_rad))
        bank = bank_for_heading(sine, cosine, r_zy, limit_rad, p)
    wanted_m = min(wanted_m, ceiling(me.p.fence))
    if s.mode == LOW:
        wanted_m = max(wanted_m, height_m + failsafe.climb_m)
    pitch, throttle = hold_height(wanted_m, row, s, me.p, dt_s)
    return bank, pitch, throttle


@kernel
def guide(R_eb, omega_b_rad_s, wind_e_m_s, row, height_m, me, dt_s):  # type: ignore[no-untyped-def]
    """Bank and pitch demand, rad, and throttle of all modes with an attitude demand; `me` is the memory."""
    setpoint, s = me.setpoint, me.s
    if s.mode == STABILISE:
        return setpoint.bank_rad, setpoint.pitch_rad, throttle_for(setpoint.pitch_rad, s, me.p.energy)
    if s.mode == LAUNCH:
        thrown_s = feel_throw(R_eb, row, s, me.p.launch, dt_s)
        wanted_m = min(setpoint.height_m, ceiling(me.p.fence))
        end_blind_climb(wanted_m, row, s, me.p)
        pitch, throttle = climb_away(thrown_s, wanted_m, row, s, me.p, dt_s)
        return 0.0, pitch, throttle
    if s.mode in (CIRCLE, GLIDE, LEVEL, LAND):
        return circle(s.mode, R_eb, omega_b_rad_s, row, s, me.p, dt_s)
    return lead(R_eb, wind_e_m_s, row, height_m, me, dt_s)


@kernel
def control(R_eb, omega_b_rad_s, wind_e_m_s, row, height_m, me, dt_s):  # type: ignore[no-untyped-def]
    """Aileron, elevator, rudder, throttle, bank demand and pitch demand of the active mode, for an attitude."""
    setpoint, s = me.setpoint, me.s
    bank = pitch = math.nan
    if s.mode == RATE:
        rate = setpoint.rate_b_rad_s
        demand = (rate[0], rate[1], rate[2])
        throttle = me.p.energy.throttle_trim
    else:
        bank, pitch, throttle = guide(R_eb, omega_b_rad_s, wind_e_m_s, row, height_m, me, dt_s)
        gathers_speed = s.mode == LAUNCH and s.thrown_s < me.p.launch.full_throttle_s
        if gathers_speed:
            reckon_throw(R_eb, omega_b_rad_s, row, s, me.p, dt_s)
        else:
            throttle = throttle_to_recover(R_eb[2, 0], pitch, throttle)
        up = -1.0 if s.inverted else 1.0
        demand = rate_demand(R_eb, omega_b_rad_s, bank, pitch, up, s.true_factor * s.airspeed_m_s, me.p.stabilise)
        if gathers_speed:
            demand = (demand[0], min(demand[1], steepest_rate(R_eb, row, s, me.p.launch)), demand[2])
    in_hand = s.mode == LAUNCH and s.thrown_s < me.p.launch.motor_delay_s
    still_s = 0.0 if in_hand else dt_s
    moved = rate_control(demand, R_eb, omega_b_rad_s, s.airspeed_m_s, s.true_factor, s, me.p.stabilise, still_s)
    if math.isfinite(setpoint.throttle) and s.mode == setpoint.mode and setpoint.radio and not in_hand:
        throttle = setpoint.throttle
    aileron, elevator, rudder, throttle = mix(moved[0], moved[1], moved[2], throttle, me.p.mixer)
    if s.inverted:  # recorded as true bank: the demand is relative to inverted flight
        bank -= math.copysign(math.pi, bank)
    return aileron, elevator, rudder, throttle, bank, pitch


@kernel
def by_hand(setpoint):  # type: ignore[no-untyped-def]
    """Result of `steer` in MANUAL: sticks directly to surfaces, without trim or mixing."""
    throttle = setpoint.throttle if math.isfinite(setpoint.throttle) else 0.0
    return setpoint.aileron, setpoint.elevator, setpoint.rudder, throttle, MANUAL, math.nan, math.nan


@kernel
def steer_on(R_eb, omega_b_rad_s, wind_e_m_s, row, height_m, me, dt_s):  # type: ignore[no-untyped-def]
    """Result of `steer` in the active mode, for an attitude, a rate and a wind."""
    s, p = me.s, me.p
    s.unseen_turn_rad = unseen_turn(s.unseen_turn_rad, R_eb, omega_b_rad_s, gps_age(row, p.guidance), dt_s)
    reckon_speed(wind_e_m_s, row, me, dt_s)
    feel_lift(row, s, p, dt_s)
    if s.mode == MANUAL:
        s.doubt_s = s.refused = 0  # its throttle is not remembered
        return by_hand(me.setpoint)
    moved = control(R_eb, omega_b_rad_s, wind_e_m_s, row, height_m, me, dt_s)
    aileron, elevator, rudder, throttle, bank, pitch = moved
    s.elevator, s.throttle = elevator, throttle
    return aileron, elevator, rudder, throttle, s.mode, bank, pitch


@kernel
def steer(R_eb, omega_b_rad_s, gyro_bias_b_rad_s, wind_e_m_s, health, rows, k, memory):  # type: ignore[no-untyped-def]
    """One tick: aileron, elevator, rudder, throttle, mode, bank demand and pitch demand.

    R_eb : shape (3, 3), estimated   omega_b_rad_s : shape (3,), corrected   gyro_bias_b_rad_s : shape (3,)
    wind_e_m_s : shape (3,) or NaN   health : int, reported by the estimator
    rows, k : measured log and its row   memory : shape (1,), parameters, setpoint and state
    """
    me = memory[0]
    setpoint, s, p, row = me.setpoint, me.s, me.p, me.seen
    turning = turn_rate(R_eb, omega_b_rad_s) if s.believed else turn_rate(s.R_kept_eb, s.omega_kept_b_rad_s)
    take_in(rows[k], turning, row, s)
    known = math.isfinite(row.dt_s)
    dt_s = clip(row.dt_s, 0.0, _DT_LIMIT_S) if known else 0.0
    for i in range(3):
        known = known and math.isfinite(omega_b_rad_s[i]) and math.isfinite(gyro_bias_b_rad_s[i])
        for j in range(3):
            known = known and math.isfinite(R_eb[i, j])
    listen(row, s, p.failsafe, dt_s)
    examine(R_eb, gyro_bias_b_rad_s, wind_e_m_s, health, known, row, s, p, dt_s)
    if setpoint.mode != s.setpoint_mode:
        ask(setpoint.mode, s)
    height_m = height(row, p.guidance)
    mode, led_by = mode_in_force(setpoint, height_m, row, s, p, dt_s)
    if mode != s.mode or led_by != s.led_by:
        enter(mode, led_by, height_m, s)
    if mode in (LEVEL, LAND) and not s.believed:  # the estimate is not used
        return steer_on(s.R_kept_eb, s.omega_kept_b_rad_s, s.wind_kept_e_m_s, row, height_m, me, dt_s)
    if known:
        return steer_on(R_eb, omega_b_rad_s, wind_e_m_s, row, height_m, me, dt_s)
    if mode == MANUAL:
        return by_hand(setpoint)
    return 0.0, 0.0, 0.0, 0.0, mode, math.nan, math.nan  # attitude unknown: neutral controls


def _write(setpoint: Setpoint, record: Any) -> None:
    """Copy `setpoint` into `record`; unused rows of the route are NaN."""
    for f in fields(Setpoint):
        if f.name != "route":
            record[f.name] = getattr(setpoint, f.name)
    n = record["n_waypoints"] = len(setpoint.route)
    record["route"] = np.nan
    if n:
        record["route"][:n] = setpoint.route


class Snapshot(NamedTuple):
    """State of a `DcmAutopilot` between two ticks; opaque."""

    memory: NDArray[Any]
    setpoint: Setpoint | None


class DcmAutopilot:
    """Stabilisation and guidance on the direction cosine matrix (Premerlani & Bizard).

    Requires no airspeed sensor or barometer: height and position come from the GPS.  Measured airspeed, or airspeed
    from an estimated wind, is used if available (`autopilot.energy`); if not, speed is protected by pitch limits and a
    throttle that follows the climb demand, or by the glide pitch.  It never raises in flight; while the attitude is
    not finite, controls are neutral and the motor is off until LEVEL takes over, except in MANUAL.

    Parameters
    ----------
    params              gains and limits; None: those of the aircraft
    heading_reference   direction of the first column of the estimator's matrix: "course" over the ground, or "nose",
                        which needs the estimated wind to navigate; changes take effect at the next `reset`
    aircraft            name of the aircraft, see `autopilot.airframes`; ValueError if it has no gains
    fence               the geofence, see `autopilot.fence`; None: that of the parameters, by default none
    """

    def __init__(
        self, params: AutopilotParams | None = None, heading_reference: HeadingReference = "course",
        aircraft: str = "endurance", fence: FenceParams | None = None,
    ) -> None:  # fmt: skip
        self.params = params or params_of(aircraft)
        if fence is not None:
            self.params = replace(self.params, fence=fence)
        self.heading_reference = heading_reference
        self.reset()

    def reset(self) -> None:
        """Reset all state.  ValueError for an unknown `heading_reference`."""
        if self.heading_reference not in ("course", "nose"):
            raise ValueError(f"heading_reference {self.heading_reference!r}: must be 'course' or 'nose'")
        self._memory = np.zeros(1, _MEMORY)
        me = self._memory[0]
        for group in _GROUPS:
            me["p"][group] = astuple(getattr(self.params, group))
        me["s"]["mode"] = me["s"]["setpoint_mode"] = me["s"]["led_by"] = me["s"]["thrown_s"] = -1
        me["s"]["placed"] = 1  # unlike an estimator, it needs a position
        me["s"]["believed"], me["s"]["heard_s"], me["s"]["R_kept_eb"] = 1, math.inf, np.eye(3)
        me["s"]["true_factor"] = 1.0
        me["on_nose"] = self.heading_reference == "nose"
        self._setpoint: Setpoint | None = None

    def update(self, estimate: AttitudeEstimate, m: Measurements, setpoint: Setpoint) -> ActuatorCommand:
        """Command for one tick from the estimate, the row of measurements and the setpoint; see `steer`."""
        if setpoint is not self._setpoint:
            if self._setpoint is None or setpoint.route != self._setpoint.route:
                self._memory["s"]["next_waypoint"] = self._memory["s"]["on_leg"] = 0
            if setpoint != self._setpoint:
                self._memory["s"]["setpoints"] += 1
            _write(setpoint, self._memory["setpoint"][0])
            self._setpoint = setpoint
        R_eb, omega, bias, wind, health = estimate
        if wind is None:
            wind = _WIND_UNKNOWN
        if not R_eb.__class__ is omega.__class__ is bias.__class__ is wind.__class__ is np.ndarray:  # lists
            R_eb, omega, bias, wind = (np.ascontiguousarray(x, np.float64) for x in (R_eb, omega, bias, wind))
        return ActuatorCommand._make(steer(R_eb, omega, bias, wind, int(health), m.rows, m.k, self._memory))

    def snapshot(self) -> Snapshot:
        """All changing state, for `restore`."""
        return Snapshot(self._memory.copy(), self._setpoint)

    def restore(self, snapshot: Snapshot) -> None:
        """Continue exactly from `snapshot`."""
        self._memory = snapshot.memory.copy()
        self._setpoint = snapshot.setpoint
