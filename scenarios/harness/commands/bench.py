"""Speed: the closed loop against bare JSBSim, stage by stage, and the estimator alone.

The closed loop is `sim.loop.fly` in still air, timed from the first simulated second to the last, which leaves out the
start (trim, drawing the noise).  Bare JSBSim is the same plant in the same state with constant commands.  The two
alternate in one process.  The result is the ratio of their minima; the median over the pairs shows how much other
programs disturbed the measurement.
"""

import platform
import statistics
from collections.abc import Callable
from dataclasses import asdict, dataclass
from time import perf_counter_ns
from typing import Any

from rich.text import Text

from autopilot.interface import NEUTRAL, Autopilot, Mode, Setpoint
from autopilot.pilot import Script, Timed
from estimator.instruments import Instruments
from estimator.interface import AttitudeEstimator
from scenarios.harness.checks import Row
from scenarios.harness.cli import console
from scenarios.harness.cli.reports import reporting, usage
from scenarios.harness.equipping import equipped, equipped_autopilot, heading_reference_of
from scenarios.harness.gate import guard
from scenarios.harness.timing import Cost, NotTimed, cost_of, least_ns
from scenarios.harness.verdict import FAILED, SIMULATION_FAILED
from sim.aeroplane.jsbsim_plant import JsbsimPlant
from sim.clock import Rates
from sim.flight_code import FlightCodeFailed, blaming, command_of, estimate_of
from sim.log import Flight, Log, Outcome
from sim.loop import fly, make_ready, power_up
from sim.plant import InFlight
from sim.sensors.fitting import suite_params
from sim.sensors.known import data_sheets
from sim.sensors.suite import Suite

RATIO_LIMIT = 1.6
KERNEL_LIMIT_NS, UPDATE_LIMIT_NS = 1000.0, 3000.0
STAGES = ("physics and truth", "sensors", "estimator", "autopilot")
_NS_PER_US = 1e3


@dataclass(frozen=True, slots=True)
class Speed:
    """The measurements.

    closed_loop_ratio_median : over the pairs of flights
    bare_us_per_tick, closed_loop_us_per_tick : least of the repeats      stages_us_per_tick : recording included
    estimator_ns_per_call : its kernel over a whole log in one call, per tick; None if it has none (no `replay`)
    estimator_update_ns : a call of its `update`      ticks : of one flight      repeats : pairs of flights
    """

    closed_loop_ratio_median: float
    bare_us_per_tick: float
    closed_loop_us_per_tick: float
    stages_us_per_tick: dict[str, float]
    estimator: str
    estimator_ns_per_call: float | None
    estimator_update_ns: float
    ticks: int
    repeats: int

    @property
    def ratio(self) -> float:
        """Closed loop over bare."""
        return self.closed_loop_us_per_tick / self.bare_us_per_tick

    @property
    def rows(self) -> list[Row]:
        """The requirements, with their limits."""
        requirements = (
            ("closed loop over bare JSBSim", "", self.ratio, RATIO_LIMIT),
            (f"{self.estimator}: update()", "ns", self.estimator_update_ns, UPDATE_LIMIT_NS),
            (f"{self.estimator}: kernel", "ns", self.estimator_ns_per_call, KERNEL_LIMIT_NS),
        )
        return [
            Row(name, unit, value, "<=", limit, value <= limit)
            for name, unit, value, limit in requirements
            if value is not None
        ]

    @property
    def passed(self) -> bool:
        """Whether all requirements are met."""
        return all(row.passed for row in self.rows)

    def to_json(self) -> dict[str, Any]:
        """The values by name; names include the unit."""
        machine = {"python": platform.python_version(), "machine": platform.machine()}
        return {"passed": self.passed, "closed_loop_ratio": self.ratio} | asdict(self) | machine


_BENCHMARK = "the benchmark"


class Cruise:
    """A flight straight ahead in still air, that can be flown again and again."""

    def __init__(self, estimator: str, duration_s: float) -> None:
        rates = Rates()
        self.dt_s = rates.dt_s
        self.second = round(1.0 / rates.dt_s)
        self.log = Log.empty(rates.ticks(duration_s))
        self.plant = JsbsimPlant(start=InFlight(heading_rad=0.0), rates=rates)
        suite = suite_params("generic", {})
        self.suite = Suite(suite, rates, seed=0)
        self.instruments = Instruments(data_sheets(suite, rates))
        self.spec = estimator
        self.setpoint = Setpoint(Mode.COURSE, course_rad=0.0, height_m=60.0)

    def pilots(self) -> tuple[AttitudeEstimator, Autopilot]:
        """A new estimator and a new autopilot, switched on."""
        estimator = equipped(self.spec, self.instruments).code
        autopilot = equipped_autopilot("dcm", heading_reference_of(estimator), "endurance", self.instruments).code
        make_ready(estimator, autopilot, self.log)
        power_up(estimator, None)
        return estimator, autopilot

    def closed_us(self) -> float:
        """The closed loop, microseconds a tick."""
        marks: list[tuple[int, int]] = []

        def watch(log: Log, n_rows: int) -> None:  # noqa: ARG001 - as the loop calls it
            marks.append((n_rows, perf_counter_ns()))

        script = Script([Timed(0.0, self.setpoint)])
        self.whole(fly(self.plant, self.suite, *self.pilots(), script, self.log, watch=watch))
        (first, begin_ns), (last, end_ns) = marks[0], marks[-1]
        return (end_ns - begin_ns) / (last - first) / _NS_PER_US

    def whole(self, flight: Flight) -> None:
        """NotTimed if the flight did not reach its end."""
        if flight.outcome == Outcome.INTERRUPTED:
            raise KeyboardInterrupt
        if flight.outcome != Outcome.COMPLETED:
            code = SIMULATION_FAILED if flight.outcome == Outcome.DIVERGED else FAILED
            why = flight.message or flight.outcome.replace("_", " ")
            raise NotTimed(f"the benchmark's flight did not last: {why}", code)

    def bare_us(self) -> float:
        """The physics alone, microseconds a tick, from the same start; its first second is left out too."""
        self.plant.reset(self.log)
        self.plant.run_bare(self.second)
        n_ticks = len(self.log) - self.second
        begin_ns = perf_counter_ns()
        self.plant.run_bare(n_ticks)
        return (perf_counter_ns() - begin_ns) / n_ticks / _NS_PER_US

    def stages_us(self) -> dict[str, float]:
        """The stages of one flight, microseconds a tick, clock readings taken off."""
        estimator, autopilot = self.pilots()
        self.plant.reset(self.log)
        self.suite.reset(self.log)
        total, command, clock = [0] * len(STAGES), NEUTRAL, perf_counter_ns
        for k in range(len(self.log)):
            t0 = clock()
            self.plant.advance(k, command)
            t1 = clock()
            measured = self.suite.measure(k)
            t2 = clock()
            estimate = estimate_of(estimator, measured, self.log.flown, k)
            t3 = clock()
            command = command_of(autopilot, estimate, measured, self.setpoint, self.log.flown, k)
            for i, spent in enumerate((t1 - t0, t2 - t1, t3 - t2, clock() - t3)):
                total[i] += spent
        per_reading = least_ns(lambda: [clock() for _ in range(1000)]) / 1000
        per_tick = [(spent / len(self.log) - per_reading) / _NS_PER_US for spent in total]
        return dict(zip(STAGES, per_tick, strict=True))

    def cost(self) -> Cost:
        """Cost of an update of the estimator alone, over the measurements of the last flight."""
        estimator, _ = self.pilots()
        with blaming(Outcome.ESTIMATOR_FAILED, estimator, 0.0):
            return cost_of(estimator, self.log.measured)


def measure(estimator: str, seconds: float, repeats: int, advance: Callable[[int, int], None]) -> Speed:
    """Measure with `estimator`: `repeats` pairs of `seconds` of simulated flight.

    Raises
    ------
    ValueError      no such estimator      NotTimed    one that fails, or does not keep the aeroplane in the air
    """
    equipped(estimator)  # refused before anything is timed
    if _BENCHMARK in guard.lost:
        raise NotTimed(f"the benchmark's flight did not last: the process {guard.lost[_BENCHMARK].message}")
    try:
        with guard.watched(_BENCHMARK):
            return _measured(estimator, seconds, repeats, advance)
    except FlightCodeFailed as failure:
        raise NotTimed(str(failure)) from failure


def _measured(estimator: str, seconds: float, repeats: int, advance: Callable[[int, int], None]) -> Speed:
    cruise = Cruise(estimator, seconds)
    cruise.closed_us()  # compiles, and warms up
    cruise.bare_us()
    closed, bare = [], []
    for i in range(repeats):
        closed.append(cruise.closed_us())
        bare.append(cruise.bare_us())
        advance(i + 1, repeats)
    cost = cruise.cost()
    by_repeat = [cruise.stages_us() for _ in range(max(3, repeats // 4))]
    return Speed(
        closed_loop_ratio_median=statistics.median(c / b for c, b in zip(closed, bare, strict=True)),
        bare_us_per_tick=min(bare),
        closed_loop_us_per_tick=min(closed),
        stages_us_per_tick={stage: min(stages[stage] for stages in by_repeat) for stage in STAGES},
        estimator=estimator,
        estimator_ns_per_call=cost.replay_ns,
        estimator_update_ns=cost.update_ns,
        ticks=len(cruise.log),
        repeats=repeats,
    )


def print_report(speed: Speed) -> None:
    """The figures, and where the time goes."""
    out = console.out()
    out.print(console.verdict_table("speed in still air", speed.rows))
    parts = {"bare JSBSim": speed.bare_us_per_tick, "closed loop": speed.closed_loop_us_per_tick}
    parts |= {f"  {stage}": us for stage, us in speed.stages_us_per_tick.items()}
    out.print(console.figure_table("where the time goes", parts, "us per tick"))
    ratios = f"median ratio of the pairs {speed.closed_loop_ratio_median:.2f} (least over least {speed.ratio:.2f})"
    out.print(Text(f"{speed.repeats} pairs of {speed.ticks} ticks; {ratios}"))


def run(estimator: str, seconds: float, repeats: int, json_: str | None) -> int:
    """Do what the command line asks for; gives the exit code."""
    with reporting(json_) as report:
        try:
            with usage(), console.progress("measuring", "pairs") as advance:
                speed = measure(estimator, seconds, repeats, advance)
        except NotTimed as problem:
            report({"passed": False, "estimator": estimator, "failure": str(problem)})
            console.error(str(problem))
            return problem.exit_code
        print_report(speed)
        report(speed.to_json())
    return 0 if speed.passed else 1
