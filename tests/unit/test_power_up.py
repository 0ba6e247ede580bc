"""A flight that starts in the air has been switched on before: what the firmware then knew of its sensors."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.harness import registry
from scenarios.harness.flight import fly_scenario
from sim.clock import Rates
from sim.log import Log
from sim.power_up import sample_at_rest
from sim.sensors.suite import SUITES, Suite


def test_sample_at_rest_has_the_offsets_of_the_flight_itself():
    """The mean of 2 s is the turn-on bias of the same seed, to noise, a step, and what gravity does to the gyro."""
    params, rates = SUITES["apm2"], Rates(gps_hz=5.0)
    sample = sample_at_rest(params, rates, 7, 3)
    suite, log = Suite(params, rates, 7, 3), Log.empty(10)
    suite.reset(log)
    bias = suite.snapshot().noise["gyro_bias_b_rad_s"][0]
    sigma = np.radians(params.gyro.noise_density_deg_s_sqrt_hz) * np.sqrt(0.5 / params.board.rest_s)
    assert np.abs(bias).max() > 20.0 * sigma  # it is an offset worth knowing
    leaning = np.radians(params.gyro.g_sensitivity_deg_s_g)  # its sigma under one g
    atol = 5.0 * np.hypot(sigma, leaning) + np.radians(0.5 / 65.5) + 1e-4  # and the earth's rotation
    np.testing.assert_allclose(sample.gyro_b_rad_s, bias, rtol=0, atol=atol)
    assert (sample.t_s, sample.dt_s) == (pytest.approx(2.0), pytest.approx(2.0))
    assert sample.force_b_m_s2[2] == pytest.approx(-9.8, rel=0, abs=1.0)


def test_sample_at_rest_is_none_where_the_board_was_not_at_rest():
    """The default sensors start in the air with what is left of their offsets, as ever."""
    assert sample_at_rest(SUITES["generic"], Rates(), 0) is None


def test_flight_from_the_air_starts_with_the_offset_known():
    """On raw parts the believed gyro bias is right from the first tick on; without the rest it is zero there."""
    scenario = registry.find("crosswind")
    short = {"duration_s": 1.0, "suite": "apm2"}
    known, unknown = (fly_scenario(scenario, {**short, **more}).log for more in ({}, {"board.rest_s": 0.0}))
    truth = known.truth["gyro_bias_b_rad_s"][0]
    assert np.abs(known.flown["gyro_bias_b_rad_s"][0] - truth).max() < 0.1 * np.abs(truth).max()
    np.testing.assert_array_equal(unknown.flown["gyro_bias_b_rad_s"][0], 0.0)


def test_rest_is_refused_where_it_is_no_time():
    """One line with the field, its value and unit."""
    board = SUITES["generic"].board
    with pytest.raises(ValueError, match=r"BoardParams.rest_s = -1.0 s: choose a finite number"):
        replace(board, rest_s=-1.0)
