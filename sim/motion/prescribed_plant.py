"""Closed-form motion as a Plant: open-loop truth for tests and claims.

A motion gives position and rotation in closed form over an array of times.  The plant samples it at the ends of the
ticks and computes the inertial means by Gauss-Legendre quadrature, independent of the delta-angle, delta-velocity
arithmetic of `sim.truth.integrate_imu`.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from autopilot.interface import ActuatorCommand
from estimator.interface import Array
from estimator.rotation import from_euler
from sim.clock import Rates
from sim.log import TRUTH_DTYPE, Log, Outcome, Phase
from sim.place import LATITUDE_DEG
from sim.truth import earth_rate_e_rad_s, gravity_m_s2

GRAVITY_M_S2 = gravity_m_s2(math.radians(LATITUDE_DEG))
CALM = (0.0, 0.0, 0.0)
_NODES = 5  # of the quadrature: exact for polynomials of degree 9 within a tick


@dataclass(frozen=True, slots=True)
class Kinematics:
    """A motion at n times, relative to the earth.

    R_eb : (n, 3, 3)   omega_b_rad_s : (n, 3), earth rotation excluded   p_e_m, v_e_m_s, a_e_m_s2 : (n, 3)
    """

    R_eb: Array
    omega_b_rad_s: Array
    p_e_m: Array
    v_e_m_s: Array
    a_e_m_s2: Array


class Motion(Protocol):
    """Closed-form motion of a body from `t_s` = 0.

    Optional attributes: ``phase`` (default FLYING), ``wind_e_m_s``, the velocity of the air over the ground (default
    calm), and ``rotor_rpm``, the speed of its rotors (default 0).
    """

    def at(self, t_s: Array) -> Kinematics:
        """The motion at the times `t_s`, shape (n,)."""
        ...


def _vectors(*components: Array | float) -> Array:
    return np.stack(np.broadcast_arrays(*components), axis=-1).astype(float)


def _matrices(*rows: Array) -> Array:
    return np.stack(np.broadcast_arrays(*rows), axis=-2)


def _require(motion: object, name: str, unit: str, right: bool, choose: str) -> None:
    if not right:
        raise ValueError(f"{type(motion).__name__}.{name} = {getattr(motion, name)!r} {unit}: choose {choose}")


@dataclass(frozen=True, slots=True)
class Rest:
    """At rest at the given attitude, as on a table."""

    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    heading_rad: float = 0.0
    height_m: float = 1.7
    phase: ClassVar[Phase] = Phase.RESTING

    def at(self, t_s: Array) -> Kinematics:
        """See `Motion.at`."""
        still = np.zeros((len(t_s), 3))
        R_eb = from_euler(self.roll_rad, self.pitch_rad, self.heading_rad + 0.0 * t_s)
        return Kinematics(R_eb, still, still - _vectors(0.0, 0.0, self.height_m), still, still)


@dataclass(frozen=True, slots=True)
class HandHeld:
    """Turned in a hand at a fixed position: each Euler angle is a sum of sines.

    peak_rate_rad_s : upper bound of the body rate       hz, phase_rad : (3, m), of roll, pitch and yaw
    """

    peak_rate_rad_s: float = math.radians(3.0)
    hz: tuple[tuple[float, ...], ...] = ((0.31, 0.73), (0.37, 0.83), (0.23, 0.61))
    phase_rad: tuple[tuple[float, ...], ...] = ((0.0, 1.0), (2.0, 3.0), (4.0, 5.0))
    height_m: float = 1.7
    phase: ClassVar[Phase] = Phase.HELD

    def at(self, t_s: Array) -> Kinematics:
        """See `Motion.at`."""
        w_rad_s = 2.0 * np.pi * np.array(self.hz)[:, :, None]
        # |omega|^2 = r'^2 + p'^2 + y'^2 - 2 r' y' sin(pitch) <= 5 (largest rate of an Euler angle)^2
        rate_rad_s = self.peak_rate_rad_s / math.sqrt(5.0) / w_rad_s.shape[1]
        angle = w_rad_s * t_s + np.array(self.phase_rad)[:, :, None]
        roll, pitch, yaw = np.sum(-rate_rad_s / w_rad_s * np.cos(angle), axis=1)
        droll, dpitch, dyaw = np.sum(rate_rad_s * np.sin(angle), axis=1)
        sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
        omega_b = _vectors(droll - dyaw * sp, dpitch * cr + dyaw * sr * cp, dyaw * cr * cp - dpitch * sr)
        still = np.zeros((len(t_s), 3))
        p_e = still - _vectors(0.0, 0.0, self.height_m)
        return Kinematics(from_euler(roll, pitch, yaw), omega_b, p_e, still, still)


@dataclass(frozen=True, slots=True)
class Coning:
    """The body z axis moves on a cone about the vertical: the classical worst case of attitude integration.

    The rotation vector is amplitude (cos wt, sin wt, 0), so the body rate is
    (-w sin A sin wt, w sin A cos wt, -w (1 - cos A)): a mean yaw rate without mean yaw.

    amplitude_rad : half angle of the cone      rate_rad_s : w, one revolution in 2 pi / w
    """

    amplitude_rad: float = math.radians(5.0)
    rate_rad_s: float = 2.0 * math.pi
    height_m: float = 1.7
    phase: ClassVar[Phase] = Phase.HELD

    def at(self, t_s: Array) -> Kinematics:
        """See `Motion.at`."""
        s, c = math.sin(self.amplitude_rad), math.cos(self.amplitude_rad)
        nx, ny = np.cos(self.rate_rad_s * t_s), np.sin(self.rate_rad_s * t_s)
        R_eb = _matrices(
            _vectors(c + (1.0 - c) * nx * nx, (1.0 - c) * nx * ny, s * ny),
            _vectors((1.0 - c) * nx * ny, c + (1.0 - c) * ny * ny, -s * nx),
            _vectors(-s * ny, s * nx, c + 0.0 * nx),
        )
        omega_b = self.rate_rad_s * _vectors(-s * ny, s * nx, c - 1.0)
        still = np.zeros((len(t_s), 3))
        return Kinematics(R_eb, omega_b, still - _vectors(0.0, 0.0, self.height_m), still, still)


@dataclass(frozen=True, slots=True)
class FreeFall:
    """Dropped, tumbling about its y axis: an accelerometer reads zero.

    height_m : of the release       tumble_rad_s : pitch rate
    """

    height_m: float = 100.0
    tumble_rad_s: float = 0.0

    def at(self, t_s: Array) -> Kinematics:
        """See `Motion.at`."""
        return Kinematics(
            from_euler(0.0, self.tumble_rad_s * t_s, 0.0),
            _vectors(0.0, self.tumble_rad_s + 0.0 * t_s, 0.0),
            _vectors(0.0, 0.0, 0.5 * GRAVITY_M_S2 * t_s**2 - self.height_m),
            _vectors(0.0, 0.0, GRAVITY_M_S2 * t_s),
            _vectors(0.0, 0.0, GRAVITY_M_S2 + 0.0 * t_s),
        )


@dataclass(frozen=True, slots=True)
class StraightLevel:
    """Straight and level without sideslip, airspeed constant or with a cosine acceleration.

    heading_rad : of the nose                       airspeed_m_s : mean
    surge_m_s2, surge_s : amplitude and period of the acceleration along the nose
    """

    heading_rad: float = 0.0
    airspeed_m_s: float = 12.6
    height_m: float = 60.0
    wind_e_m_s: tuple[float, float, float] = CALM
    surge_m_s2: float = 0.0
    surge_s: float = 10.0

    def __post_init__(self) -> None:
        _require(self, "surge_s", "s", self.surge_s > 0.0, "a period above 0 s")

    def at(self, t_s: Array) -> Kinematics:
        """See `Motion.at`."""
        nose = np.array([math.cos(self.heading_rad), math.sin(self.heading_rad), 0.0])
        w = 2.0 * math.pi / self.surge_s
        t, wind = t_s[:, None], np.array(self.wind_e_m_s)
        a = self.surge_m_s2 * np.cos(w * t)
        speed = self.airspeed_m_s + self.surge_m_s2 / w * np.sin(w * t)
        way = self.airspeed_m_s * t + self.surge_m_s2 / w**2 * (1.0 - np.cos(w * t))
        return Kinematics(
            from_euler(0.0, 0.0, self.heading_rad + 0.0 * t_s),
            np.zeros((len(t_s), 3)),
            way * nose + wind * t - [0.0, 0.0, self.height_m],
            speed * nose + wind,
            a * nose,
        )


@dataclass(frozen=True, slots=True)
class SteadyTurn:
    """Level turn without sideslip in steady wind: tan(bank) = airspeed x turn rate / g.

    bank_rad : positive turns right      airspeed_m_s : along the nose      heading_rad : initial
    """

    bank_rad: float
    airspeed_m_s: float = 12.6
    heading_rad: float = 0.0
    height_m: float = 60.0
    wind_e_m_s: tuple[float, float, float] = CALM

    def __post_init__(self) -> None:
        _require(self, "airspeed_m_s", "m/s", self.airspeed_m_s > 0.0, "a speed above 0 m/s")
        _require(self, "bank_rad", "rad", abs(self.bank_rad) < math.pi / 2, "a bank between -pi/2 and pi/2 rad")

    @property
    def turn_rate_rad_s(self) -> float:
        """Rate of the heading; the earth's rotation and the change of gravity with latitude are neglected."""
        return GRAVITY_M_S2 * math.tan(self.bank_rad) / self.airspeed_m_s

    def at(self, t_s: Array) -> Kinematics:
        """See `Motion.at`."""
        V, rate = self.airspeed_m_s, self.turn_rate_rad_s
        yaw = self.heading_rad + rate * t_s
        sine, cosine = np.sin(yaw), np.cos(yaw)
        # The chord of the arc through the air points along the mean heading; sinc allows a rate of 0.
        chord = V * t_s * np.sinc(rate * t_s / (2.0 * np.pi))
        mean_yaw = self.heading_rad + 0.5 * rate * t_s
        omega_b = rate * np.array([0.0, math.sin(self.bank_rad), math.cos(self.bank_rad)])
        wind = np.array(self.wind_e_m_s)
        p_air = _vectors(chord * np.cos(mean_yaw), chord * np.sin(mean_yaw), -self.height_m)
        return Kinematics(
            from_euler(self.bank_rad, 0.0, yaw),
            np.tile(omega_b, (len(t_s), 1)),
            p_air + wind * t_s[:, None],
            V * _vectors(cosine, sine, 0.0) + wind,
            V * rate * _vectors(-sine, cosine, 0.0),
        )


@dataclass(frozen=True, slots=True)
class Loop:
    """Continuous inside loops at constant airspeed and pitch rate, from level flight.

    pitch_rate_rad_s : one loop takes 2 pi / rate; the radius is airspeed / rate
    """

    pitch_rate_rad_s: float = math.radians(90.0)
    airspeed_m_s: float = 15.0
    heading_rad: float = 0.0
    height_m: float = 60.0
    wind_e_m_s: tuple[float, float, float] = CALM

    def __post_init__(self) -> None:
        _require(self, "pitch_rate_rad_s", "rad/s", self.pitch_rate_rad_s != 0.0, "a rate other than 0 rad/s")

    def at(self, t_s: Array) -> Kinematics:
        """See `Motion.at`."""
        V, q = self.airspeed_m_s, self.pitch_rate_rad_s
        pitch, (cy, sy) = q * t_s, (math.cos(self.heading_rad), math.sin(self.heading_rad))
        sp, cp = np.sin(pitch), np.cos(pitch)
        wind = np.array(self.wind_e_m_s)
        p_air = V / q * _vectors(sp * cy, sp * sy, cp - 1.0) - [0.0, 0.0, self.height_m]
        return Kinematics(
            from_euler(0.0, pitch, self.heading_rad),
            _vectors(0.0, q + 0.0 * t_s, 0.0),
            p_air + wind * t_s[:, None],
            V * _vectors(cp * cy, cp * sy, -sp) + wind,
            V * q * _vectors(-sp * cy, -sp * sy, -cp),
        )


def inertial_rate_and_force(
    motion: Motion, t_s: Array, latitude_rad: float, elevation_m: float = 0.0
) -> tuple[Array, Array]:
    """What perfect sensors at the centre of gravity measure at the times `t_s`, shape (n,).

    Returns
    -------
    omega_b_rad_s : (n, 3), inertial      force_b_m_s2 : (n, 3), R.T (a + 2 earth x v - g)
    """
    at = motion.at(t_s)
    earth_e = earth_rate_e_rad_s(latitude_rad)
    g_e = np.array([0.0, 0.0, gravity_m_s2(latitude_rad, elevation_m)])
    R_be = np.swapaxes(at.R_eb, 1, 2)
    force_e = at.a_e_m_s2 + 2.0 * np.cross(earth_e, at.v_e_m_s) - g_e
    return at.omega_b_rad_s + R_be @ earth_e, np.einsum("nij,nj->ni", R_be, force_e)


def motion_rows(motion: Motion, n_ticks: int, dt_s: float, latitude_rad: float, elevation_m: float = 0.0) -> Array:
    """The truth of `n_ticks` ticks of `motion`, shape (n_ticks,) of TRUTH; sensor columns stay zero."""
    rows = np.zeros(n_ticks, TRUTH_DTYPE)
    t_s: Array = np.arange(1, n_ticks + 1) * np.float64(dt_s)
    rows["t_s"] = t_s
    at = motion.at(t_s)
    rows["R_eb"], rows["p_e_m"], rows["v_e_m_s"] = at.R_eb, at.p_e_m, at.v_e_m_s
    rows["omega_b_rad_s"], _ = inertial_rate_and_force(motion, t_s, latitude_rad, elevation_m)
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    for node, weight in zip(nodes, 0.5 * weights, strict=True):
        within_s = t_s + 0.5 * dt_s * (float(node) - 1.0)
        omega_b, force_b = inertial_rate_and_force(motion, within_s, latitude_rad, elevation_m)
        rows["imu_omega_b_rad_s"] += weight * omega_b
        rows["imu_force_b_m_s2"] += weight * force_b
    rows["wind_e_m_s"] = getattr(motion, "wind_e_m_s", CALM)
    u, v, w = np.einsum("nij,ni->jn", at.R_eb, at.v_e_m_s - rows["wind_e_m_s"])
    rows["airspeed_m_s"] = airspeed = np.sqrt(u * u + v * v + w * w)
    rows["alpha_rad"] = np.arctan2(w, u)
    rows["beta_rad"] = np.arcsin(np.divide(v, airspeed, out=np.zeros(n_ticks), where=airspeed > 0.0))
    rows["phase"] = getattr(motion, "phase", Phase.FLYING)
    rows["rotor_rpm"] = getattr(motion, "rotor_rpm", 0.0)
    return rows


class PrescribedPlant:
    """A body that follows `motion` and ignores commands; see `sim.plant.Plant`.

    release_s : time from which it is judged
    """

    def __init__(
        self,
        motion: Motion,
        rates: Rates,
        latitude_deg: float = LATITUDE_DEG,
        release_s: float = 0.0,
        elevation_m: float = 0.0,
    ) -> None:
        if not abs(latitude_deg) <= 90.0:
            raise ValueError(f"latitude_deg = {latitude_deg!r} deg: choose a latitude from -90 to 90 deg")
        self.motion = motion
        self.dt_s = rates.dt_s
        self.release_s = release_s
        self.latitude_deg, self.elevation_m = latitude_deg, elevation_m
        self._truth = self._rows = np.zeros(0, TRUTH_DTYPE)

    def reset(self, log: Log) -> None:
        """Compute the motion for the length of `log`."""
        self._truth = log.truth
        self._rows = motion_rows(self.motion, len(log), self.dt_s, math.radians(self.latitude_deg), self.elevation_m)

    def advance(self, k: int, command: ActuatorCommand) -> Outcome | None:  # noqa: ARG002 - commands are ignored
        """Fill truth row `k`; never ends the flight."""
        self._truth[k] = self._rows[k]
        return None
