"""Heading error, direction of travel and return to launch, against plane geometry."""

import math
from dataclasses import astuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from autopilot.dcm import _PARAMS, _STATE
from autopilot.guidance import (
    GuidanceParams,
    agility,
    bank_for_heading,
    bank_to_return,
    direction_of_travel,
    gps_age,
    heading_error,
    height,
    unit,
    unseen_turn,
)
from estimator.interface import MEASURED_DTYPE

PARAMS = GuidanceParams()
CRUISE_M_S = 12.6
LIMIT_RAD = math.radians(35.0)
UNKNOWN = np.full(3, np.nan)
angle = st.floats(-math.pi, math.pi)
course = st.floats(0.0, 2.0 * math.pi)


def record():
    p = np.zeros(1, _PARAMS["guidance"])
    p[0] = astuple(PARAMS)
    return p[0]


def state():
    s = np.zeros(1, _STATE)[0]
    s["airspeed_m_s"], s["true_factor"] = CRUISE_M_S, 1.0
    return s


def row_of(p_e_m=(0.0, 0.0, -50.0), v_e_m_s=(0.0, 0.0, 0.0), *, t_s=10.0, gps_t_s=9.7, valid=1):
    rows = np.zeros(1, MEASURED_DTYPE)
    row = rows[0]
    row["t_s"], row["gps_t_s"], row["gps_valid"] = t_s, gps_t_s, valid
    row["gps_p_e_m"], row["gps_v_e_m_s"] = p_e_m, v_e_m_s
    return row


def nose(course_rad, pitch_rad=0.0, roll_rad=0.0):
    return Rotation.from_euler("ZYX", [course_rad, pitch_rad, roll_rad]).as_matrix()


def wrapped(rad):
    return math.remainder(rad, 2.0 * math.pi)


@given(flown=course, wanted=course, pitch=st.floats(-1.5, 1.5), roll=angle)
def test_heading_error_any_attitude_equals_the_wrapped_course_difference(flown, wanted, pitch, roll):
    """Cross and dot product of the nose vector give the sine and cosine of the difference, also inverted."""
    north, east = direction_of_travel(nose(flown, pitch, roll), UNKNOWN, row_of(valid=0), state(), 0, 0, record())
    sine, cosine = heading_error(north, east, math.cos(wanted), math.sin(wanted))
    # The nose is 0.07 long over the ground at the steepest: 4 eps of a matrix over that, and some of the angles.
    np.testing.assert_allclose(wrapped(math.atan2(sine, cosine) - (wanted - flown)), 0.0, rtol=0, atol=1e-13)


@given(error=angle)
def test_bank_for_heading_turns_the_shorter_way_and_saturates_beyond_a_right_angle(error):
    """The bank has the sign of the course difference; more than 90 degrees off it is the limit."""
    bank = bank_for_heading(math.sin(error), math.cos(error), 0.0, LIMIT_RAD, record())
    assert abs(bank) <= LIMIT_RAD
    if 1e-6 < abs(error) < math.pi - 1e-6:
        assert math.copysign(1.0, bank) == math.copysign(1.0, error)
    if math.cos(error) < 0.0:
        assert abs(bank) == LIMIT_RAD


def test_bank_for_heading_dead_astern_keeps_to_the_side_of_the_bank():
    """A reversal with noise on the heading does not flip from one bank to the other."""
    for r_zy in (-0.3, 0.3):
        for noise_rad in (-0.1, 0.1):
            error = math.pi + noise_rad
            bank = bank_for_heading(math.sin(error), math.cos(error), r_zy, LIMIT_RAD, record())
            assert bank == math.copysign(LIMIT_RAD, r_zy)


@given(heading=course, blows_to=course, speed=st.floats(0.0, 9.0))
def test_direction_of_travel_nose_with_wind_is_the_wind_triangle(heading, blows_to, speed):
    """Nose times airspeed plus wind, as complex numbers."""
    wind = speed * np.array([math.cos(blows_to), math.sin(blows_to), 0.0])
    over_ground = CRUISE_M_S * np.exp(1j * heading) + speed * np.exp(1j * blows_to)
    north, east = direction_of_travel(nose(heading), wind, row_of(), state(), 1, 0, record())
    # 3.6 m/s are left of 12.6 against 9: some eps of the sum of both over that.
    np.testing.assert_allclose(north + 1j * east, over_ground / abs(over_ground), rtol=0, atol=1e-13)


@pytest.mark.parametrize("speed", [13.0, 20.0, 40.0])
def test_direction_of_travel_blown_backwards_keeps_the_nose_in_front(speed):
    """Wind above the airspeed, dead ahead or on the bow: one is blown back, and still not taken for flying back."""
    for off in (0.0, 0.6, -0.6):
        wind = -speed * np.array([math.cos(off), math.sin(off), 0.0])
        north, east = direction_of_travel(nose(0.0), wind, row_of(), state(), 1, 0, record())
        assert north > 0.0
        assert abs(math.atan2(east, north)) < 1.2


@pytest.mark.parametrize(("ground_m_s", "part"), [(20.0, 1.0), (math.nan, 1.0), (0.45 * 12.6, 0.5), (0.0, 0.3)])
def test_agility_is_less_over_slow_ground(ground_m_s, part):
    """In proportion below 0.9 of cruise, never below 0.3; unknown is full."""
    s = state()
    s["ground_m_s"] = ground_m_s
    np.testing.assert_allclose(agility(s, CRUISE_M_S, record()), part, rtol=0, atol=1e-12)


def test_direction_of_travel_nose_without_wind_is_the_gps_velocity_turned_on():
    """The GPS saw north-east; 0.5 rad to the right have been turned since."""
    s = state()
    s["unseen_turn_rad"] = 0.5
    north, east = direction_of_travel(nose(0.0), UNKNOWN, row_of(v_e_m_s=(7.0, 7.0, 0.0)), s, 1, 0, record())
    np.testing.assert_allclose(math.atan2(east, north), math.pi / 4 + 0.5, rtol=0, atol=1e-12)


def test_direction_of_travel_nose_with_neither_wind_nor_gps_is_the_nose():
    """Nothing else is known."""
    north, east = direction_of_travel(nose(2.0), UNKNOWN, row_of(valid=0), state(), 1, 0, record())
    np.testing.assert_allclose(math.atan2(east, north), 2.0, rtol=0, atol=1e-12)


def test_unseen_turn_steady_turn_is_rate_times_lag_at_any_bank():
    """A first-order lag of 1.3 s shows a steady turn 1.3 s late; the rate about the vertical comes from the matrix."""
    rate_rad_s, lag_s, dt_s = 0.5, 1.3, 0.02
    R = nose(1.0, 0.1, math.radians(35.0))
    omega, unseen = R.T @ [0.0, 0.0, rate_rad_s], 0.0
    for _ in range(1000):  # 15 lags
        unseen = unseen_turn(unseen, R, omega, lag_s, dt_s)
    np.testing.assert_allclose(unseen, rate_rad_s * lag_s, rtol=0, atol=1e-5)


@pytest.mark.parametrize(
    ("change", "believed"),
    [({}, True), ({"valid": 0}, False), ({"gps_t_s": 1.0}, False), ({"p_e_m": (math.nan, 0.0, 0.0)}, False)],
)
def test_gps_age_counts_the_filter_and_refuses_what_is_old_absent_or_not_a_number(change, believed):
    """0.3 s since the stamp and 1 s of filter; infinite where the fix is not to be believed."""
    age_s = gps_age(row_of(**change), record())
    assert age_s == (pytest.approx(1.3, rel=0, abs=1e-12) if believed else math.inf)


def test_height_climbing_is_moved_on_by_the_age_of_the_fix():
    """30 m and 2 m/s up, 1.3 s ago: 32.6 m now."""
    np.testing.assert_allclose(height(row_of((0, 0, -30.0), (0, 0, -2.0)), record()), 32.6, rtol=0, atol=1e-9)


@given(bearing=course, flown=course, distance=st.floats(80.0, 2000.0))
def test_bank_to_return_turns_towards_the_launch_point(bearing, flown, distance):
    """The bank has the sign of the angle from the course flown to the bearing of the launch point."""
    at = distance * np.array([math.cos(bearing), math.sin(bearing)])
    north, east = unit(math.cos(flown), math.sin(flown))
    bank = bank_to_return(north, east, 0.0, row_of((*at, -50.0)), state(), LIMIT_RAD, record())
    off = wrapped(bearing + math.pi - flown)
    if 1e-6 < abs(off) < math.pi - 1e-6:
        assert math.copysign(1.0, bank) == math.copysign(1.0, off)


def test_bank_to_return_without_position_circles_gently():
    """Straight on would be away."""
    bank = bank_to_return(1.0, 0.0, 0.0, row_of(valid=0), state(), LIMIT_RAD, record())
    assert bank == PARAMS.circling_bank_rad


def fly_flat(start_m, course_rad, wind_m_s, seconds):
    """Positions (complex, north + i east) of a point that turns as its bank demands, at cruise in a wind."""
    dt_s, g, v = 0.02, 9.80665, CRUISE_M_S
    at, heading, bank, s, p = complex(*start_m), course_rad, 0.0, state(), record()
    path = []
    for _ in range(round(seconds / dt_s)):
        over_ground = v * np.exp(1j * heading) + wind_m_s
        old = at - 1.3 * over_ground  # where and how it was when the fix was true
        row = row_of((old.real, old.imag, -50.0), (over_ground.real, over_ground.imag, 0.0))
        towards = over_ground / abs(over_ground)
        demand = bank_to_return(towards.real, towards.imag, math.sin(bank), row, s, LIMIT_RAD, p)
        bank += (demand - bank) * dt_s / 0.4
        heading += g / v * math.tan(bank) * dt_s
        at += over_ground * dt_s
        path.append(at)
    return np.array(path)


@pytest.mark.parametrize("from_deg", range(0, 360, 45))
def test_bank_to_return_any_wind_passes_the_launch_point_again_and_again(from_deg):
    """From 300 m, heading away, in 5 m/s: over the point within 60 s, and at least twice more; no endless circle."""
    wind = -5.0 * np.exp(1j * math.radians(from_deg))
    distance = abs(fly_flat((300.0, 0.0), 0.0, wind, 180.0))
    near = distance < PARAMS.passed_m
    passes = np.flatnonzero(near[1:] & ~near[:-1])
    assert len(passes) >= 3
    assert passes[0] * 0.02 < 60.0


@pytest.mark.parametrize("nose_deg", range(0, 360, 30))
@pytest.mark.parametrize("known", [False, True])
def test_direction_of_travel_in_strong_wind_follows_the_nose_and_not_the_course(nose_deg, known):
    """11 m/s to the east, the estimator's course the wrong way round: the triangle of nose and limited wind."""
    s, air = state(), CRUISE_M_S * np.exp(1j * math.radians(nose_deg))
    s["wind_seen_e_m_s"] = (0.0, 0.0) if known else (0.0, 11.0)
    s["unseen_turn_rad"] = 0.5  # turned on since the fix
    wind = np.array([0.0, 11.0, 0.0]) if known else UNKNOWN
    row = row_of(v_e_m_s=(air.real, air.imag + 11.0, 0.0))
    north, east = direction_of_travel(nose(math.radians(nose_deg + 180.0)), wind, row, s, 0, 1, record())
    expected = air * np.exp(0.5j) + PARAMS.wind_share * CRUISE_M_S * 1j
    np.testing.assert_allclose(complex(north, east), expected / abs(expected), rtol=0, atol=1e-9)


def test_direction_of_travel_in_strong_wind_without_gps_is_the_estimate():
    s = state()
    s["wind_seen_e_m_s"] = 0.0, 11.0
    north, east = direction_of_travel(nose(1.0), UNKNOWN, row_of(valid=0), s, 0, 1, record())
    assert (north, east) == pytest.approx((math.cos(1.0), math.sin(1.0)))
