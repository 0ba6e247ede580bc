"""The wind filter on closed-form flight: circles, straight legs, and the two-fix form it comes from."""

import math

import numpy as np
import pytest

from estimator.blocks import wind
from estimator.blocks.compiled import BELIEF
from estimator.interface import dtype_of

STATE = dtype_of((*BELIEF, *wind.WIND_FILTER))
CHECKED = dtype_of((*BELIEF, *wind.WIND_CHECK))


@wind.kernel
def learn(state, nose, v, dt_s):
    """`learn_wind` over many fixes; `nose` and `v` are complex, north + i east."""
    for k in range(len(v)):
        wind.learn_wind(state[0], nose[k].real, nose[k].imag, v[k].real, v[k].imag, dt_s)


def fly(heading, true_wind, airspeed=12.6, offset=0.0, noise=0.0, dt_s=0.25):
    """State after fixes along `heading`, the gyros' nose being off by `offset`."""
    state = np.zeros(1, STATE)
    rng = np.random.default_rng(3)
    v = true_wind + airspeed * np.exp(1j * heading)
    v = v + noise * (rng.standard_normal(len(v)) + 1j * rng.standard_normal(len(v)))
    learn(state, np.exp(1j * (heading - offset)), v, dt_s)
    return state[0]


def complex_of(pair):
    """North + i east."""
    return complex(pair[0], pair[1])


@pytest.mark.parametrize("true_wind", [5.0, -3.0 + 4.0j, 0.0, 8.0j])
@pytest.mark.parametrize("offset_deg", [0.0, 20.0, -160.0])
def test_learn_wind_in_a_circle_is_within_half_a_metre_per_second(true_wind, offset_deg):
    """One circle in 12 s at 4 Hz with 0.3 m/s of noise, whatever heading the gyros started from."""
    heading = np.linspace(0.3, 0.3 + 2 * math.pi, 48)
    s = fly(heading, true_wind, offset=math.radians(offset_deg), noise=0.3)
    assert abs(complex_of(s["wind_e_m_s"]) - true_wind) < 0.5
    assert s["wind_known"] == 1
    # c undoes the offset: it is the airspeed, turned from the gyros' heading to the true one.
    off = complex_of(s["air_m_s"]) / (12.6 * np.exp(1j * math.radians(offset_deg)))
    assert abs(off - 1.0) < 0.06


@pytest.mark.parametrize("hz", [1, 4, 10])
def test_learn_wind_does_not_depend_on_the_rate_of_the_fixes(hz):
    """A circle tells what it tells, in 12 fixes or in 120."""
    s = fly(np.linspace(0.0, 2 * math.pi, 12 * hz), 5.0 - 2.0j, dt_s=1.0 / hz)
    assert abs(complex_of(s["wind_e_m_s"]) - (5.0 - 2.0j)) < 0.5
    assert math.sqrt(s["wind_variance"]) == pytest.approx(0.45, rel=0, abs=0.1)


def test_learn_wind_straight_ahead_claims_no_wind_and_none_is_forgotten():
    """Without a turn the wind stays unknown and near what was expected; after one it is kept for minutes."""
    ahead = np.full(480, 1.0)
    s = fly(ahead, 5.0j)
    assert s["wind_known"] == 0
    assert abs(complex_of(s["wind_e_m_s"])) < 1.0
    s = fly(np.concatenate([np.linspace(1.0, 1.0 + 2 * math.pi, 48), ahead]), 5.0j)
    assert s["wind_known"] == 1
    assert abs(complex_of(s["wind_e_m_s"]) - 5.0j) < 0.5


def test_learn_wind_from_two_fixes_is_the_two_fix_form(monkeypatch):
    """Nothing expected and nothing off: c = dv / df, w = (v1 + v2 - c (f1 + f2)) / 2."""
    f, v = np.array([1.0, 0.6 + 0.8j]), np.array([9.0 + 3.0j, 12.0 - 4.0j])
    c = (v[1] - v[0]) / (f[1] - f[0])
    oracle = 0.5 * (v[0] + v[1] - c * (f[0] + f[1]))
    monkeypatch.setattr(wind, "WIND_BEFORE_M_S", 1e4)
    monkeypatch.setattr(wind, "AIRSPEED_BEFORE_M_S", 1e4)
    monkeypatch.setattr(wind, "RESIDUAL_M_S", 1e-3)
    monkeypatch.setattr(wind, "WIND_WALK", 0.0)
    monkeypatch.setattr(wind, "AIRSPEED_WALK", 0.0)
    state = np.zeros(1, STATE)
    for nose, velocity in zip(f, v, strict=True):
        wind.learn_wind.py_func(state.view(np.recarray)[0], nose.real, nose.imag, velocity.real, velocity.imag, 1.0)
    # The expectation weighs (1e-3 / 1e4)^2 against the fixes; the floor of the variances leaves no trace in two steps.
    assert abs(complex_of(state[0]["wind_e_m_s"]) - oracle) < 1e-5
    assert abs(complex_of(state[0]["air_m_s"]) - c) < 1e-5


@pytest.mark.parametrize("flips", [True, False])
def test_learn_wind_is_consistent_in_its_own_world(flips):
    """Errors of the size it expects, over 200 flights: the squared error over the variance it states is near 1."""
    ratios = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        n, dt_s = 60, 1.0
        two = rng.standard_normal((4, n))
        true_wind = wind.WIND_BEFORE_M_S * complex(*rng.standard_normal(2)) + wind.WIND_WALK * math.sqrt(
            dt_s
        ) * np.cumsum(two[0] + 1j * two[1])
        turn = np.where(np.arange(n) % 20 < 10, 0.3, -0.3 if flips else 0.3) * dt_s
        nose = np.exp(1j * np.cumsum(turn))
        c = 12.6 + wind.AIRSPEED_WALK * math.sqrt(dt_s) * np.cumsum(two[2] + 1j * two[3])
        v = true_wind + c * nose + wind.RESIDUAL_M_S * (rng.standard_normal(n) + 1j * rng.standard_normal(n))
        state = np.zeros(1, STATE)
        learn(state, nose, v, dt_s)
        error = complex_of(state[0]["wind_e_m_s"]) - true_wind[-1]
        ratios.append(abs(error) ** 2 / (2.0 * state[0]["wind_variance"]))
    # The mean of 200 chi-square values of two degrees of freedom, halved: 1 +- 3 / sqrt(200); gate and bounds cost 0.1.
    assert np.mean(ratios) == pytest.approx(1.0, rel=0, abs=0.3)


def test_learn_wind_outlier_and_short_nose_teach_nothing():
    """A fix 40 m/s off, or one from within a loop, moves neither wind nor airspeed."""
    state = np.zeros(1, STATE)
    heading = np.linspace(0.0, 2 * math.pi, 48)
    learn(state, np.exp(1j * heading), 3.0 + 12.6 * np.exp(1j * heading), 0.25)
    before = state.copy()
    learn(state, np.array([1.0 + 0.0j, 0.3 + 0.2j]), np.array([60.0 + 0.0j, 15.0 + 0.0j]), 0.25)
    for name in ("wind_e_m_s", "air_m_s"):
        np.testing.assert_array_equal(state[name], before[name])


def test_learn_wind_in_a_change_of_wind_follows_within_two_circles():
    """From 5 m/s from the south to 5 from the west, in half a minute of circling: the gate must not lock it out."""
    heading = np.linspace(0.0, 8 * math.pi, 192)
    true_wind = np.where(np.arange(192) < 96, 5.0, 5.0j)
    s = fly(heading, true_wind)
    assert abs(complex_of(s["wind_e_m_s"]) - 5.0j) < 2.5


def plain_filter(w, c, P, f, v, dt_s):
    """One fix in a Kalman filter of two complex states, in NumPy: states, covariance, whether it was believed."""
    P = P + np.diag([0.06**2, 0.6**2]) * dt_s
    P[0, 0], P[1, 1] = min(P[0, 0].real, 16.0), min(P[1, 1].real, 900.0)
    H = np.array([[1.0, f]])
    e = v - w - c * f
    S = (H @ P @ H.conj().T)[0, 0].real + 1.0 / min(max(dt_s, 1e-3), 1.0)
    if abs(e) ** 2 > 16.0 * S:
        P[1, 1] = min(P[1, 1].real + abs(e) ** 2 * min(dt_s / 4.0, 1.0), 900.0)
        return w, c, P, False
    K = P @ H.conj().T / S
    w, c = np.array([w, c]) + K[:, 0] * e
    return w, c, P - K @ H @ P, True


@pytest.mark.parametrize("dt_s", [0.1, 0.25, 1.0, 2.0])
def test_learn_wind_equals_a_plain_kalman_filter_with_and_without_surprises(dt_s):
    """Turning and straight, with three fixes that are 9 to 60 m/s off: every number of the belief, at any rate."""
    rng = np.random.default_rng(5)
    state, w, c, P = np.zeros(1, STATE), 0j, 0j, np.diag([16.0 + 0j, 900.0])
    heading, refused = np.cumsum(np.where(np.arange(120) % 40 < 25, 0.3 * min(dt_s, 1.0), 0.0)), 0
    for k in range(120):
        f = 0.9 * np.exp(1j * heading[k])
        v = 4.0 - 3.0j + 12.0 * f * np.exp(0.4j) + complex(*rng.normal(0.0, 0.2, 2))
        v += {50: 60.0j, 51: 55.0j, 90: -9.0}.get(k, 0.0)
        learn(state, np.array([f]), np.array([v]), dt_s)
        w, c, P, believed = plain_filter(w, c, P, f, v, dt_s)
        refused += not believed
        s = state[0]
        found = [complex_of(s["wind_e_m_s"]), complex_of(s["air_m_s"]), complex_of(s["wind_air_covariance"])]
        np.testing.assert_allclose(found, [w, c, P[0, 1]], rtol=0, atol=1e-9)
        np.testing.assert_allclose([s["wind_variance"], s["air_variance"]], np.diag(P).real, rtol=0, atol=1e-9)
    assert refused > 0


@wind.kernel
def check(state, v, dt_s):
    """`check_wind` over many fixes; `v` is complex, north + i east."""
    for velocity in v:
        wind.check_wind(state[0], velocity.real, velocity.imag, dt_s)


@wind.kernel
def by_speed(state):
    """`wind_by_speed` of the state."""
    return wind.wind_by_speed(state[0])


def checked(v, believed, dt_s=0.25):
    """State after fixes with the ground velocities `v`, in which the estimator believes the wind `believed`."""
    state = np.zeros(1, CHECKED)
    state["wind_e_m_s"][0, :2] = believed.real, believed.imag
    check(state, np.asarray(v, complex), dt_s)
    return state


CIRCLES = 12.6 * np.exp(1j * np.linspace(0.3, 0.3 + 8 * math.pi, 240))  # four in a minute, 4 Hz
AHEAD = np.full(240, 12.6 + 0.0j)


@pytest.mark.parametrize("true_wind", [0.0j, 6.0 + 0.0j, -4.0 + 9.0j, 14.0j])
def test_wind_by_speed_in_circles_is_the_wind(true_wind):
    """Closed form: a constant airspeed in all directions gives the wind to round-off, also one above the airspeed."""
    north, east, sigma_m_s = by_speed(checked(CIRCLES + true_wind, true_wind))
    assert abs(complex(north, east) - true_wind) < 1e-6
    # Of a circle the smaller variance is V^2 / 2: sigma sqrt(2 / n), n the weight of a minute that is forgotten.
    n = wind.CHECK_S * (1.0 - math.exp(-60.0 / wind.CHECK_S))
    speed = max(12.6, math.sqrt(np.mean(np.abs(CIRCLES + true_wind) ** 2)))
    assert sigma_m_s == pytest.approx(speed / 12.6 * math.sqrt(2.0 / n), rel=0.05)


@pytest.mark.parametrize("true_wind", [6.0 + 0.0j, -6.0 + 0.0j, 6.0j, 11.0 + 0.0j])
def test_check_wind_straight_ahead_confirms_nothing(true_wind):
    """Head, tail and cross wind: not even the right wind, with noise of the receiver and a heading that wanders."""
    rng = np.random.default_rng(1)
    wander = np.exp(1j * np.radians(4.0) * np.sin(np.arange(240) / 30.0))
    noise = 0.1 * (rng.standard_normal(240) + 1j * rng.standard_normal(240))
    for believed in (true_wind, 0.4 + 0.0j, AHEAD[0] + true_wind):
        assert checked(AHEAD * wander + true_wind + noise, believed)["wind_known"][0] == 0


@pytest.mark.parametrize("off", [2.0 + 0.0j, -1.4j, 5.0 - 5.0j])
def test_check_wind_confirms_the_right_wind_and_no_other(off):
    """After circles, the wind is confirmed within 1 m/s; one that is wrong by more is not."""
    v = CIRCLES + (5.0 - 2.0j)
    assert checked(v, 5.0 - 2.0j)["wind_known"][0] == 1
    assert checked(v, 5.3 - 2.5j)["wind_known"][0] == 1
    assert checked(v, 5.0 - 2.0j + off)["wind_known"][0] == 0


def test_check_wind_needs_a_steady_airspeed():
    """With an airspeed that goes up and down by a sixth, every 12 s, the speeds tell no wind."""
    v = CIRCLES * (1.0 + np.sin(np.arange(240) / 7.6) / 6.0) + 5.0
    state = checked(v, 5.0 + 0.0j)
    assert math.isinf(by_speed(state)[2])
    assert state["wind_known"][0] == 0


def test_check_wind_forgets_in_straight_flight():
    """Five minutes straight ahead after the circles: the wind is no longer confirmed."""
    state = checked(CIRCLES + 5.0, 5.0 + 0.0j)
    assert state["wind_known"][0] == 1
    check(state, np.full(1200, 17.6 + 0.0j), 0.25)
    assert state["wind_known"][0] == 0
