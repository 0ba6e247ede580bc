"""Trials of single sensors: hours at rest, a manoeuvre, a step and a turn, each against closed-form truth.

They use the same code as a flight, `draw` of the modules and `Suite.measure`, without an aeroplane.
"""

import math
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar, Final

import numpy as np

from estimator.blocks.air import true_over_equivalent
from estimator.interface import G_M_S2, Array
from estimator.rotation import from_euler
from sim.clock import Rates
from sim.log import Log, Phase
from sim.loop import sense
from sim.magnetic_field import field_e_ut
from sim.motion.prescribed_plant import Kinematics, Motion, PrescribedPlant
from sim.place import ELEVATION_M, LATITUDE_DEG, LONGITUDE_DEG
from sim.rng import stream
from sim.sensors import accelerometer, allan, gyro
from sim.sensors.board import BoardParams
from sim.sensors.datasheet import PERFECT
from sim.sensors.device import noise_filter
from sim.sensors.gps import GpsParams
from sim.sensors.magnetometer import MagnetometerParams
from sim.sensors.suite import Suite, SuiteParams

FLIGHTS: Final = 22  # of three axes: 66 hours at rest; the mean curve has an eighth of the scatter of one
HOUR_S: Final = 3600.0
IMU_HZ: Final = 50
SEED: Final = 0
WORKERS: Final = 2
SETTLED_S: Final = 12.0  # settling time for a receiver, besides its own delays
PHASES: Final = 8  # of a change relative to the reports
REACHED: Final = 1.0 - math.exp(-1.0)  # 63 %: reached by a first-order lag after one time constant


@dataclass(frozen=True, slots=True)
class Inertial:
    """Simulation of a gyro or an accelerometer at rest.

    unit : of the report      scale : from SI to that unit
    figures : names of its parameters for noise density, bias instability and random walk
    """

    module: Any
    unit: str
    scale: float
    figures: tuple[str, str, str]


INERTIAL: Final = {
    "gyro": Inertial(
        gyro, "deg/s", math.degrees(1.0),
        ("noise_density_deg_s_sqrt_hz", "bias_instability_deg_s", "walk_deg_s_sqrt_s"),
    ),
    "accelerometer": Inertial(
        accelerometer, "ug", 1e6 / G_M_S2, ("noise_density_ug_sqrt_hz", "bias_instability_ug", "walk_ug_sqrt_s"),
    ),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Coefficient:
    """One coefficient as simulated and as in the data sheet, None if not specified there."""

    measured: float
    datasheet: float | None
    unit: str

    @property
    def difference(self) -> float | None:
        """Relative difference of the simulated value from the data sheet."""
        return self.measured / self.datasheet - 1.0 if self.datasheet else None


@dataclass(frozen=True, slots=True)
class AtRest:
    """A gyro or an accelerometer at rest, before its converter and without warm-up.

    tau_s : (n,)      variances : (n, axes), Allan variances in the square of `unit`
    noise : fitted to their mean
    figures : noise density, bias instability and random walk of the part file, zero if not specified
    step : of a reading, the averaging of conversions included; 0 if not quantised
    noise_gain : sigma of the white noise of a reading, relative to that before low-pass filter and conversions
    """

    kind: str
    unit: str
    axis_hours: float
    tau_s: Array
    variances: Array
    noise: allan.NoiseModel
    figures: tuple[float, float, float]
    step: float
    noise_gain: float

    @property
    def stated(self) -> allan.NoiseModel:
        """The noise of `figures`."""
        density, flicker, walk = self.figures
        return allan.NoiseModel(density / math.sqrt(2.0), flicker, walk)

    @property
    def coefficients(self) -> dict[str, Coefficient]:
        """White noise, flicker noise and random walk by their names in the JSON."""
        m, unit = self.noise, self.unit
        density, flicker, walk = (figure or None for figure in self.figures)
        return {
            "noise_density": Coefficient(m.density, density, f"{unit}/sqrt(Hz)"),
            "bias_instability": Coefficient(m.flicker, flicker, unit),
            "rate_random_walk": Coefficient(m.walk, walk, f"{unit}/sqrt(s)"),
        }

    @property
    def sample_sigma(self) -> float:
        """Sigma of the white noise of one reading, aliasing included."""
        return self.noise_gain * self.noise.white * math.sqrt(IMU_HZ)

    @property
    def walk_is_hidden(self) -> bool:
        """Whether the stated random walk is less than a quarter of the variance of the longest average."""
        longest_s = float(self.tau_s[-1])
        return self.stated.walk > 0.0 and self.stated.walk**2 * longest_s / 3.0 < 0.25 * float(self.deviation[-1]) ** 2

    @property
    def deviation(self) -> Array:
        """Allan deviation, root of the mean variance, shape (n,)."""
        return np.asarray(np.sqrt(self.variances.mean(axis=1)))


def at_rest(
    kind: str, params: Any, flights: int = FLIGHTS, seconds: float = HOUR_S, done: Callable[[], None] = lambda: None
) -> AtRest:
    """Simulate `flights` records of three axes, `seconds` long; `done` is called after each."""
    how, rates = INERTIAL[kind], Rates(imu_hz=IMU_HZ)
    if kind == "gyro":
        params = replace(params, drift_deg_s_min=0.0)  # the drift is warm-up
    n = rates.ticks(seconds)
    m = allan.octaves(n)

    def record(flight: int) -> Array:
        noise = np.zeros(n, list(how.module.NOISE))
        how.module.draw(params, BoardParams(), rates, partial(stream, SEED, flight), noise)
        bias, white = (name for name, *_ in how.module.NOISE)
        signal = how.scale * (noise[bias] + noise[white])
        return allan.variance(signal, m)

    found = []
    with ThreadPoolExecutor(WORKERS) as pool:  # NumPy draws without holding the interpreter lock
        for variances in pool.map(record, range(flights)):
            found.append(variances)
            done()
    tau_s, variances = m / IMU_HZ, np.concatenate(found, axis=1)
    hours = variances.shape[1] * seconds / 3600.0
    _, noise_gain = noise_filter(params.bandwidth_hz, params.conversions, IMU_HZ)
    return AtRest(
        kind, how.unit, hours, tau_s, variances, allan.fit(tau_s, variances), figures(kind, params), step(kind, params),
        noise_gain,
    )  # fmt: skip


def figures(kind: str, params: Any) -> tuple[float, float, float]:
    """Noise density, bias instability and random walk of a gyro or an accelerometer, in the unit of the report."""
    density, instability, walk = (getattr(params, name) for name in INERTIAL[kind].figures)
    return density, instability, walk


def step(kind: str, params: Any) -> float:
    """Step of a reading, in the unit of the report."""
    how, unit = INERTIAL[kind], np.zeros(1, INERTIAL[kind].module.UNIT)
    how.module.make(params, BoardParams(), Rates(imu_hz=IMU_HZ), partial(stream, SEED, 0), unit)
    return how.scale * float(unit["step"][0])


@dataclass(frozen=True, slots=True)
class Exercise:
    """Level flight, a pull-up to 2.5 g (1 to 2 s), a roll to 60 deg (3 to 4 s) and back (4.5 to 5.5 s).

    Each change of rate and force is a sine squared.
    """

    pull_m_s2: float = 1.5 * G_M_S2
    roll_rad_s: float = math.radians(120.0)
    seconds: ClassVar[float] = 7.0

    def at(self, t_s: Array) -> Kinematics:
        """See `Motion.at`."""
        a, v, p = _pulse(t_s - 1.0)
        out, angle_out, _ = _pulse(t_s - 3.0)
        back, angle_back, _ = _pulse(t_s - 4.5)
        still = np.zeros_like(t_s)
        return Kinematics(
            from_euler(self.roll_rad_s * (angle_out - angle_back), still, still),
            np.stack([self.roll_rad_s * (out - back), still, still], axis=1),
            np.stack([12.0 * t_s, still, -60.0 - self.pull_m_s2 * p], axis=1),
            np.stack([still + 12.0, still, -self.pull_m_s2 * v], axis=1),
            np.stack([still, still, -self.pull_m_s2 * a], axis=1),
        )


def _pulse(t_s: Array) -> tuple[Array, Array, Array]:
    """sin^2(pi t) for 0 < t < 1, its integral, and the integral of that."""
    t, after = np.clip(t_s, 0.0, 1.0), np.maximum(t_s - 1.0, 0.0)
    once = t / 2.0 - np.sin(2.0 * np.pi * t) / (4.0 * np.pi)
    twice = t**2 / 4.0 + (np.cos(2.0 * np.pi * t) - 1.0) / (8.0 * np.pi**2)
    return np.sin(np.pi * t) ** 2, once, twice + after / 2.0


@dataclass(frozen=True, slots=True)
class SpeedStep:
    """North at `before_m_s`, stepping to `after_m_s` at `when_s`."""

    when_s: float
    before_m_s: float = 5.0
    after_m_s: float = 15.0

    def at(self, t_s: Array) -> Kinematics:
        """See `Motion.at`."""
        speed = np.where(t_s >= self.when_s, self.after_m_s, self.before_m_s)
        way = self.before_m_s * t_s + (self.after_m_s - self.before_m_s) * np.maximum(t_s - self.when_s, 0.0)
        return _level(way, 0.0 * way, speed, 0.0 * way, 0.0 * way)


@dataclass(frozen=True, slots=True)
class QuarterTurn:
    """North, then from `when_s` a right turn to east."""

    when_s: float
    speed_m_s: float = 12.0
    rate_rad_s: float = math.radians(45.0)

    def at(self, t_s: Array) -> Kinematics:
        """See `Motion.at`."""
        course = np.clip(self.rate_rad_s * (t_s - self.when_s), 0.0, math.pi / 2.0)
        radius = self.speed_m_s / self.rate_rad_s
        done = np.maximum(t_s - self.when_s - math.pi / 2.0 / self.rate_rad_s, 0.0)
        north = self.speed_m_s * np.minimum(t_s, self.when_s) + radius * np.sin(course)
        east = radius * (1.0 - np.cos(course)) + self.speed_m_s * done
        turning = np.where((course > 0.0) & (done == 0.0), self.rate_rad_s, 0.0)
        return _level(north, east, self.speed_m_s, course, turning)


def _level(north: Array, east: Array, speed: Array | float, course: Array, rate: Array) -> Kinematics:
    """Level motion, wings level, nose along the course."""
    still, sine, cosine = np.zeros_like(north), np.sin(course), np.cos(course)
    return Kinematics(
        from_euler(still, still, course),
        np.stack([still, still, rate], axis=1),
        np.stack([north, east, still - 60.0], axis=1),
        np.stack([speed * cosine, speed * sine, still], axis=1),
        np.stack([-speed * rate * sine, speed * rate * cosine, still], axis=1),
    )


def fitted(devices: Mapping[str, Any]) -> SuiteParams:
    """A suite of `devices`, kind -> parameters; gyro, accelerometer and GPS are perfect if not given."""
    always = {kind: PERFECT[kind] for kind in ("gyro", "accelerometer", "gps")}
    return SuiteParams(**(always | dict(devices)))


def check_rates(devices: Mapping[str, Any], name: str) -> None:
    """Reject a sensor rate that does not divide the clock of the trials: ValueError, with the `name` of the part."""
    try:
        for kind, params in devices.items():
            if kind == "gps":
                Rates(imu_hz=IMU_HZ, gps_hz=params.rate_hz)
            elif kind not in INERTIAL:
                Rates(imu_hz=IMU_HZ).steps_per_sample(kind, params.rate_hz)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def fly(params: SuiteParams, motion: Motion, seconds: float, rates: Rates, quiet: bool = False) -> Log:
    """What the suite measures of `motion`; if `quiet`, without the errors drawn for each tick."""
    suite = (_QuietSuite if quiet else Suite)(params, rates, SEED)
    return sense(PrescribedPlant(motion, rates), suite, Log.empty(rates.ticks(seconds)))


class _QuietSuite(Suite):
    """Sensors without the errors that are drawn for each tick."""

    def reset(self, log: Log) -> None:
        super().reset(log)
        drawn = self.snapshot()
        self.restore(drawn._replace(noise=np.zeros_like(drawn.noise)))


def exercise(devices: Mapping[str, Any]) -> Log:
    """The exercise as measured by gyro and accelerometer."""
    return fly(fitted(devices), Exercise(), Exercise.seconds, Rates(imu_hz=IMU_HZ))


@dataclass(frozen=True, slots=True)
class Response:
    """Response of a receiver to a speed step and a quarter turn, without its noise.

    speed_delay_s, course_delay_s : from 63 % of the change in truth to 63 % in the reports, mean over steps at all
        phases of the report interval
    least_speed_m_s : lowest speed reported in the turn      step, turn : one flight of each
    when_s : start of both changes in those
    """

    speed_delay_s: float
    course_delay_s: float
    least_speed_m_s: float
    step: Log
    turn: Log
    when_s: float


def respond(params: GpsParams) -> Response:
    """Fly a receiver through speed steps and turns."""
    rates = Rates(imu_hz=IMU_HZ, gps_hz=params.rate_hz)
    suite = fitted({"gps": replace(params, first_fix_s=0.0)})
    lag_s = params.filter_s + params.latency_s
    start_s = SETTLED_S + 3.0 * lag_s
    end_s = start_s + SETTLED_S + 6.0 * lag_s
    ticks = max(1, round(IMU_HZ / params.rate_hz))
    speed, course, slowest, flown = [], [], [], []
    for shift in np.unique(np.linspace(0, ticks, PHASES, endpoint=False, dtype=int)).tolist():
        when_s = start_s + shift / IMU_HZ
        to_mid_s = REACHED * math.pi / 2.0 / QuarterTurn(when_s).rate_rad_s
        step = fly(suite, SpeedStep(when_s), end_s, rates, quiet=True)
        turn = fly(suite, QuarterTurn(when_s), end_s, rates, quiet=True)
        speed.append(_reaches(step, step.measured["gps_speed_m_s"], 5.0 + 10.0 * REACHED, when_s))
        angle = (turn.measured["gps_course_rad"] + math.pi) % (2.0 * math.pi) - math.pi
        course.append(_reaches(turn, angle, REACHED * math.pi / 2.0, when_s) - to_mid_s)
        after = turn.truth["t_s"] > when_s
        slowest.append(float(turn.measured["gps_speed_m_s"][after].min()))
        flown.append((step, turn, when_s))
    return Response(float(np.mean(speed)), float(np.mean(course)), min(slowest), *flown[0])


def _reaches(log: Log, value: Array, level: float, since_s: float) -> float:
    """Seconds from `since_s` until `value` reaches `level`; infinite if never."""
    t_s = log.truth["t_s"]
    there = (t_s > since_s) & (value >= level)
    return float(t_s[np.argmax(there)]) - since_s if there.any() else math.inf


@dataclass(frozen=True, slots=True)
class MagneticTrial:
    """Two level turns in the earth's field, motor off, and the heading computed from the readings.

    field_e_ut : of the earth, shape (3,)      truth_deg, error_deg : heading and its error per sample, shape (n,)
    readings_ut : shape (n, 3)
    """

    field_e_ut: Array
    truth_deg: Array
    error_deg: Array
    readings_ut: Array

    @property
    def horizontal_ut(self) -> float:
        return math.hypot(*self.field_e_ut[:2].tolist())

    @property
    def heading_rms_deg(self) -> float:
        return float(np.sqrt(np.mean(self.error_deg**2)))


@dataclass(frozen=True, slots=True)
class Spin:
    """Level on the spot, turning right."""

    rate_rad_s: float = 2.0 * math.pi / 20.0
    phase: ClassVar[Phase] = Phase.HELD

    def at(self, t_s: Array) -> Kinematics:
        """See `Motion.at`."""
        return _level(0.0 * t_s, 0.0 * t_s, 0.0, self.rate_rad_s * t_s, 0.0 * t_s + self.rate_rad_s)


def turn_around(params: MagnetometerParams) -> MagneticTrial:
    """Turn a magnetometer twice around, level, without latency; heading from the horizontal components."""
    suite = fitted({"magnetometer": replace(params, latency_s=0.0)})
    log = fly(suite, Spin(), 40.0, Rates(imu_hz=IMU_HZ))
    new = log.measured["mag_new"] == 1
    field = field_e_ut(LATITUDE_DEG, LONGITUDE_DEG, ELEVATION_M, params.year)
    readings = log.measured["mag_b_ut"][new]
    truth = np.arctan2(log.truth["R_eb"][new, 1, 0], log.truth["R_eb"][new, 0, 0])
    heading = math.atan2(field[1], field[0]) - np.arctan2(readings[:, 1], readings[:, 0])
    error = (heading - truth + math.pi) % (2.0 * math.pi) - math.pi
    return MagneticTrial(field, np.degrees(truth) % 360.0, np.degrees(error), readings)


@dataclass(frozen=True, slots=True)
class Surge:
    """North, nose level: airspeed 12 +- 5 m/s and height 60 +- 10 m, with a period of 20 s."""

    def at(self, t_s: Array) -> Kinematics:
        """See `Motion.at`."""
        w = 2.0 * math.pi / 20.0
        sine, cosine, still = np.sin(w * t_s), np.cos(w * t_s), np.zeros_like(t_s)
        return Kinematics(
            from_euler(still, still, still),
            np.stack([still, still, still], axis=1),
            np.stack([12.0 * t_s - 5.0 / w * cosine, still, -60.0 + 10.0 * cosine], axis=1),
            np.stack([12.0 + 5.0 * sine, still, -10.0 * w * sine], axis=1),
            np.stack([5.0 * w * cosine, still, -10.0 * w**2 * cosine], axis=1),
        )


def swing(devices: Mapping[str, Any]) -> Log:
    """A minute of oscillating airspeed and height as measured by an airspeed sensor and a barometer."""
    return fly(fitted(devices), Surge(), 60.0, Rates(imu_hz=IMU_HZ))


def air_errors(log: Log, kind: str) -> Array:
    """Reading minus truth, equivalent airspeed or height, of each sample of `swing`, m/s or m."""
    new = log.measured["air_new"] == 1
    truth, measured = log.truth[new], log.measured[new]
    if kind == "airspeed":
        factor = [true_over_equivalent(ELEVATION_M - down_m) for down_m in truth["p_e_m"][:, 2]]
        return np.asarray(measured["equivalent_airspeed_m_s"] - truth["airspeed_m_s"] / factor)
    return np.asarray(measured["baro_height_m"] + truth["p_e_m"][:, 2])
