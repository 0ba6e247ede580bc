"""The delta-angle, delta-velocity inertial unit against the quadrature of the closed forms.

Both are means over a tick of length h, to second order in h.  Expand about the middle of the tick, with w the
body rate, f the specific force, and dots for their derivatives (that of f in earth axes):

* the rotation vector is the integral of the rate plus h^3 / 12 w x w' (Bortz 1971; the coning term), so that
  the gyro differs by |w x w'| h^2 / 12;
* the mean of R^T f against the half-way attitude times the mean of f differs by
  h^2 / 12 |w| |f'| + h^2 / 24 (|w|^2 + |w'|) |f|, and the half-way attitude on the arc is h^2 / 8 |w'| from the
  attitude at half time.
"""

import math

import numpy as np
import pytest

from sim.clock import Rates
from sim.motion.prescribed_plant import (
    Coning,
    HandHeld,
    Loop,
    Rest,
    SteadyTurn,
    StraightLevel,
    motion_rows,
)
from sim.place import LATITUDE_DEG
from sim.truth import EARTH_RATE_RAD_S, earth_rate_e_rad_s, gravity_m_s2, integrate_imu

LATITUDE_RAD = math.radians(LATITUDE_DEG)
G = gravity_m_s2(LATITUDE_RAD)


def largest_differences(motion, imu_hz, n_ticks=400):
    """Largest norm of the difference of both, rate and force, over all ticks but the first."""
    dt_s = Rates(imu_hz=imu_hz).dt_s
    truth = motion_rows(motion, n_ticks, dt_s, LATITUDE_RAD)
    integrated = truth.copy()
    for k in range(1, n_ticks):
        integrate_imu(
            truth["R_eb"][k - 1], truth["v_e_m_s"][k - 1], integrated[k], dt_s, G, earth_rate_e_rad_s(LATITUDE_RAD)
        )
    return [
        np.linalg.norm(integrated[name][1:] - truth[name][1:], axis=1).max()
        for name in ("imu_omega_b_rad_s", "imu_force_b_m_s2")
    ]


@pytest.mark.parametrize("imu_hz", [50, 100, 200])
def test_integrated_rate_coning_differs_by_the_coning_term(imu_hz):
    """On a cone |w x w'| is closed-form, and the difference reaches it and no more."""
    A, w, h = math.radians(10.0), 2.0 * math.pi, 1.0 / imu_hz
    rate_difference, force_difference = largest_differences(Coning(A, w), imu_hz)
    s, c = math.sin(A), math.cos(A)
    coning = w**3 * s * math.hypot(s, 1.0 - c) * h**2 / 12.0
    earth = EARTH_RATE_RAD_S * (w * s * h) ** 2 / 8.0  # the chord of the earth's rate, not its arc
    assert 0.9 * coning <= rate_difference <= coning * (1.0 + (w * h) ** 2) + earth
    rate, change = w * math.hypot(s, 1.0 - c), w**2 * s
    bound = ((rate**2 + change) / 24.0 + change / 8.0) * G * h**2
    assert 0.3 * bound <= force_difference <= bound * (1.0 + (w * h) ** 2)


def test_integrated_imu_coning_converges_with_second_order():
    """Half the tick, a quarter of the difference."""
    coarse, middle, fine = (largest_differences(Coning(math.radians(10.0)), hz) for hz in (50, 100, 200))
    for i in range(2):
        orders = math.log2(coarse[i] / middle[i]), math.log2(middle[i] / fine[i])
        np.testing.assert_allclose(orders, 2.0, rtol=0, atol=0.02)  # next term: (w h)^2 = 0.016 at 50 Hz


@pytest.mark.parametrize(
    ("motion", "rate", "force", "force_change"),
    [
        (Rest(0.4, -0.3, 1.0), 0.0, G, 0.0),
        (StraightLevel(0.6, surge_m_s2=2.0, surge_s=4.0), 0.0, G + 2.0, 2.0 * math.pi / 2.0),
        (
            SteadyTurn(math.radians(45.0), 12.0, wind_e_m_s=(4.0, 1.0, 0.0)),
            G / 12.0,
            math.sqrt(2.0) * G,
            G * G / 12.0,
        ),
        (Loop(2.0, 15.0, wind_e_m_s=(4.0, 1.0, 0.0)), 2.0, G + 30.0, 60.0),
    ],
    ids=["rest", "surge", "turn", "loop"],
)
@pytest.mark.parametrize("imu_hz", [50, 200])
def test_integrated_imu_at_constant_rate_stays_within_the_derived_bound(motion, rate, force, force_change, imu_hz):
    """A constant rate is integrated exactly (but for the earth's, a chord); the force to second order."""
    h = 1.0 / imu_hz
    rate_difference, force_difference = largest_differences(motion, imu_hz)
    round_off = 1e-12  # 1e-15 of angle over 5 ms, and a velocity change of 20 m/s x 2e-16 over it
    assert rate_difference <= EARTH_RATE_RAD_S * (rate * h) ** 2 / 8.0 + round_off
    coriolis = 2.0 * EARTH_RATE_RAD_S * force_change / max(rate, 1.0) * h**2 / 6.0
    bound = (rate * force_change / 12.0 + rate**2 * force / 24.0) * h**2
    assert force_difference <= bound * (1.0 + (rate * h) ** 2) + coriolis + round_off


def test_integrated_imu_in_the_hand_is_below_the_converters_step():
    """At 3 deg/s both units are the same to a thousandth of the steps of a 10-bit converter."""
    rate_difference, force_difference = largest_differences(HandHeld(), 50)
    assert rate_difference <= 1e-3 * math.radians(600.0 / 1024.0)
    assert force_difference <= 1e-3 * 6.0 * 9.80665 / 1024.0


@pytest.mark.parametrize("imu_hz", [50, 200])
def test_integrated_force_along_the_axis_of_a_turn_is_exact(imu_hz):
    """Turning about the vertical, the vertical force is the same all through a tick: no second-order term is left.

    What remains is Coriolis, whose horizontal velocity is taken along the chord instead of the arc.
    """
    dt_s, motion = Rates(imu_hz=imu_hz).dt_s, SteadyTurn(math.radians(60.0), 12.0)
    truth = motion_rows(motion, 100, dt_s, LATITUDE_RAD)
    angle = motion.turn_rate_rad_s * dt_s
    coriolis = 2.0 * EARTH_RATE_RAD_S * 12.0 * angle**2
    for k in range(1, 100):
        row = truth[k : k + 1].copy()[0]
        integrate_imu(truth["R_eb"][k - 1], truth["v_e_m_s"][k - 1], row, dt_s, G, earth_rate_e_rad_s(LATITUDE_RAD))
        down_b = truth["R_eb"][k, 2]  # constant in the body
        difference = down_b @ (row["imu_force_b_m_s2"] - truth["imu_force_b_m_s2"][k])
        np.testing.assert_allclose(difference, 0.0, rtol=0, atol=coriolis + 1e-12)
