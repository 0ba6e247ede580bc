"""GPS receiver: its parameters and the errors of its fixes, drawn before the flight; see `sim.sensors.receiver`.

position error = wander + white + jumps      velocity error = white + wander

Wanders are first-order Gauss-Markov processes.  An outage begins and ends at random (the two-state chain of
Gilbert, Capacity of a burst-noise channel, 1960): times with and without satellites are exponential.  A jump is
a sudden offset, as when the receiver switches satellites, which then decays exponentially.
"""

import math
from dataclasses import dataclass
from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from estimator.compiler.jit import kernel
from estimator.interface import Array
from sim.clock import Rates
from sim.place import LAUNCH_PLACE, Place, metres_per_degree
from sim.sensors.noise import Source, gauss_markov, lag_weights, require, require_choice, require_positive

Resolution = Literal["none", "nmea", "binary"]
Course = Literal["velocity", "positions"]

KNOT_M_S: Final = 1852.0 / 3600.0


@dataclass(frozen=True, slots=True)
class GpsParams:
    """Behaviour of a GPS receiver.  The defaults are a small 4 Hz receiver.

    A larger figure is a worse receiver unless stated otherwise, and 0 removes that effect.

    rate_hz : report rate, used by a flight that sets no GPS rate (Hz, default 4).  Higher: fresher fixes
    filter_s : time constant of the filter on position and velocity (s, default 1)
    latency_s : from the validity time of a fix to its arrival (s, default 0.3)
    first_fix_s : time since power-up of the first fix (s, default 1)
    first_fix_spread_s : the first fix is late by up to this, uniformly (s, default 0); a cold start waits for an
        ephemeris, which satellites repeat every 30 s (IS-GPS-200)
    velocity_noise_m_s : sigma of the white noise of each velocity component (m/s, default 0.1)
    velocity_wander_m_s : sigma of the correlated error of each velocity component (m/s, default 0)
    velocity_wander_s : correlation time of that error (s, default 10).  Higher: averages out more slowly
    wander_horizontal_m, wander_vertical_m : sigma of the correlated position error per axis (m, default 1.5 and 2.5)
    wander_s : correlation time of that error (s, default 30).  Higher: averages out more slowly
    noise_horizontal_m, noise_vertical_m : sigma of the white position noise per axis (m, default 0)
    resolution : of the messages: none, nmea (RMC and GGA) or binary (UBX NAV-PVT) (default none)
    minute_decimals : of latitude and longitude in NMEA, 4 or 5 (default 4).  Higher: finer position
    course : velocity and course from the receiver's velocity, or from its last three positions (default velocity)
    hold_below_m_s : static navigation: position and course are held below this speed (m/s, default 0: off)
    smoothing_s : time constant of track smoothing (s, default 0: off)
    outage_every_s : mean time between outages (s, default inf: none).  Lower: more outages
    outage_s : mean length of an outage (s, default 5)
    jump_every_s : mean time between position jumps (s, default inf: none).  Lower: more jumps
    jump_horizontal_m, jump_vertical_m : sigma of a jump per axis (m, default 5 and 8)
    jump_decay_s : time constant with which a jump decays (s, default 20)
    """

    rate_hz: float = 4.0
    filter_s: float = 1.0
    latency_s: float = 0.3
    first_fix_s: float = 1.0
    velocity_noise_m_s: float = 0.1
    wander_horizontal_m: float = 1.5
    wander_vertical_m: float = 2.5
    wander_s: float = 30.0
    noise_horizontal_m: float = 0.0
    noise_vertical_m: float = 0.0
    velocity_wander_m_s: float = 0.0
    velocity_wander_s: float = 10.0
    first_fix_spread_s: float = 0.0
    resolution: Resolution = "none"
    minute_decimals: int = 4
    course: Course = "velocity"
    hold_below_m_s: float = 0.0
    smoothing_s: float = 0.0
    outage_every_s: float = math.inf
    outage_s: float = 5.0
    jump_every_s: float = math.inf
    jump_horizontal_m: float = 5.0
    jump_vertical_m: float = 8.0
    jump_decay_s: float = 20.0

    def __post_init__(self) -> None:
        require(
            self, "filter_s", "latency_s", "first_fix_s", "first_fix_spread_s", "smoothing_s", "velocity_noise_m_s",
            "velocity_wander_m_s", "hold_below_m_s", "wander_horizontal_m", "wander_vertical_m", "noise_horizontal_m",
            "noise_vertical_m", "jump_horizontal_m", "jump_vertical_m",
        )  # fmt: skip
        require(self, "wander_s", "velocity_wander_s", "outage_s", "jump_decay_s", least=0.001)
        require(self, "rate_hz", least=0.1)
        require_positive(self, "outage_every_s", "jump_every_s")
        require_choice(self, "resolution", *get_args(Resolution))
        require_choice(self, "course", *get_args(Course))
        require_choice(self, "minute_decimals", 4, 5)


UNIT = np.dtype(
    [
        ("filter_s", "f8"),
        ("before", "f8"),  # weight of the filtered value at the start of a tick,
        ("start", "f8"),  # of the true value there,
        ("end", "f8"),  # and of the true value at its end
        ("physics_hz", "f8"),
        ("steps_per_tick", "i8"),
        ("steps_per_fix", "i8"),
        ("latency_steps", "i8"),
        ("first_fix_step", "i8"),
        ("plain", "i8"),  # fixes leave the filter as they are: none of what follows
        ("smoothing_s", "f8"),
        ("hold_below_m_s", "f8"),
        ("from_positions", "i8"),
        ("polar", "i8"),  # velocity is reported as speed and course only
        ("p_step_m", "f8", (3,)),  # resolutions; 0: none
        ("v_step_m_s", "f8"),
        ("speed_step_m_s", "f8"),
        ("course_steps", "f8"),  # in a full circle; 0: not quantised
    ],
    align=True,
)
NOISE = (
    ("gps_v_noise_e_m_s", "f8", (3,)),  # white noise and wander
    ("gps_p_wander_e_m", "f8", (3,)),  # wander, white noise and jumps
    ("satellites_lost", "i8"),  # 1 in an outage
)


def _whole_steps(time_s: float, physics_hz: int) -> int:
    """Physics steps after which `time_s` has passed; less than a nanostep is round-off."""
    return math.ceil(time_s * physics_hz - 1e-9)


def make(params: GpsParams, rates: Rates, source: Source, unit: NDArray[np.void], place: Place = LAUNCH_PLACE) -> None:
    """Make one receiver: set its constants in `unit`, shape (1,) of UNIT."""
    unit["filter_s"] = params.filter_s
    unit["before"], unit["start"], unit["end"] = lag_weights(params.filter_s, rates.dt_s)
    unit["physics_hz"] = rates.physics_hz
    unit["steps_per_tick"], unit["steps_per_fix"] = rates.steps_per_tick, rates.steps_per_fix
    unit["latency_steps"] = _whole_steps(params.latency_s, rates.physics_hz)
    first_fix_s = params.first_fix_s
    if params.first_fix_spread_s > 0.0:
        first_fix_s += params.first_fix_spread_s * source("gps first fix").random()
    unit["first_fix_step"] = _whole_steps(first_fix_s, rates.physics_hz)
    unit["smoothing_s"], unit["hold_below_m_s"] = params.smoothing_s, params.hold_below_m_s
    unit["from_positions"] = params.course == "positions"
    _set_resolution(params, unit, place)
    unit["plain"] = (
        params.resolution == "none"
        and params.course == "velocity"
        and params.smoothing_s == params.hold_below_m_s == 0.0
    )


def _set_resolution(params: GpsParams, unit: NDArray[np.void], place: Place) -> None:
    """Set in `unit` the steps of the messages' fields.

    NMEA 0183: ddmm.mmmm (or mmmmm), 0.1 m, 0.01 knot, 0.01 deg.  UBX NAV-PVT: 1e-7 deg, 1 mm, 1 mm/s, 1e-5 deg.
    """
    if params.resolution == "none":
        return
    north_m, east_m = metres_per_degree(place.latitude_deg, place.elevation_m)
    nmea = params.resolution == "nmea"
    angle_deg = 10.0**-params.minute_decimals / 60.0 if nmea else 1e-7
    unit["p_step_m"] = angle_deg * north_m, angle_deg * east_m, 0.1 if nmea else 0.001
    unit["polar"] = nmea
    unit["v_step_m_s"] = 0.0 if nmea else 0.001
    unit["speed_step_m_s"] = 0.01 * KNOT_M_S if nmea else 0.001
    unit["course_steps"] = 36_000.0 if nmea else 36_000_000.0


def draw(params: GpsParams, rates: Rates, source: Source, noise: NDArray[np.void]) -> None:
    """Draw the errors of every tick into the columns NOISE of `noise`; a fix uses those of its tick."""
    n, dt_s = len(noise), rates.dt_s
    sigma_m = np.array([params.wander_horizontal_m, params.wander_horizontal_m, params.wander_vertical_m])
    steps = source("gps wander").standard_normal((n, 3))
    white = source("gps velocity noise").standard_normal((n, 3))
    noise["gps_v_noise_e_m_s"] = params.velocity_noise_m_s * white
    noise["gps_p_wander_e_m"] = gauss_markov(steps, sigma_m, params.wander_s, dt_s)
    if params.velocity_wander_m_s > 0.0:
        steps, sigma_m_s = source("gps velocity wander").standard_normal((n, 3)), params.velocity_wander_m_s
        noise["gps_v_noise_e_m_s"] += gauss_markov(steps, np.full(3, sigma_m_s), params.velocity_wander_s, dt_s)
    white_m = np.array([params.noise_horizontal_m, params.noise_horizontal_m, params.noise_vertical_m])
    if np.any(white_m > 0.0):
        noise["gps_p_wander_e_m"] += white_m * source("gps position noise").standard_normal((n, 3))
    if params.jump_every_s < math.inf:
        noise["gps_p_wander_e_m"] += _jumps(params, dt_s, source, n)
    if params.outage_every_s < math.inf:
        chance = source("gps outages").random(n)
        noise["satellites_lost"] = _outages(
            chance, -math.expm1(-dt_s / params.outage_every_s), -math.expm1(-dt_s / params.outage_s)
        )


def _jumps(params: GpsParams, dt_s: float, source: Source, n: int) -> Array:
    """Position offset by jumps in each of `n` ticks, shape (n, 3).

    At most one jump per tick; the variance settles at sigma^2 decay / (2 every) (Campbell's theorem).
    """
    sigma_m = np.array([params.jump_horizontal_m, params.jump_horizontal_m, params.jump_vertical_m])
    size_m = sigma_m * source("gps jump sizes").standard_normal((n, 3))
    begins = source("gps jumps").random(n) < -math.expm1(-dt_s / params.jump_every_s)
    offset_m: Array = np.where(begins[:, None], size_m, 0.0)
    _decay(offset_m, math.exp(-dt_s / params.jump_decay_s))
    return offset_m


@kernel
def _decay(x, phi):  # type: ignore[no-untyped-def]
    for k in range(1, x.shape[0]):
        for i in range(x.shape[1]):
            x[k, i] += phi * x[k - 1, i]


@kernel
def _outages(chance, lose, find):  # type: ignore[no-untyped-def]
    """1 in ticks without satellites, from uniform `chance` and the probabilities of a change per tick."""
    lost = np.zeros(len(chance), np.int64)
    for k in range(1, len(chance)):
        lost[k] = 1 - (chance[k] < find) if lost[k - 1] else chance[k] < lose
    return lost
