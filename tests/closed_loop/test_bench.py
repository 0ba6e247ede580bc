"""A flight that lies on a table: at rest as asked, judged after the calibration, repeatable, and shown."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.interface import AttitudeEstimate
from scenarios.harness.config import FlightConfig, override
from scenarios.harness.flight import fly_config, fly_scenario
from scenarios.harness.metrics import heading_error_deg, inclination_error_deg, summary
from scenarios.harness.registry import find
from sim import recording
from sim.log import Outcome, Phase
from sim.view import rerun_view

ASKEW = {"start.roll_deg": 10, "start.pitch_deg": -5, "start.heading_deg": 200, "duration_s": 4}


def test_on_the_table_it_rests_at_the_attitude_and_height_asked():
    """Against SciPy's rotation: yaw, pitch, roll; no speed, no wind, no motor."""
    truth = fly_scenario(find("bench_rest"), {**ASKEW, "start.height_m": 1.2}).log.truth
    expected = Rotation.from_euler("ZYX", [200.0, -5.0, 10.0], degrees=True).as_matrix()
    np.testing.assert_allclose(truth["R_eb"], np.tile(expected, (len(truth), 1, 1)), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(truth["p_e_m"], np.tile([0.0, 0.0, -1.2], (len(truth), 1)))
    for still in ("v_e_m_s", "wind_e_m_s", "airspeed_m_s", "rotor_rpm", "thrust_n"):
        assert not truth[still].any(), still
    assert set(truth["phase"]) == {Phase.RESTING}


def test_on_the_table_it_is_judged_once_the_calibration_is_over():
    """2 s of calibration before 4 s that count; a heading at rest is one, a course is none."""
    flight = fly_scenario(find("bench_rest"), ASKEW)
    assert (flight.outcome, flight.release_s, len(flight.log)) == (Outcome.COMPLETED, 2.0, 300)
    inclination = inclination_error_deg(flight)
    np.testing.assert_array_equal(inclination.judged, flight.log.truth["t_s"] > 2.0 + 1e-9)
    assert np.isfinite(flight.log.flown["R_eb"]).all()
    assert heading_error_deg("nose")(flight).judged.sum() == 200
    assert heading_error_deg("course")(flight).judged.sum() == 0
    assert summary(flight)["heading_against_course_rms_deg"] is None


def test_on_the_table_the_calibration_reaches_the_estimator():
    """The mean gyro reading over the first 2 s; with none of it, nothing: what is on the table is not in the air."""
    told = []

    class Listens:
        def reset(self, on_ground=None):
            told.append(on_ground)

        def update(self, _m):
            return AttitudeEstimate(np.eye(3))

    flight = fly_scenario(find("bench_rest"), ASKEW, estimator=Listens)
    mean = flight.log.measured["gyro_b_rad_s"][:100].mean(axis=0)
    np.testing.assert_allclose(told[0].gyro_b_rad_s, mean, rtol=0, atol=1e-15)
    fly_scenario(find("bench_rest"), {**ASKEW, "start.calibration_s": 0}, estimator=Listens)
    assert told[1] is None


def test_thrown_without_a_calibration_the_estimator_is_told_nothing():
    """Also with sensors that a flight from the air would have had at rest on the ground before."""
    told = []

    class Listens:
        def reset(self, on_ground=None):
            told.append(on_ground)

        def update(self, _m):
            return AttitudeEstimate(np.eye(3))

    overrides = {"suite": "apm2", "start.hold_s": 1, "duration_s": 0.5}
    fly_scenario(find("cold_start"), overrides, estimator=Listens)
    fly_scenario(find("crosswind"), {"suite": "apm2", "duration_s": 0.5}, estimator=Listens)
    assert told[0] is None
    assert told[1] is not None


@pytest.mark.parametrize("name", ["bench_rest_magnetometer", "iron"])
def test_flown_again_from_its_manifest_with_a_turned_magnetometer_is_bit_equal(name):
    """The calibration stands in the manifest as numbers."""
    scenario = find(name)
    first = fly_scenario(scenario, {"duration_s": 3}, seed=4)
    config = FlightConfig(**first.manifest["config"])
    assert len(config.estimator_params["calibration.hard_iron_b_ut"]) == 3
    again = fly_config(scenario, config)
    assert first.log.flown.tobytes() == again.log.flown.tobytes()


@pytest.mark.parametrize(
    "air", [{"wind": "3@90"}, {"air.turbulence_w20_m_s": 3}, {"air.gusts": "4@12s"}, {"air.thermals": 2}]
)
def test_air_that_moves_over_the_table_is_refused(air):
    """One line that says why."""
    with pytest.raises(ValueError, match="table indoors, in still air") as refused:
        override(find("bench_rest").config, air)
    assert "\n" not in str(refused.value)


def test_an_attitude_beyond_its_range_is_refused_with_what_is_right():
    """The field without the kind of start before it."""
    with pytest.raises(ValueError, match=r"start\.pitch_deg = 95 deg: must be at most 90 deg"):
        override(find("bench_rest").config, {"start.pitch_deg": "95"})


def test_flight_on_the_table_is_recorded_and_shown(tmp_path):
    """Parquet and back to the last bit; the Rerun recording is written."""
    flight = fly_scenario(find("bench_rest"), ASKEW)
    loaded = recording.load(recording.save(flight, tmp_path / "bench"))
    assert loaded.log.truth.tobytes() == flight.log.truth.tobytes()
    assert "at rest on the table" in {event.text for event in loaded.events}
    assert rerun_view.write(flight, tmp_path / "flight.rrd").stat().st_size > 10_000
