"""Rates: integer ticks or a refusal that says what is possible."""

import pytest

from sim.clock import Rates


def test_rates_by_default_are_200_50_and_4_hertz():
    rates = Rates()
    assert (rates.steps_per_tick, rates.steps_per_fix, rates.ticks(20.0)) == (4, 50, 1000)
    assert rates.dt_s == 0.02


@pytest.mark.parametrize(("gps_hz", "steps"), [(1, 200), (2, 100), (2.5, 80), (4, 50), (5, 40)])
def test_rates_of_a_gps_that_divides_are_whole_steps(gps_hz, steps):
    assert Rates(gps_hz=gps_hz).steps_per_fix == steps


def test_rates_of_a_gps_that_does_not_divide_name_those_that_do():
    with pytest.raises(ValueError, match=r"GPS rate 3 Hz .*200 Hz.* choose 1, 2, 2\.5, 4, 5, 10 Hz"):
        Rates(gps_hz=3)


def test_rates_of_an_inertial_unit_that_does_not_divide_name_those_that_do():
    with pytest.raises(ValueError, match=r"inertial rate 60 Hz .* choose 40, 50, 100, 200 Hz"):
        Rates(imu_hz=60)


@pytest.mark.parametrize("gps_hz", [0, -1, float("nan"), float("inf")])
def test_rates_that_are_no_rates_are_refused(gps_hz):
    with pytest.raises(ValueError, match="GPS rate"):
        Rates(gps_hz=gps_hz)
