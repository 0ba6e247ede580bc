"""The plots of magnetometer and air data: drawn from the first sample on, left out where none is fitted."""

import numpy as np

from estimator.blocks.air import true_over_equivalent
from sim.clock import Rates
from sim.log import Log
from sim.sensors.air_data import AirspeedParams, BarometerParams
from sim.sensors.magnetometer import MagnetometerParams
from sim.sensors.suite import Suite, SuiteParams
from sim.view.plots import curves, limits


def drawn(params):
    """Log and curves of a second of level flight."""
    log = Log.empty(50)
    log.truth["R_eb"], log.truth["airspeed_m_s"], log.truth["p_e_m"] = np.eye(3), 12.0, (0.0, 0.0, -30.0)
    suite = Suite(params, Rates(), 0)
    suite.reset(log)
    for k in range(50):
        suite.measure(k)
    return log, curves(log, "nose")


def test_fitted_sensors_are_drawn_from_their_first_sample_on():
    """Nothing before it, the reading held after it."""
    log, lines = drawn(SuiteParams(magnetometer=MagnetometerParams(), airspeed=AirspeedParams()))
    for i, axis in enumerate("xyz"):
        assert np.all(np.isnan(lines[f"field/{axis}"][:4]))
        np.testing.assert_array_equal(lines[f"field/{axis}"][4:, 0], log.measured["mag_b_ut"][4:, i])
    equivalent_m_s = 12.0 / true_over_equivalent(30.0)
    np.testing.assert_allclose(lines["flight/speed"][4:, 1], equivalent_m_s, rtol=0, atol=1e-12)
    assert np.all(np.isnan(lines["flight/height"][:, 1]))  # no barometer
    assert {"field/x", "field/y", "field/z"} <= limits(log, lines).keys()


def test_sensors_that_are_not_fitted_are_not_drawn():
    """No line, and no range of the field's plots, by which the view leaves their page out."""
    log, lines = drawn(SuiteParams(barometer=BarometerParams()))
    assert np.all(np.isnan(lines["field/x"]))
    assert np.all(np.isnan(lines["flight/speed"][:, 1]))
    np.testing.assert_array_equal(lines["flight/height"][4:, 1], 30.0)
    assert not {"field/x", "field/y", "field/z"} & limits(log, lines).keys()
