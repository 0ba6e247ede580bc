"""The battery: what is drawn, how far the voltage sags, and the cut-off."""

import re

import numpy as np
import pytest
from scipy.optimize import brentq

from scenarios.harness.config import FlightConfig, override
from sim.aeroplane.battery import CELL, CUTOFF_PER_S, Battery, BatteryParams
from sim.aeroplane.jsbsim_model import AIRCRAFT

MOTOR = AIRCRAFT / "endurance" / "motor.xml"  # 11.1 V, 0.14 ohm
DESIGN_V, MOTOR_OHM, DT_S = 11.1, 0.14, 0.02


def battery(**params):
    return Battery(BatteryParams(**{"capacity_mah": 2000.0, **params}), MOTOR, DT_S)


def test_battery_has_the_cells_of_the_motor_and_the_voltage_of_its_charge():
    """Three cells at 11.1 V; at rest 12.5 V full, 11.2 V half full, falling all the way."""
    assert battery().cells == 3
    volts = [battery(charge=charge).rest_v for charge in np.linspace(0.0, 1.0, 101)]
    assert volts[100] == pytest.approx(12.51)
    assert volts[50] == pytest.approx(11.22)
    assert np.all(np.diff(volts) > 0.0)
    assert np.all(np.diff(CELL[:, 0]) > 0.0)


def test_constant_current_draws_its_charge():
    """10 A through the motor at the voltage of the battery, for 60 s: 166.7 mAh, 8.3 % of 2000 mAh."""
    b = battery(charge=0.9)
    for k in range(3000):
        b.throttle(k, 1.0, b.voltage_v / DESIGN_V, 10.0)
    assert b.drawn_mah == pytest.approx(10.0 * 60.0 / 3.6, rel=1e-4)
    assert b.charge == pytest.approx(0.9 - b.drawn_mah / 2000.0, rel=1e-12)


def test_battery_gives_the_power_that_the_motor_takes():
    """At half throttle the current of the battery is half that of the motor: no power is made."""
    b = battery(charge=0.5)
    position = 0.5 * b.rest_v / DESIGN_V
    b.throttle(0, 0.5, position, 8.0)
    assert b.drawn_mah * 3.6 / DT_S == pytest.approx(4.0)


def test_motor_driven_by_the_air_charges_nothing():
    """A current that flows back is not stored, and does not raise the voltage above that at rest."""
    b = battery(charge=0.5, resistance_ohm=0.2)
    rest_v = b.rest_v
    assert b.throttle(0, 0.2, 0.2, -5.0) <= 0.2 * rest_v / DESIGN_V
    assert b.drawn_mah == 0.0


@pytest.mark.parametrize("fraction", [0.3, 0.7, 1.0])
@pytest.mark.parametrize("ohm", [0.05, 0.3])
def test_voltage_sags_as_in_the_circuit(fraction, ohm):
    """Oracle: the voltage at which the current of the motor, times the resistance, is what is missing."""
    b = battery(charge=0.5, resistance_ohm=ohm, cutoff_v=0.0)
    before, current_a = 0.6, 7.0
    back_v = DESIGN_V * before - MOTOR_OHM * current_a
    rest_v = b.rest_v

    def missing(volts):
        return rest_v - ohm * fraction * max(fraction * volts - back_v, 0.0) / MOTOR_OHM - volts

    expected = brentq(missing, 0.0, rest_v + 1e-9)
    given = b.throttle(0, fraction, before, current_a)
    assert b.voltage_v == pytest.approx(expected, rel=1e-9)
    assert given == pytest.approx(min(fraction * expected / DESIGN_V, 1.0), rel=1e-9)


def test_cut_off_takes_the_motor_back_for_good():
    """Below 3 V for each cell the throttle falls by half a throttle a second; closed and opened again it stays off."""
    b = battery(charge=0.01)
    given = [b.throttle(k, 1.0, 0.0, 0.0) for k in range(150)]
    full = b.rest_v / DESIGN_V
    np.testing.assert_allclose(np.diff(given[:90]), -CUTOFF_PER_S * DT_S * full, rtol=1e-6)
    assert given[-1] == 0.0
    assert b.throttle(150, 0.0, 0.0, 0.0) == b.throttle(151, 1.0, 0.0, 0.0) == 0.0
    assert b.figures["cut_off_s"] == 0.0
    assert battery(charge=0.5).figures["cut_off_s"] is None


def test_reset_is_as_new():
    """Charge, voltage, drawn charge and cut-off."""
    b = battery(charge=0.01)
    for k in range(20):
        b.throttle(k, 1.0, 0.5, 5.0)
    b.reset()
    assert b.figures == battery(charge=0.01).figures


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"battery.charge": 0.5}, "set battery.capacity_mah as well, in mAh"),
        ({"battery.capacity_mah": 0}, "battery.capacity_mah = 0 mAh"),
        ({"battery.capacity_mah": 2000, "battery.charge": 1.5}, "battery.charge = 1.5"),
        ({"battery.capacity_mah": 2000, "aircraft": "gentle_lady"}, "gentle_lady has no motor"),
        ({"battery.capacty_mah": 2000}, "did you mean battery.capacity_mah"),
    ],
)
def test_battery_that_cannot_be_is_refused_in_one_line(changes, words):
    """Out of range, misspelt, without a capacity or without a motor."""
    with pytest.raises(ValueError, match=re.escape(words)) as refused:
        override(FlightConfig(), changes)
    assert "\n" not in str(refused.value)
