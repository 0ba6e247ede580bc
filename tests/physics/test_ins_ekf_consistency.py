"""The navigation filter is as good as it says: errors over sigmas in a Monte Carlo with the sensors it assumes.

A consistent filter has errors whose root mean square is one sigma.  Its process noise stands for what it does not
model as states (axes that are crooked, a bias that drifts, readings in steps), hence the band from 0.5 to 2.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.ins_ekf import InsEkf, InsEkfParams
from estimator.interface import G_M_S2
from estimator.rotation import from_euler
from sim.clock import Rates
from sim.log import Log, Phase
from sim.motion.prescribed_plant import GRAVITY_M_S2, Kinematics, motion_rows
from sim.place import LATITUDE_DEG
from sim.sensors.suite import SUITES, Suite

N_FLIGHTS, DURATION_S, SETTLED_S = 16, 70.0, 15.0
GENERIC = SUITES["generic"]
ASSUMED_S, LATENCY_SIGMA_S = 0.3, 0.1
ASSUMED = InsEkfParams(
    gps_filter_s=GENERIC.gps.filter_s, gps_stamped=False, gps_latency_s=ASSUMED_S, gps_latency_sigma_s=LATENCY_SIGMA_S,
    gyro_full_scale_rad_s=math.radians(GENERIC.gyro.range_deg_s),
    force_full_scale_m_s2=GENERIC.accelerometer.range_g * G_M_S2,
)  # fmt: skip
LATE_S = 0.0075  # a fix arrives in the tick of 0.02 s that its latency ends in: later by 0 to 3 steps of 0.005 s


@dataclass(frozen=True)
class Weaving:
    """Level flight, to the left and to the right in turn, between them straight legs; coordinated up to a sideslip.

    The course through the air is chi with chi' = rate sin^3(w t), which stays near zero for a while at each
    change of sign; the nose is off it by a sideslip that swings slowly.
    """

    wind_e_m_s: tuple[float, float, float]
    heading_rad: float = 0.0
    airspeed_m_s: float = 13.0
    rate_rad_s: float = 0.5
    period_s: float = 40.0
    sideslip_rad: float = math.radians(5.0)  # 0.8 m/s along the wing, RMS: slip and the gusts of a light turbulence
    sideslip_phase_rad: float = 0.0
    phase = Phase.FLYING

    def at(self, t_s):
        """See `Motion.at`; the position is left to `fly`."""
        w, V = 2.0 * np.pi / self.period_s, self.airspeed_m_s
        s, c = np.sin(w * t_s), np.cos(w * t_s)
        chi = self.heading_rad + self.rate_rad_s / w * (2.0 / 3.0 - c + c**3 / 3.0)
        dchi, ddchi = self.rate_rad_s * s**3, 3.0 * self.rate_rad_s * w * s**2 * c
        slip = 2.0 * np.pi / 7.0 * t_s + self.sideslip_phase_rad
        yaw, dyaw = chi - self.sideslip_rad * np.sin(slip), dchi - self.sideslip_rad * 2.0 * np.pi / 7.0 * np.cos(slip)
        lean = V * dchi / GRAVITY_M_S2
        roll, droll = np.arctan(lean), V * ddchi / GRAVITY_M_S2 / (1.0 + lean**2)
        still = np.zeros_like(t_s)
        along = np.stack([np.cos(chi), np.sin(chi), still], axis=-1)
        across = np.stack([-np.sin(chi), np.cos(chi), still], axis=-1)
        return Kinematics(
            from_euler(roll, 0.0, yaw),
            np.stack([droll, dyaw * np.sin(roll), dyaw * np.cos(roll)], axis=-1),
            np.zeros((len(t_s), 3)),
            V * along + np.array(self.wind_e_m_s),
            (V * dchi)[:, None] * across,
        )


def test_weaving_kinematics_are_consistent():
    """The motion is one: rates and accelerations are the derivatives of attitude and velocity (4th order)."""
    motion, h = Weaving((3.0, -2.0, 0.0), 0.4), 1e-3
    t_s = np.linspace(0.0, 40.0, 81)
    stencil = [(-2, 1.0 / 12.0), (-1, -2.0 / 3.0), (1, 2.0 / 3.0), (2, -1.0 / 12.0)]
    dR = sum(c * motion.at(t_s + i * h).R_eb for i, c in stencil) / h
    dv = sum(c * motion.at(t_s + i * h).v_e_m_s for i, c in stencil) / h
    at = motion.at(t_s)
    W = np.einsum("nji,njk->nik", at.R_eb, dR)
    np.testing.assert_allclose(dv, at.a_e_m_s2, rtol=0, atol=1e-8)  # h^4 times fifth derivatives, and round-off / h
    np.testing.assert_allclose(
        np.stack([W[:, 2, 1], W[:, 0, 2], W[:, 1, 0]], axis=-1), at.omega_b_rad_s, rtol=0, atol=1e-8
    )


def fly(seed):
    """Errors and sigmas of one flight at the filter's own time, (n, 2, axes) each, from `SETTLED_S` on.

    The latency of the receiver is drawn from what the filter assumes, and no fix carries a stamp.
    """
    rng = np.random.default_rng(seed)
    rates = Rates(gps_hz=4)
    log = Log.empty(rates.ticks(DURATION_S))
    wind = (*rng.normal(0.0, 4.0, 2), 0.0)
    motion = Weaving(
        wind,
        heading_rad=rng.uniform(0.0, 2.0 * np.pi),
        period_s=rng.uniform(30.0, 50.0),
        rate_rad_s=rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 0.6),
        sideslip_phase_rad=rng.uniform(0.0, 2.0 * np.pi),
    )
    log.truth[:] = motion_rows(motion, len(log), rates.dt_s, math.radians(LATITUDE_DEG))
    log.truth["p_e_m"] = np.cumsum(log.truth["v_e_m_s"], axis=0) * rates.dt_s  # or its fixes could not be true
    latency_s = (
        round(float(np.clip(rng.normal(ASSUMED_S, LATENCY_SIGMA_S), 0.02, 1.0)) * rates.physics_hz) / rates.physics_hz
    )
    params = replace(GENERIC, gps=replace(GENERIC.gps, latency_s=latency_s))
    suite = Suite(params, rates, seed)
    suite.reset(log)
    estimator = InsEkf(ASSUMED)
    errors = {name: [] for name in ("tilt", "heading", "velocity", "gyro bias", "wind", "latency")}
    for k in range(len(log)):
        estimator.update(suite.measure(k))
        if k * rates.dt_s < SETTLED_S or k % 25:
            continue
        state, sigma = estimator.snapshot()[0], estimator.sigma()
        then = log.truth[round(float(state["filter_clock_s"]) / rates.dt_s) - 1]
        turn = Rotation.from_matrix(then["R_eb"] @ state["R_filter_eb"].T).as_rotvec()
        errors["tilt"].append((turn[:2], sigma["tilt_e_rad"][:2]))
        errors["heading"].append((turn[2:], sigma["tilt_e_rad"][2:]))
        errors["velocity"].append((then["v_e_m_s"] - state["v_e_m_s"], sigma["v_e_m_s"]))
        errors["gyro bias"].append((then["gyro_bias_b_rad_s"] - state["gyro_bias_b_rad_s"], sigma["gyro_bias_b_rad_s"]))
        errors["latency"].append(([latency_s + LATE_S - state["latency_s"]], sigma["gps_latency_s"]))
        errors["wind"].append((then["wind_e_m_s"][:2] - state["wind_e_m_s"][:2], sigma["wind_e_m_s"]))
    return {name: np.array(pairs) for name, pairs in errors.items()}


@pytest.fixture(scope="module")
def flights():
    """The Monte Carlo: error and sigma, (flights, times, 2, axes) per quantity."""
    flown = [fly(seed) for seed in range(N_FLIGHTS)]
    return {name: np.array([flight[name] for flight in flown]) for name in flown[0]}


@pytest.mark.parametrize("quantity", ["tilt", "heading", "velocity", "gyro bias", "wind", "latency"])
def test_normalised_error_monte_carlo_is_near_one(flights, quantity):
    """The root mean square of error over sigma, over flights, times and axes, lies between 0.5 and 2."""
    error, sigma = flights[quantity][:, :, 0], flights[quantity][:, :, 1]
    normalised = np.sqrt(np.mean((error / sigma) ** 2))
    assert 0.5 <= normalised <= 2.0, f"{quantity}: {normalised:.2f}, error {np.sqrt(np.mean(error**2)):.4g}"


def test_errors_monte_carlo_are_small(flights):
    """A filter that is consistent because it knows nothing would be no use; limits are twice what is measured."""
    rms = {name: float(np.sqrt(np.mean(np.sum(pairs[:, :, 0] ** 2, axis=-1)))) for name, pairs in flights.items()}
    assert math.degrees(rms["tilt"]) <= 1.4  # 0.78
    assert math.degrees(rms["heading"]) <= 3.2  # 1.69
    assert rms["velocity"] <= 0.3  # 0.15
    assert rms["wind"] <= 0.8  # 0.44
    assert rms["latency"] <= 0.03  # 0.020, of 0.1 assumed
