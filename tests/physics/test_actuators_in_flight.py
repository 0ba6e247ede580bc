"""Faults of surfaces and motor, and the battery, in the aeroplane: what moves, and which way it then turns."""

import numpy as np
import pytest

from autopilot.interface import ActuatorCommand
from scenarios.harness.config.faults import parse_fault
from sim.aeroplane.battery import BatteryParams
from sim.aeroplane.jsbsim_plant import JsbsimPlant
from sim.log import Log
from sim.plant import InFlight


def flown(*faults, command=None, duration_s=3.0, battery=None, airspeed_m_s=12.6):
    """Truth of a flight from its trim, with the command of the trim plus `command(t)`."""
    plant = JsbsimPlant(
        start=InFlight(0.0, 200.0, airspeed_m_s=airspeed_m_s),
        faults=[parse_fault(fault) for fault in faults], battery=battery,
    )  # fmt: skip
    log = Log.empty(round(duration_s / plant.dt_s))
    plant.reset(log)
    trim = np.array(plant.trimmed.command[:4])
    for k in range(len(log)):
        off = (0.0, 0.0, 0.0, 0.0) if command is None else command(k * plant.dt_s)
        assert plant.advance(k, ActuatorCommand(*(trim + off))) is None
    return log.truth, plant


def step(channel, size=0.2):
    """A step of one control at 1 s."""
    return lambda t: np.eye(4)[channel] * (size if t >= 1.0 - 1e-9 else 0.0)


@pytest.mark.parametrize(("surface", "channel", "axis"), [("aileron", 0, 0), ("elevator", 1, 1), ("rudder", 2, 2)])
def test_reversed_surface_turns_the_aeroplane_the_other_way(surface, channel, axis):
    """A third of a second after the step the body turns about its axis as commanded, or against it."""
    after = 65
    sound, _ = flown(command=step(channel), duration_s=1.4)
    wrong, _ = flown(f"{surface}:reversed@1", command=step(channel), duration_s=1.4)
    assert sound["omega_b_rad_s"][after, axis] > 0.05
    assert wrong["omega_b_rad_s"][after, axis] < -0.05
    np.testing.assert_array_equal(sound[surface][:50], wrong[surface][:50])


def test_stuck_surface_stays_where_it_is_to_the_last_bit():
    """In the middle of its way to a new command it stops; at the end of the window it goes on."""
    truth, _ = flown("aileron:stuck@1.04-2", command=step(0, 0.5))
    aileron = truth["aileron"]
    assert 0.1 < aileron[52] < 0.45
    assert np.ptp(aileron[51:100]) == 0.0
    assert aileron[-1] == pytest.approx(0.5, abs=0.02)
    assert np.all(np.diff(aileron[100:]) > -1e-9)  # no jump back


def test_deflection_of_a_fault_is_that_of_the_surface():
    """Stuck at 0.3 it stands there; off its linkage at none; play and a slow servo follow."""
    truth, _ = flown("rudder:stuck=0.3@1", "elevator:lost@1", "aileron:slow=0.1@1", command=step(0, 0.5))
    assert truth["rudder"][-1] == pytest.approx(0.3, abs=1e-6)
    assert truth["elevator"][-1] == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_allclose(np.diff(truth["aileron"][75:]), 0.1 * 0.02, rtol=0, atol=1e-6)


def test_dead_motor_gives_no_thrust_and_a_weak_one_less():
    """The throttle of the truth is what reaches the motor: 0, and 0.8 of the command; the propeller slows down."""
    sound, _ = flown()
    dead, _ = flown("motor:dead@1")
    weak, _ = flown("motor:weak=0.8@1")
    assert dead["throttle"][-1] == 0.0
    assert dead["thrust_n"][-1] <= 0.0 < weak["thrust_n"][-1] < 0.7 * sound["thrust_n"][-1]
    assert weak["throttle"][-1] == pytest.approx(0.8 * sound["throttle"][-1], rel=1e-6)
    speeds = [rows["airspeed_m_s"][-1] for rows in (dead, weak, sound)]
    assert speeds == sorted(speeds)


def test_fault_that_never_begins_changes_no_bit():
    """Faults that begin after the end leave the flight unchanged, to the last bit."""
    sound, _ = flown(command=step(0))
    never, _ = flown("aileron:reversed@900", "motor:dead@900", command=step(0))
    assert sound.tobytes() == never.tobytes()


def test_battery_in_flight_draws_what_the_motor_takes():
    """20 s of level flight: its power is two to four times that of the thrust, and with less charge it is slower."""
    truth, plant = flown(duration_s=20.0, battery=BatteryParams(1000.0, charge=0.6))
    battery = plant.actuators.battery
    full, _ = flown(duration_s=20.0, battery=BatteryParams(1000.0, charge=0.9))
    drawn_w = battery.drawn_mah * 3.6 / 20.0 * battery.rest_v
    thrust_w = np.mean(truth["thrust_n"] * truth["airspeed_m_s"])
    assert 1.5 * thrust_w < drawn_w < 4.0 * thrust_w
    assert battery.charge == pytest.approx(0.6 - battery.drawn_mah / 1000.0)
    assert full["airspeed_m_s"][-1] > truth["airspeed_m_s"][-1]  # more voltage, more thrust


def test_battery_that_is_empty_stops_the_motor():
    """At 1 % of the charge three cells are below 9 V."""
    truth, plant = flown(duration_s=5.0, battery=BatteryParams(1000.0, charge=0.01))
    assert truth["throttle"][-1] == 0.0
    assert plant.actuators.battery.figures["cut_off_s"] == 0.0
