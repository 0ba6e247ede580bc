"""GPS receiver: a filter on the vectors, a report rate, a latency, noise, and a time to the first fix.

Inside the receiver position and velocity pass a first-order filter, dy/dt = (u - y) / T, as the reports of
small receivers show in turns.  Fix j is true at step j * steps_per_fix of the physics (between two ticks it
is interpolated), carries that time as its stamp, and arrives in the first tick that ends at least a latency
later.  The rows of the log are the filter's memory and the latency's history.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.jit import kernel
from sim.clock import Rates
from sim.sensors.noise import Source, gauss_markov, require

_BELOW_TWO_PI = float(np.nextafter(2.0 * np.pi, 0.0))  # a course of -1e-17 must not round up to a full circle


@dataclass(frozen=True, slots=True)
class GpsParams:
    """Behaviour of a GPS receiver.  The defaults are a small 4 Hz receiver.

    rate_hz : its report rate, which a flight takes unless it names another (`Rates.gps_hz` is what counts)
    filter_s : time constant of the filter on position and velocity; 0 is none
    latency_s : from the time a fix is true until it arrives
    first_fix_s : time since power-up before which there is no fix
    velocity_noise_m_s : sigma of the white noise of each velocity component of a fix
    wander_horizontal_m, wander_vertical_m : sigma of the slowly wandering error of position, per axis
    wander_s : correlation time of that error
    """

    rate_hz: float = 4.0
    filter_s: float = 1.0
    latency_s: float = 0.3
    first_fix_s: float = 1.0
    velocity_noise_m_s: float = 0.1
    wander_horizontal_m: float = 1.5
    wander_vertical_m: float = 2.5
    wander_s: float = 30.0

    def __post_init__(self) -> None:
        require(self, "s", "filter_s", "latency_s", "first_fix_s")
        require(self, "m/s", "velocity_noise_m_s")
        require(self, "m", "wander_horizontal_m", "wander_vertical_m")
        require(self, "s", "wander_s", least=0.001)
        require(self, "Hz", "rate_hz", least=0.1)


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
    ],
    align=True,
)
NOISE = (("gps_v_noise_e_m_s", "f8", (3,)), ("gps_p_wander_e_m", "f8", (3,)))


def _whole_steps(time_s: float, physics_hz: int) -> int:
    """Physics steps after which `time_s` has passed; a nanostep is round-off, not a step."""
    return math.ceil(time_s * physics_hz - 1e-9)


def make(params: GpsParams, rates: Rates, unit: NDArray[np.void]) -> None:
    """Make one receiver: set its constants in `unit`, shape (1,) of UNIT.

    The weights are the exact solution of the filter for a true value that is linear within the tick:
    y1 = a y0 + (1 - a - b) u0 + b u1 with a = exp(-dt / T), b = 1 - (1 - a) T / dt.
    """
    step = rates.dt_s / params.filter_s if params.filter_s > 0.0 else math.inf
    before = math.exp(-step)
    end = 1.0 + math.expm1(-step) / step
    unit["filter_s"] = params.filter_s
    unit["before"], unit["start"], unit["end"] = before, 1.0 - before - end, end
    unit["physics_hz"] = rates.physics_hz
    unit["steps_per_tick"], unit["steps_per_fix"] = rates.steps_per_tick, rates.steps_per_fix
    unit["latency_steps"] = _whole_steps(params.latency_s, rates.physics_hz)
    unit["first_fix_step"] = _whole_steps(params.first_fix_s, rates.physics_hz)


def draw(params: GpsParams, rates: Rates, source: Source, noise: NDArray[np.void]) -> None:
    """Draw the errors of every tick into the columns NOISE of `noise`; a fix has those of its own tick."""
    n = len(noise)
    sigma_m = np.array([params.wander_horizontal_m, params.wander_horizontal_m, params.wander_vertical_m])
    steps = source("gps wander").standard_normal((n, 3))
    white = source("gps velocity noise").standard_normal((n, 3))
    noise["gps_v_noise_e_m_s"] = params.velocity_noise_m_s * white
    noise["gps_p_wander_e_m"] = gauss_markov(steps, sigma_m, params.wander_s, rates.dt_s)


@kernel
def receive(truth, measured, noise, k, unit):  # type: ignore[no-untyped-def]
    """Filter in tick `k`, hold the last fix, take in one that has arrived; `unit` is a record of UNIT."""
    _filter(truth, k, unit)
    measured[k].gps_new = 0
    if k == 0:
        measured[k].gps_valid = 0
    else:
        _hold(measured[k - 1], measured[k])
    # The newest fix that can have arrived by the end of this tick, and the step at which it was true.
    spt, spf = unit.steps_per_tick, unit.steps_per_fix
    step = ((k + 1) * spt - unit.latency_steps) // spf * spf
    if step + unit.latency_steps > k * spt and step >= max(unit.first_fix_step, spf):
        _report(truth, measured[k], noise, step, spt)
        measured[k].gps_t_s = step / unit.physics_hz


@kernel
def _filter(truth, k, unit):  # type: ignore[no-untyped-def]
    row = truth[k]
    if k == 0:  # as if it had moved at this velocity before
        for i in range(3):
            row.gps_v_e_m_s[i] = row.v_e_m_s[i]
            row.gps_p_e_m[i] = row.p_e_m[i] - unit.filter_s * row.v_e_m_s[i]
        return
    last = truth[k - 1]
    a, b, c = unit.before, unit.start, unit.end
    for i in range(3):
        row.gps_v_e_m_s[i] = a * last.gps_v_e_m_s[i] + b * last.v_e_m_s[i] + c * row.v_e_m_s[i]
        row.gps_p_e_m[i] = a * last.gps_p_e_m[i] + b * last.p_e_m[i] + c * row.p_e_m[i]


@kernel
def _hold(last, row):  # type: ignore[no-untyped-def]
    row.gps_valid = last.gps_valid
    row.gps_t_s = last.gps_t_s
    for i in range(3):
        row.gps_p_e_m[i] = last.gps_p_e_m[i]
        row.gps_v_e_m_s[i] = last.gps_v_e_m_s[i]
    row.gps_course_rad = last.gps_course_rad
    row.gps_speed_m_s = last.gps_speed_m_s


@kernel
def _report(truth, row, noise, step, steps_per_tick):  # type: ignore[no-untyped-def]
    """Report what was inside the receiver at `step`, which lies in the tick whose row is `at`."""
    at = (step + steps_per_tick - 1) // steps_per_tick - 1
    late = (step - at * steps_per_tick) / steps_per_tick  # share of that tick gone by, 0 < late <= 1
    newer, older, error = truth[at], truth[max(at - 1, 0)], noise[at]
    p, v = row.gps_p_e_m, row.gps_v_e_m_s
    for i in range(3):
        p[i] = (1.0 - late) * older.gps_p_e_m[i] + late * newer.gps_p_e_m[i] + error.gps_p_wander_e_m[i]
        v[i] = (1.0 - late) * older.gps_v_e_m_s[i] + late * newer.gps_v_e_m_s[i] + error.gps_v_noise_e_m_s[i]
    course = np.arctan2(v[1], v[0])
    row.gps_course_rad = course if course >= 0.0 else min(course + 2.0 * np.pi, _BELOW_TWO_PI)
    row.gps_speed_m_s = np.sqrt(v[0] * v[0] + v[1] * v[1])
    row.gps_new = 1
    row.gps_valid = 1
