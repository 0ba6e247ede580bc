"""How the loop ends a flight: what is kept, who is blamed, and the same way for everyone's flight code."""

import signal

import numpy as np
import pytest

from autopilot.interface import NEUTRAL, Mode, Setpoint
from autopilot.pilot import Script, Timed
from estimator.interface import AttitudeEstimate
from sim.clock import Rates
from sim.log import Log, Outcome
from sim.loop import fly
from sim.motion.prescribed_plant import PrescribedPlant, StraightLevel
from sim.plant import SimulationDiverged
from sim.sensors.suite import SUITES, Suite

SCRIPT = Script([Timed(0.0, Setpoint(Mode.STABILISE))])
TICKS = 100


class Level:
    """An estimator that always says level."""

    def update(self, m):
        return AttitudeEstimate(np.eye(3))


class Passive:
    """An autopilot that lets go."""

    def update(self, estimate, m, setpoint):
        return NEUTRAL


class LateFault:
    """`thing.update`, until it answers `fault` (or raises it) in tick 50."""

    def __init__(self, thing, fault):
        self.thing, self.fault, self.k = thing, fault, 0

    def update(self, *arguments):
        self.k += 1
        if self.k <= 50:
            return self.thing.update(*arguments)
        if isinstance(self.fault, Exception):
            raise self.fault
        return self.fault


class BlowsUp(PrescribedPlant):
    """A plant that gives up in tick 70."""

    def advance(self, k, command):
        if k == 70:
            raise SimulationDiverged("the simulation blew up at 1.42 s: nan m/s")
        return super().advance(k, command)


def flown(estimator=None, autopilot=None, plant=PrescribedPlant):
    rates = Rates()
    suite = Suite(SUITES["ideal"], rates, seed=0)
    motion = StraightLevel(airspeed_m_s=12.0)
    return fly(plant(motion, rates), suite, estimator or Level(), autopilot or Passive(), SCRIPT, Log.empty(TICKS))


def test_flight_without_a_fault_fills_every_row():
    flight = flown()
    assert (flight.outcome, flight.message, len(flight.log)) == (Outcome.COMPLETED, "", TICKS)


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        (KeyError("mine"), "KeyError: 'mine'"),
        (None, "returned NoneType"),
        (AttitudeEstimate(np.eye(3), health=9), "health is not a Health"),
        (AttitudeEstimate(np.full((3, 3), np.nan)), "R_eb is not finite"),
    ],
)
def test_estimator_that_fails_in_flight_is_named_and_the_rows_before_are_kept(fault, says):
    """The fault is in tick 50: fifty rows are kept, and the line names class, time and fault."""
    flight = flown(estimator=LateFault(Level(), fault))
    assert (flight.outcome, len(flight.log)) == (Outcome.ESTIMATOR_FAILED, 50)
    assert flight.message.startswith("LateFault at 1.02 s: ")
    assert says in flight.message
    assert flight.events[-1].text == flight.message


@pytest.mark.parametrize(
    ("fault", "says"), [(ValueError("mine"), "mine"), (NEUTRAL._replace(mode=77), "mode 77"), (5.0, "returned float")]
)
def test_autopilot_that_fails_in_flight_is_named(fault, says):
    flight = flown(autopilot=LateFault(Passive(), fault))
    assert (flight.outcome, len(flight.log)) == (Outcome.AUTOPILOT_FAILED, 50)
    assert says in flight.message


@pytest.mark.parametrize("who", ["estimator", "autopilot"])
def test_reset_that_raises_ends_the_flight_before_it_began(who):
    """Power-up is flight code, too."""

    class Broken(Level if who == "estimator" else Passive):
        def reset(self, *_):
            raise RuntimeError("no memory card")

    flight = flown(**{who: Broken()})
    assert flight.outcome == f"{who}_failed"
    assert flight.message == "Broken at 0.00 s: RuntimeError: no memory card (test_loop.py, line 105, in reset)"
    assert len(flight.log) == 0


def test_simulation_that_blows_up_keeps_the_rows_before_and_the_cause():
    flight = flown(plant=BlowsUp)
    assert (flight.outcome, len(flight.log)) == (Outcome.DIVERGED, 70)
    assert flight.message == "the simulation blew up at 1.42 s: nan m/s"


def test_interrupt_in_flight_keeps_the_rows_before(ctrl_c):
    """Ctrl-C is an outcome; nothing flown is lost."""

    class Stopped(Level):
        def update(self, m):
            if m.k == 30:
                signal.raise_signal(signal.SIGINT)
            return super().update(m)

    flight = flown(estimator=Stopped())
    assert (flight.outcome, len(flight.log)) == (Outcome.INTERRUPTED, 30)


def test_keyboard_interrupt_raised_by_the_estimator_is_its_fault():
    """Only a signal is Ctrl-C."""

    class Raises(Level):
        def update(self, m):
            raise KeyboardInterrupt

    assert flown(estimator=Raises()).outcome == Outcome.ESTIMATOR_FAILED
