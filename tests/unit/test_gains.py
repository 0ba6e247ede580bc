"""Gains from a time of recovery: the linearised loop against the matrix exponential, and the whole estimator."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from estimator.interface import G_M_S2, MEASURED_DTYPE
from estimator.params.gains import error_after, recommended_gains, recovery_time_s
from estimator.premerlani import Premerlani, PremerlaniParams
from estimator.rotation import heading_rad, inclination_error_rad

DT = 0.02
RECEIVER = {"gps_filter_s": 1.0, "gps_latency_s": 0.3}


def loop(weight, k_p, k_i):
    """System matrix of error and integral: de/dt = -K_P W e + w_I, dw_I/dt = -K_I W e."""
    return np.array([[-k_p * weight, 1.0], [-k_i * weight, 0.0]])


def rows_at_rest(duration_s):
    """Level and still, heading north with a fix of the course five times a second."""
    rows = np.zeros(round(duration_s / DT), MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = (np.arange(len(rows)) + 1) * DT, DT
    rows["force_b_m_s2"] = [0.0, 0.0, -G_M_S2]
    rows["gps_new"][::10], rows["gps_speed_m_s"] = 1, 12.0
    return rows


def estimates_from(params, R, duration_s):
    """What an estimator believes that starts from the wrong attitude `R`."""
    estimator = Premerlani(params)
    state = estimator.snapshot()
    state["R_eb"], state["nose"], state["nose_at_fix"] = R, R[:2, 0], R[:2, 0]
    state["history"] = R[:2, 0]
    estimator.restore(state)
    return estimator.replay(rows_at_rest(duration_s))


def recovered_s(error, remaining):
    """When `error`, a value per tick, is last above the part `remaining` of what it was."""
    return (np.flatnonzero(np.abs(error) > remaining * abs(error[0]))[-1] + 1) * DT


@pytest.mark.parametrize(
    ("weight", "k_p", "k_i"), [(0.3, 1.0, 0.03), (1.2, 0.5, 0.3), (0.4, 1.0, 0.1), (0.5, 2.0, 0.0)]
)
def test_error_after_is_the_matrix_exponential_of_the_loop(weight, k_p, k_i):
    """Two real roots, two complex ones, a double one, and no integral at all."""
    t = np.linspace(0.0, 30.0, 31)
    oracle = [expm(loop(weight, k_p, k_i) * at)[0, 0] for at in t]
    np.testing.assert_allclose(error_after(t, weight, k_p, k_i), oracle, rtol=0, atol=1e-9)


def test_recovery_time_of_a_loop_without_integral_is_that_of_one_exponential():
    """exp(-K_P W t) is a tenth after ln(10) / (K_P W); a loop without weight never recovers."""
    assert recovery_time_s(0.25, 2.0, 0.0) == pytest.approx(math.log(10.0) / 0.5, rel=1e-8)
    assert recovery_time_s(0.0, 1.0, 0.1) == math.inf


@pytest.mark.parametrize("recovery_s", [4.0, 10.0, 25.0])
@pytest.mark.parametrize(("damping", "k_p", "remaining"), [(1.5, 1.0, 0.1), (0.8, 0.5, 0.05), (2.5, 1.0, 0.2)])
def test_recommended_gains_linear_loops_recover_just_in_time(recovery_s, damping, k_p, remaining):
    """Roll-pitch and yaw, by the matrix exponential: at the limit at the time asked for, below it ever after."""
    base = PremerlaniParams(k_p=k_p)
    p = recommended_gains(recovery_s, damping=damping, remaining=remaining, base=base)
    assert 0.5 * p.k_p * math.sqrt(p.w_rp / p.k_i) == pytest.approx(damping, rel=1e-12)
    for weight, within_s in ((p.w_rp, recovery_s), (p.w_y, recovery_s / 4.0)):
        late = [abs(expm(loop(weight, p.k_p, p.k_i) * t)[0, 0]) for t in np.linspace(within_s, 6.0 * within_s, 60)]
        assert max(late) <= remaining + 1e-9
        assert late[0] > 0.95 * remaining or damping < 1.0  # complex roots may recover on the first swing


@pytest.mark.parametrize("tilt_deg", [5.0, 30.0])
@pytest.mark.parametrize("recovery_s", [5.0, 10.0, 20.0])
def test_recommended_gains_estimator_recovers_from_a_tilt_in_that_time(tilt_deg, recovery_s):
    """The whole nonlinear estimator, wrongly banked at the start: a tenth is left at the time asked for."""
    params = recommended_gains(recovery_s)
    R = Rotation.from_euler("x", tilt_deg, degrees=True).as_matrix()
    tilt = inclination_error_rad(estimates_from(params, R, 6.0 * recovery_s)["R_eb"], np.eye(3))
    # The sine falls short of the angle by a 22nd at 30 degrees, and of the largest offset the integral sees no more.
    assert recovered_s(tilt, 0.1) == pytest.approx(recovery_s, rel=0.02 if tilt_deg < 10.0 else 0.15)


@pytest.mark.parametrize("off_deg", [-5.0, 40.0])
def test_recommended_gains_estimator_recovers_its_heading_in_a_quarter_of_that_time(off_deg):
    """The same for yaw, with the receiver's lag out of the loop."""
    R = Rotation.from_euler("z", off_deg, degrees=True).as_matrix()
    heading = heading_rad(estimates_from(recommended_gains(10.0), R, 60.0)["R_eb"])
    assert recovered_s(heading, 0.1) == pytest.approx(2.5, rel=0.05 if off_deg < 0.0 else 0.15)


def test_recommended_gains_with_the_lag_in_the_loop_stay_stable():
    """K_P W_Y lag = 30 degrees: hardly an overshoot; three times that weight, and the heading swings."""
    base = PremerlaniParams(**RECEIVER, rotate_history=False)
    p = recommended_gains(10.0, base=base)
    assert p.k_p * p.w_y * 1.3 == pytest.approx(math.radians(30.0), rel=1e-12)
    R = Rotation.from_euler("z", 30.0, degrees=True).as_matrix()
    overshoot = {}
    for times in (1.0, 4.0):
        params = replace(base, w_rp=p.w_rp, w_y=times * p.w_y, k_i=0.0)
        overshoot[times] = -math.degrees(heading_rad(estimates_from(params, R, 60.0)["R_eb"]).min())
    assert overshoot[1.0] < 3.0  # a tenth
    assert overshoot[4.0] > 9.0


def test_recommended_gains_keep_what_they_do_not_choose():
    """Everything else comes from `base`, K_P too."""
    base = PremerlaniParams(k_p=0.5, launch_gate=0.4, gps_latency_s=0.1)
    p = recommended_gains(8.0, yaw_recovery_s=3.0, base=base)
    assert (p.k_p, p.launch_gate, p.gps_latency_s) == (0.5, 0.4, 0.1)
    assert recovery_time_s(p.w_y, p.k_p, p.k_i) == pytest.approx(3.0, rel=2e-3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"recovery_s": 0.0}, "recovery_s is 0.0"),
        ({"recovery_s": math.nan}, "recovery_s is nan"),
        ({"yaw_recovery_s": -1.0}, "yaw_recovery_s is -1.0"),
        ({"remaining": 1.0}, "remaining is 1.0"),
        ({"damping": 0.0}, "damping is 0.0"),
        ({"damping": 20.0, "remaining": 1e-4}, "damping is 20.0"),
        ({"base": PremerlaniParams(k_p=0.0)}, "k_p is 0.0"),
    ],
)
def test_recommended_gains_impossible_demand_is_refused_by_name(arguments, message):
    """One line that says which and how much."""
    with pytest.raises(ValueError, match=message):
        recommended_gains(**arguments)
