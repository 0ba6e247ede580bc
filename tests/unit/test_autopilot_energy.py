"""Energy: what is believed of the airspeed, what speed is wanted, and how throttle and pitch share the demands."""

import math
from dataclasses import astuple, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from autopilot.airframes import AutopilotParams, params_of
from autopilot.dcm import _PARAMS, _SETPOINT, _STATE, _write
from autopilot.energy import (
    EnergyParams,
    believe_airspeed,
    believe_headwind,
    hold_height,
    least_airspeed,
    speed_to_fly,
    throttle_for,
    throttle_to_recover,
    want_airspeed,
)
from autopilot.interface import Mode, Setpoint
from estimator.interface import G_M_S2, MEASURED_DTYPE

PARAMS = EnergyParams()
CRUISE_M_S, DT_S = PARAMS.airspeed_m_s, 0.02
UNKNOWN = np.full(3, np.nan)
LADY = params_of("gentle_lady")


def record(params=None):
    p = np.zeros(1, _PARAMS)[0]
    for group in _PARAMS.names:
        p[group] = astuple(getattr(params or AutopilotParams(), group))
    return p


def state(airspeed_m_s=CRUISE_M_S, wanted_m_s=CRUISE_M_S, *, known=0, inverted=0):
    s = np.zeros(1, _STATE)[0]
    s["airspeed_m_s"], s["airspeed_wanted_m_s"] = airspeed_m_s, wanted_m_s
    s["true_factor"] = 1.0
    s["airspeed_known"], s["inverted"] = known, inverted
    return s


def row_of(height_m=50.0, v_e_m_s=(0.0, 0.0, 0.0), *, valid=1, airspeed_m_s=math.nan):
    row = np.zeros(1, MEASURED_DTYPE)[0]
    row["t_s"], row["gps_t_s"], row["gps_valid"] = 10.0, 9.7, valid
    row["gps_v_e_m_s"] = v_e_m_s
    row["gps_p_e_m"] = (0.0, 0.0, -height_m - 1.3 * v_e_m_s[2])  # the fix is 1.3 s old
    row["equivalent_airspeed_m_s"], row["air_new"] = airspeed_m_s, math.isfinite(airspeed_m_s)
    return row


def believed(row, wind, s, seconds=10.0):
    for _ in range(round(seconds / DT_S)):
        believe_airspeed(np.array(wind, float), row, s, record(), DT_S)
    return s["airspeed_m_s"]


def test_airspeed_is_measured_where_a_tube_is_fitted():
    """The pitot tube wins over GPS and wind."""
    s = state()
    np.testing.assert_allclose(
        believed(row_of(v_e_m_s=(9.0, 0.0, 0.0), airspeed_m_s=15.0), (0, 0, 0), s), 15.0, rtol=0, atol=1e-3
    )
    assert s["airspeed_known"] == 1


def test_airspeed_of_a_tube_that_fell_silent_is_forgotten():
    """Half a second after its last sample GPS and wind take over."""
    s = state()
    believed(row_of(airspeed_m_s=15.0), (0, 0, 0), s)
    silent = row_of(v_e_m_s=(0.0, -4.0, 0.0), airspeed_m_s=15.0)
    silent["air_new"] = 0
    np.testing.assert_allclose(believed(silent, (3.0, -11.0, 0.0), s), math.hypot(3.0, 7.0), rtol=0, atol=1e-2)


@given(course=st.floats(-3.0, 3.0), wind_to=st.floats(-3.0, 3.0), wind=st.floats(0.0, 12.0))
def test_airspeed_from_gps_and_wind_is_the_wind_triangle(course, wind_to, wind):
    """Ground velocity less wind, whatever the two are: nose times airspeed as a complex number comes back."""
    air, over = 11.0 * np.exp(1j * course), wind * np.exp(1j * wind_to)
    v = air + over
    speed = believed(row_of(v_e_m_s=(v.real, v.imag, 0.0)), (over.real, over.imag, 0.0), state(0.0), DT_S)
    np.testing.assert_allclose(speed, 11.0, rtol=0, atol=1e-9)


def test_airspeed_in_a_turn_is_restored_from_the_receivers_filter():
    """A vector that turns at w comes out of a filter of 1 s shorter by sqrt(1 + w^2); the unseen turn is 1.3 s of w."""
    w, s = 0.5, state()
    s["unseen_turn_rad"] = 1.3 * w
    shrunk = 12.0 / math.hypot(1.0, w)
    np.testing.assert_allclose(believed(row_of(v_e_m_s=(shrunk, 0.0, 0.0)), (0, 0, 0), s), 12.0, rtol=0, atol=1e-3)


def test_airspeed_that_nobody_knows_is_the_one_wanted_not_the_ground_speed():
    """Down-wind at 20 m/s over the ground without a wind known: the gains stay those of the trim."""
    s = state(wanted_m_s=14.0)
    np.testing.assert_allclose(believed(row_of(v_e_m_s=(20.0, 0.0, 0.0)), UNKNOWN, s), 14.0, rtol=0, atol=1e-3)
    assert s["airspeed_known"] == 0


def test_airspeed_believed_stays_within_what_gains_are_meant_for():
    """0.6 to 1.6 of cruise, whatever is measured."""
    for measured, expected in ((0.0, 0.6), (100.0, 1.6)):
        speed = believed(row_of(airspeed_m_s=measured), UNKNOWN, state())
        np.testing.assert_allclose(speed, expected * CRUISE_M_S, rtol=0, atol=1e-2)


@pytest.mark.parametrize("wind_m_s", [0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 11.5])
@pytest.mark.parametrize("aircraft", ["endurance", "gentle_lady"])
def test_speed_to_fly_is_the_least_energy_over_the_ground(wind_m_s, aircraft):
    """D V / (V - W) minimised numerically, drag from the best glide alone: within 7 %, but for cruise and top speed."""
    e = params_of(aircraft).energy
    ground = minimize_scalar(
        lambda v: (v**2 + e.best_glide_m_s**4 / v**2) * v / (v - wind_m_s),
        bounds=(wind_m_s + 0.1, 60.0),
        method="bounded",
    ).x
    expected = np.clip(ground, e.airspeed_m_s, e.fastest_m_s)
    flown = speed_to_fly(wind_m_s, record(params_of(aircraft))["energy"])
    np.testing.assert_allclose(flown, expected, rtol=0.07, atol=0)


@pytest.mark.parametrize(
    ("towards", "ground_m_s", "wind", "expected"),
    [
        ((1.0, 0.0), 4.6, UNKNOWN, 8.0),  # flying into it
        ((-1.0, 0.0), 20.6, UNKNOWN, 8.0),  # blown away from where it is to go
        ((1.0, 0.0), 20.6, UNKNOWN, 0.0),  # blown there
        ((0.0, 0.0), 4.6, UNKNOWN, 8.0),  # nowhere to go: where it flies
        ((-1.0, 0.0), 20.6, np.array([8.0, 0.0, 0.0]), 8.0),  # known
        ((0.0, 1.0), 15.0, np.array([8.0, 0.0, 0.0]), 0.0),  # across
    ],
)
def test_headwind_is_seen_from_the_wind_or_from_the_ground_speed(towards, ground_m_s, wind, expected):
    """Flying north over the ground with 12.6 m/s of airspeed."""
    s = state()
    for _ in range(500):
        believe_headwind(*towards, 0, wind, row_of(v_e_m_s=(ground_m_s, 0.0, 0.0)), s, record(), DT_S)
    np.testing.assert_allclose(s["headwind_m_s"], expected, rtol=0, atol=0.01)


@pytest.mark.parametrize("course_deg", [0.0, 70.0, 180.0])
@pytest.mark.parametrize("wind", [UNKNOWN, np.array([0.0, 8.0, 0.0])])
def test_headwind_of_a_circle_is_the_whole_wind(course_deg, wind):
    """8 m/s to the east: on any course, once it was flown with the wind, or if an estimator knows it."""
    s = state()
    for deg, seconds in ((90.0, 5.0), (course_deg, 3.0)):
        air = CRUISE_M_S * np.exp(1j * math.radians(deg)) + 8.0j
        for _ in range(round(seconds / DT_S)):
            believe_headwind(0.0, 0.0, 1, wind, row_of(v_e_m_s=(air.real, air.imag, 0.0)), s, record(), DT_S)
    np.testing.assert_allclose(s["headwind_m_s"], 8.0, rtol=0, atol=0.2)
    np.testing.assert_allclose(s["wind_seen_e_m_s"], [0.0, 8.0], rtol=0, atol=0.2)


@pytest.mark.parametrize(("asked_m_s", "wanted_m_s"), [(15.0, 15.0), (2.0, 1.2 * PARAMS.stall_m_s), (90.0, 18.0)])
def test_airspeed_wanted_is_the_one_asked_for_within_limits(asked_m_s, wanted_m_s):
    """No slower than 1.2 times the stall, no faster than level flight."""
    asked, s = np.zeros(1, _SETPOINT), state()
    _write(Setpoint(Mode.COURSE, airspeed_m_s=asked_m_s), asked[0])
    want_airspeed(asked[0], True, s, record()["energy"])
    assert s["airspeed_wanted_m_s"] == wanted_m_s
    want_airspeed(asked[0], False, s, record()["energy"])
    assert s["airspeed_wanted_m_s"] == CRUISE_M_S


def test_airspeed_asked_for_last_does_not_hold_without_the_radio():
    """Home at the speed that the wind needs: a slow one, asked for before, would never arrive."""
    asked, s = np.zeros(1, _SETPOINT), state()
    _write(Setpoint(Mode.COURSE, airspeed_m_s=9.0, radio=False), asked[0])
    want_airspeed(asked[0], True, s, record()["energy"])
    assert s["airspeed_wanted_m_s"] == CRUISE_M_S


@pytest.mark.parametrize(
    ("height_m", "climb_m_s"), [(1000.0, 3.0), (52.0, 0.5), (50.0, 0.0), (48.0, -0.5), (0.0, -2.0)]
)
def test_hold_height_speed_unknown_pitch_and_throttle_follow_the_same_climb(height_m, climb_m_s):
    """Climb per height missing, not above 3 m/s nor below -2 m/s."""
    pitch, throttle = hold_height(height_m, row_of(), state(), record(), 0.0)
    expected = PARAMS.pitch_trim_rad + climb_m_s / CRUISE_M_S
    np.testing.assert_allclose(pitch, min(expected, PARAMS.pitch_limit_rad), rtol=0, atol=1e-12)
    wanted = PARAMS.throttle_trim + PARAMS.throttle_per_climb_s_m * climb_m_s
    np.testing.assert_allclose(throttle, wanted, rtol=0, atol=1e-12)


def test_hold_height_sinking_against_the_demand_raises_the_nose_slowly_up_to_a_limit():
    """An estimate that reads too nose-high: the climb missing is integrated into the pitch, not the throttle."""
    s, p, row = state(), record(), row_of(50.0, (12.6, 0.0, 1.0))  # at 50 m, and sinking at 1 m/s
    first_pitch, first_throttle = hold_height(50.0 - 1.3, row, s, p, DT_S)
    for _ in range(49):
        pitch, throttle = hold_height(50.0 - 1.3, row, s, p, DT_S)
    missing = 1.0 + PARAMS.climb_per_height_1_s * (50.0 - 1.3 - (50.0 + 1.3 - 1.3))
    np.testing.assert_allclose(pitch - first_pitch, 0.98 * PARAMS.pitch_per_climb_rad_m * missing, rtol=0, atol=1e-12)
    assert throttle == first_throttle
    for _ in range(5000):
        hold_height(60.0, row, s, p, DT_S)
    assert s["climb_integral_rad"] == PARAMS.pitch_integral_limit_rad
    assert s["throttle_integral"] == 0.0


def test_hold_height_without_gps_is_level_flight_at_cruise():
    """No fix, no climb: trim pitch and trim throttle."""
    demand = hold_height(100.0, row_of(valid=0), state(), record(), DT_S)
    np.testing.assert_allclose(demand, (PARAMS.pitch_trim_rad, PARAMS.throttle_trim), rtol=0, atol=1e-12)


@pytest.mark.parametrize(("faster_m_s", "excess_m_s"), [(3.0, 3.0), (-2.0, 0.0)])
@pytest.mark.parametrize("measured", [False, True])
def test_hold_height_without_gps_takes_speed_for_descent(faster_m_s, excess_m_s, measured):
    """Too fast at the throttle of level flight: it descends, so the nose goes up at once, and further as it lasts.

    Slower than cruise, the motor may be weak: no reason to dive.
    """
    s = state(CRUISE_M_S + faster_m_s, known=measured)
    s["air_left_s"], s["lift_m_s"] = float(measured), 0.0 if measured else CRUISE_M_S + faster_m_s
    row = row_of(valid=0)
    first_rad, _ = hold_height(math.nan, row, s, record(), 0.0)
    gain_m_s = 0.0
    if measured:  # the energy loop answers as well
        gain_m_s2 = np.clip(-PARAMS.gain_per_speed_1_s * faster_m_s, -PARAMS.gain_limit_m_s2, PARAMS.gain_limit_m_s2)
        gain_m_s = s["airspeed_m_s"] / G_M_S2 * gain_m_s2
    given_m_s = max(gain_m_s, (PARAMS.throttle_least - PARAMS.throttle_trim) / PARAMS.throttle_per_climb_s_m)
    climb_rad = (1.0 - PARAMS.height_weight) * (given_m_s - gain_m_s) / CRUISE_M_S
    expected_rad = PARAMS.pitch_trim_rad + climb_rad + PARAMS.pitch_per_excess_rad_s_m * excess_m_s
    np.testing.assert_allclose(first_rad, expected_rad, rtol=0, atol=1e-9)
    for _ in range(100):
        hold_height(math.nan, row, s, record(), DT_S)
    slope_rad = PARAMS.pitch_per_climb_rad_m * PARAMS.climb_per_excess * excess_m_s * 100 * DT_S
    np.testing.assert_allclose(s["climb_integral_rad"], slope_rad, rtol=0, atol=1e-9)


@pytest.mark.parametrize("slower_m_s", [-1.0, 1.0])
def test_hold_height_throttle_takes_the_sum_and_pitch_the_height(slower_m_s):
    """On the height but too slow or fast: the throttle answers with V a / g, and the nose stays where it is."""
    pitch, throttle = hold_height(50.0, row_of(), state(CRUISE_M_S - slower_m_s, known=1), record(), 0.0)
    gain = (CRUISE_M_S - slower_m_s) / G_M_S2 * PARAMS.gain_per_speed_1_s * slower_m_s
    np.testing.assert_allclose(pitch, PARAMS.pitch_trim_rad, rtol=0, atol=1e-12)
    expected = PARAMS.throttle_trim + PARAMS.throttle_per_climb_s_m * gain
    np.testing.assert_allclose(throttle, expected, rtol=0, atol=1e-12)


def test_hold_height_throttle_at_its_stop_height_and_speed_share_what_there_is():
    """Too low and too slow: full throttle gives 4.7 m/s of climb, and each goes without half of what is missing."""
    s = state(10.6, known=1)
    pitch, throttle = hold_height(100.0, row_of(), s, record(), 0.0)
    given = (1.0 - PARAMS.throttle_trim) / PARAMS.throttle_per_climb_s_m
    gain = 10.6 / G_M_S2 * PARAMS.gain_per_speed_1_s * 2.0
    assert PARAMS.climb_limit_m_s + gain < given  # still enough for both
    assert throttle < 1.0
    weak = AutopilotParams(energy=replace(PARAMS, throttle_trim=0.85))
    pitch, throttle = hold_height(100.0, row_of(), state(10.6, known=1), record(weak), 0.0)
    given = 0.15 / PARAMS.throttle_per_climb_s_m
    climb = 0.5 * PARAMS.climb_limit_m_s + 0.5 * (given - gain)
    np.testing.assert_allclose(throttle, 1.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(pitch, PARAMS.pitch_trim_rad + climb / CRUISE_M_S, rtol=0, atol=1e-12)


def test_hold_height_energy_missing_is_learnt_by_the_throttle_where_the_speed_is_known():
    """At the height, level, 0.5 m/s too slow for good: the throttle comes up; at its stop it waits."""
    s = state(CRUISE_M_S - 0.5, known=1)
    throttles = [hold_height(50.0, row_of(), s, record(), DT_S)[1] for _ in range(100)]
    gain = (CRUISE_M_S - 0.5) / G_M_S2 * PARAMS.gain_per_speed_1_s * 0.5
    np.testing.assert_allclose(
        throttles[-1] - throttles[0], 99 * DT_S * gain * PARAMS.throttle_per_height_1_m, rtol=0, atol=1e-12
    )
    full = AutopilotParams(energy=replace(PARAMS, throttle_trim=1.0))
    s = state(CRUISE_M_S - 0.5, known=1)
    hold_height(50.0, row_of(), s, record(full), DT_S)
    assert s["throttle_integral"] == 0.0


@given(height=st.floats(-500.0, 500.0), slow=st.floats(0.05, 2.0), climb=st.floats(-3.0, 3.0))
def test_hold_height_too_slow_lowers_the_nose_whatever_height_is_asked(height, slow, climb):
    """Below 1.2 times the stalling speed sink is demanded, and nothing teaches the nose to rise."""
    p, s = record(), state(known=1)
    s["airspeed_m_s"] = least_airspeed(s, p["energy"]) - slow
    pitch, _ = hold_height(height, row_of(50.0, (10.0, 0.0, -climb)), s, p, DT_S)
    sink = PARAMS.recovery_sink_m_s + PARAMS.climb_per_margin_1_s * slow
    assert pitch <= max(PARAMS.pitch_trim_rad - sink / CRUISE_M_S, -PARAMS.pitch_limit_rad) + 1e-12
    assert s["climb_integral_rad"] <= 1e-12


@pytest.mark.parametrize("height_m", [0.0, 50.0, 500.0])
def test_sailplane_pitch_is_the_speeds_and_no_height_is_held(height_m):
    """Where the speed is known it moves the pitch; where not it is the pitch of the glide; never the height."""
    p, v = record(LADY), LADY.energy.airspeed_m_s
    glide = hold_height(height_m, row_of(), state(v, v), p, DT_S)
    assert glide == (LADY.energy.pitch_trim_rad, 0.0)
    slow, _ = hold_height(height_m, row_of(), state(v - 1.0, v, known=1), p, 0.0)
    fast, _ = hold_height(height_m, row_of(), state(v + 1.0, v, known=1), p, 0.0)
    np.testing.assert_allclose(slow - glide[0], -(v - 1.0) / v * 0.3 / G_M_S2, rtol=0, atol=1e-12)
    assert fast > glide[0]


def test_throttle_for_pitch_grows_and_stays_within_limits():
    """More pitch, more throttle; never off, never above full."""
    throttles = [throttle_for(math.radians(d), state(), record()["energy"]) for d in (-40.0, 0.0, 5.0, 60.0)]
    assert throttles[0] == PARAMS.throttle_least
    assert throttles[-1] == 1.0
    assert throttles[0] < throttles[1] < throttles[2] < throttles[3]


@pytest.mark.parametrize(("nose_deg", "throttle"), [(-80.0, 0.0), (-10.0, 0.6), (15.0, 0.6), (80.0, 1.0)])
def test_throttle_to_recover_is_shut_in_a_dive_and_full_with_the_nose_high(nose_deg, throttle):
    """Level flight is asked for; within 20 degrees of it nothing changes."""
    assert throttle_to_recover(-math.sin(math.radians(nose_deg)), 0.0, 0.6) == throttle
    assert throttle_to_recover(-math.sin(math.radians(nose_deg)), 0.0, 0.0) == 0.0  # off stays off
