"""Airspeeds that cannot be true: what throttle and elevator together contradict, and what one of them alone does."""

import math
from dataclasses import astuple

import numpy as np
import pytest

from autopilot.airframes import AutopilotParams, params_of
from autopilot.dcm import _PARAMS, _STATE
from autopilot.doubt import speed_of_throttle
from autopilot.energy import EnergyParams, believe_airspeed, hold_height, most_climb
from autopilot.interface import Mode
from estimator.interface import MEASURED_DTYPE

E, DT_S = EnergyParams(), 0.02
CALM = np.zeros(3)


def record(params=None):
    p = np.zeros(1, _PARAMS)[0]
    for group in _PARAMS.names:
        p[group] = astuple(getattr(params or AutopilotParams(), group))
    return p


def flying(true_m_s, throttle=None, *, climb_m_s=0.0):
    """State of steady flight at a true airspeed: throttle and elevator as the polar has them."""
    s = np.zeros(1, _STATE)[0]
    s["true_factor"], s["mode"], s["lift_m_s"] = 1.0, Mode.COURSE, true_m_s
    s["airspeed_m_s"] = s["airspeed_wanted_m_s"] = E.airspeed_m_s
    level = E.throttle_trim + E.throttle_per_speed_s_m * (true_m_s - E.airspeed_m_s)
    s["throttle"] = level + E.throttle_per_climb_s_m * climb_m_s if throttle is None else throttle
    return s


def claim(s, airspeed_m_s, seconds, *, climb_m_s=0.0, pitot=False, params=None):
    """Believe an airspeed that GPS and wind give, or a pitot tube, for some time; whether it is known in the end."""
    row = np.zeros(1, MEASURED_DTYPE)[0]
    row["t_s"], row["gps_t_s"], row["gps_valid"], row["air_new"] = 10.0, 9.7, 1, pitot
    row["gps_v_e_m_s"] = math.sqrt(airspeed_m_s**2 - climb_m_s**2), 0.0, -climb_m_s
    row["equivalent_airspeed_m_s"] = airspeed_m_s if pitot else math.nan
    for _ in range(round(seconds / DT_S)):
        believe_airspeed(CALM, row, s, record(params), DT_S)
    return bool(s["airspeed_known"])


@pytest.mark.parametrize("true_m_s", [8.0, 12.6, 17.0])
@pytest.mark.parametrize("climb_m_s", [-2.0, 0.0, 2.0])
def test_speed_of_throttle_is_that_of_the_polar(true_m_s, climb_m_s):
    """In steady flight, level or climbing, it inverts the throttle of the polar."""
    s = flying(true_m_s, climb_m_s=climb_m_s)
    assert speed_of_throttle(climb_m_s, s, record()["energy"]) == pytest.approx(true_m_s, rel=1e-12)


@pytest.mark.parametrize("pitot", [False, True])
def test_airspeed_below_the_stall_in_level_flight_at_full_throttle_is_refused(pitot):
    """Within 6 s, and the speed counts as unknown: no dive for speed, and the wrongly learnt throttle is forgotten."""
    s = flying(18.0, 1.0)
    s["throttle_integral"] = E.throttle_integral_limit
    assert claim(s, 6.0, 2.0, pitot=pitot)
    assert not claim(s, 6.0, 4.0, pitot=pitot)
    assert s["throttle_integral"] == 0.0
    assert most_climb(s, record()["energy"]) > E.climb_limit_m_s


@pytest.mark.parametrize("pitot", [False, True])
def test_cruise_with_throttle_and_nose_of_slow_flight_is_refused(pitot):
    """The mirror image: a headwind that is not there, or a stuck pitot tube, would slow it to the stall."""
    assert not claim(flying(7.4), E.airspeed_m_s, 8.0, pitot=pitot)


@pytest.mark.parametrize("true_m_s", [8.0, 12.6, 17.5])
def test_airspeed_that_is_true_is_believed(true_m_s):
    """And so is one that is 2 m/s off, more than gusts."""
    for off_m_s in (-2.0, 0.0, 2.0):
        assert claim(flying(true_m_s), true_m_s + off_m_s, 20.0)


def test_airspeed_is_believed_if_only_the_throttle_contradicts():
    """A motor that has failed at full throttle, gliding near the stall: the airspeed protects what is left."""
    assert claim(flying(8.4, 1.0), 8.4, 30.0, climb_m_s=-1.0)


def test_airspeed_is_believed_if_only_the_elevator_contradicts():
    """A balance that has moved aft."""
    s = flying(12.6)
    s["lift_m_s"] = 17.0
    assert claim(s, 12.6, 30.0)


def test_refused_airspeed_is_believed_again_once_it_is_true():
    """A wind that has been learnt: as soon as it was right for 4 s, and not before."""
    s = flying(12.6)
    assert not claim(s, 6.0, 10.0)
    assert not claim(s, 12.6, 2.0)
    assert claim(s, 12.6, 4.0)


def test_glider_has_no_witness():
    """Without motor and trimmed elevator nothing can be refused."""
    lady = params_of("gentle_lady")
    s = flying(12.6)
    s["lift_m_s"] = 0.0
    assert claim(s, 6.0, 30.0, params=lady)


@pytest.mark.parametrize(("mode", "dives"), [(Mode.COURSE, True), (Mode.LOW, False)])
def test_close_to_the_ground_it_does_not_dive_for_speed(mode, dives):
    """At 6 m/s, below the stall: nose down by 15 degrees at height, but by no more than the glide in LOW."""
    s = flying(6.0)
    s["mode"], s["airspeed_known"], s["airspeed_m_s"], s["air_left_s"] = mode, 1, 6.0, 0.5
    row = np.zeros(1, MEASURED_DTYPE)[0]
    row["t_s"], row["gps_t_s"], row["gps_valid"], row["gps_p_e_m"] = 10.0, 9.7, 1, (0.0, 0.0, -19.0)
    pitch_rad, throttle = hold_height(40.0, row, s, record(), DT_S)
    assert throttle > 0.9
    assert (pitch_rad < math.radians(-10.0)) == dives
    assert dives or pitch_rad >= E.pitch_trim_rad - E.recovery_sink_m_s / E.airspeed_m_s - 1e-9
