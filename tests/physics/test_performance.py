"""What the performance page is made of, against closed forms and against its own definition."""

import math

import numpy as np
import pytest

from sim.aeroplane.jsbsim_model import Model
from sim.aeroplane.performance import STEP_RAD, measure, radius_m

G_M_S2 = 9.80665


@pytest.fixture(scope="module", params=["endurance", "gentle_lady"])
def measured(request):
    """All trims of an aeroplane with a motor and of one without."""
    return measure(Model(request.param, 200))


def test_polar_is_walked_in_steps_of_angle_from_fast_to_beyond_the_slowest(measured):
    """Every quarter of a degree once; the stall is the slowest of all, and nothing glides slower."""
    alpha = np.array([t.alpha_rad for t in measured.polar])
    np.testing.assert_allclose(np.diff(alpha), STEP_RAD, rtol=0, atol=1e-12)
    assert measured.stall.airspeed_m_s <= min(t.airspeed_m_s for t in measured.polar)
    assert measured.min_sink.climb_m_s >= max(t.climb_m_s for t in measured.polar)
    assert measured.best_glide.climb_rad >= max(t.climb_rad for t in measured.polar)


def test_level_flight_reaches_from_the_stall_to_the_fastest(measured):
    """With a motor level at every speed between stall and top speed; without, the glides up to the stall."""
    levels = measured.levels
    assert len(levels) > 15
    assert all(t.alpha_rad <= measured.stall.alpha_rad for t in levels)
    fastest = measured.polar[0].airspeed_m_s
    if measured.top_speed is not None:
        assert all(t.climb_rad == 0.0 for t in levels)
        fastest = measured.top_speed.airspeed_m_s
    speeds = [t.airspeed_m_s for t in levels]
    assert max(speeds) == pytest.approx(fastest, rel=2e-3)
    assert min(speeds) <= 1.04 * measured.stall.airspeed_m_s


def test_turn_has_the_radius_of_its_speed_and_bank(measured):
    """Coordinated: the sideways lift g tan(bank) bends the way over the ground, r = (V cos(climb))^2 / g tan(bank)."""
    assert len(measured.turns) >= 2
    for t in measured.turns:
        horizontal_m_s = math.sqrt(t.airspeed_m_s**2 - t.climb_m_s**2)
        expected = horizontal_m_s**2 / (G_M_S2 * math.tan(t.roll_rad))
        # Gliding, the lift leans back; and the air on the side, where it slips, pushes for a part of the angle.
        assert radius_m(t) == pytest.approx(expected, rel=0.05 + abs(t.beta_rad))
        assert radius_m(t) * abs(t.turn_rate_rad_s) == pytest.approx(horizontal_m_s, rel=1e-9)
