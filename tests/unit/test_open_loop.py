"""The open loop: a plant and its sensors, no estimator and no autopilot."""

import numpy as np
import pytest

from sim.aeroplane.jsbsim_plant import JsbsimPlant
from sim.clock import Rates
from sim.log import Log
from sim.loop import mean_sample, sense
from sim.motion.prescribed_plant import PrescribedPlant, Rest, SteadyTurn
from sim.plant import InFlight
from sim.sensors.suite import SUITES, Suite


def test_sense_fills_every_row_of_the_log_it_returns():
    """The truth is the closed form of the turn, and perfect sensors read its specific force."""
    rates, log, turn = Rates(), Log.empty(100), SteadyTurn(0.6)
    assert sense(PrescribedPlant(turn, rates), Suite(SUITES["ideal"], rates, 0), log) is log
    t_s = rates.dt_s * np.arange(1, 101)
    np.testing.assert_array_equal(log.truth["p_e_m"], turn.at(t_s).p_e_m)
    np.testing.assert_allclose(log.measured["t_s"], t_s, rtol=0, atol=1e-12)
    np.testing.assert_allclose(log.measured["force_b_m_s2"], log.truth["imu_force_b_m_s2"], rtol=0, atol=1e-9)
    assert (log.flown["R_eb"] == np.eye(3)).all()  # no estimator ran


def test_sense_again_on_the_same_objects_gives_the_same_log():
    """Both are reset first: the second log repeats the first bit by bit."""
    rates = Rates()
    plant, suite = PrescribedPlant(SteadyTurn(0.6), rates), Suite(SUITES["apm2"], rates, 5)
    first, second = (sense(plant, suite, Log.empty(60)).measured.tobytes() for _ in range(2))
    assert first == second


def test_sense_flies_an_aeroplane_with_neutral_controls():
    """A trimmed aeroplane whose controls are let go is still near its start a second later."""
    rates = Rates()
    plant = JsbsimPlant(start=InFlight(0.0, 60.0), rates=rates)
    log = sense(plant, Suite(SUITES["ideal"], rates, 0), Log.empty(50))
    assert log.truth["p_e_m"][-1, 0] == pytest.approx(12.6, abs=4.0)
    assert np.abs(log.measured["gyro_b_rad_s"]).max() > 1e-4


def test_mean_sample_is_the_mean_over_the_rows_with_the_time_of_the_last():
    """Two seconds at rest: one sample, two seconds long."""
    rates = Rates()
    rows = sense(PrescribedPlant(Rest(), rates), Suite(SUITES["generic"], rates, 0), Log.empty(100)).measured
    sample = mean_sample(rows)
    assert (sample.t_s, sample.dt_s) == (rows["t_s"][-1], pytest.approx(2.0))
    np.testing.assert_allclose(sample.gyro_b_rad_s, np.average(rows["gyro_b_rad_s"], axis=0), rtol=0, atol=1e-15)
