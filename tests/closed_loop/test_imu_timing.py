"""Closed loop at 400 Hz, with a loop that jitters and samples that never arrive; and estimators that ignore that."""

import numpy as np
import pytest

from estimator.interface import MEASURED_DTYPE, AttitudeEstimate, Measurements
from estimator.premerlani import Premerlani
from scenarios.harness.commands import export_text
from scenarios.harness.flight import fly_scenario
from scenarios.harness.logs import ours
from scenarios.harness.registry import find
from scenarios.harness.verdict import judge
from sim import recording

LOSSY = {"faults": "imu:dropped=0.05@-10"}
UNEVEN = {"rates.imu_hz": 400, "board.dt_jitter": 0.2, **LOSSY}


def failed(name, changes, estimator="premerlani"):
    """Names of the checks that one flight of the scenario fails."""
    scenario = find(name)
    flight = fly_scenario(scenario, changes, seed=0, estimator=estimator)
    return [row.name for row in judge(scenario, flight).rows if not row.passed]


class CountsTicks:
    """premerlani, told that a sample comes every 20 ms whatever the stamps say: firmware that counts its passes."""

    heading_reference = "course"
    uses = Premerlani.uses

    def __init__(self) -> None:
        self._estimator, self._rows, self._n = Premerlani(), np.zeros(1, MEASURED_DTYPE), 0

    def reset(self, on_ground=None):
        self._estimator.reset(on_ground)
        self._n = 0

    def update(self, m: Measurements) -> AttitudeEstimate:
        self._n += 1
        self._rows[0] = m.rows[m.k]
        self._rows["t_s"], self._rows["dt_s"] = 0.02 * self._n, 0.02
        return self._estimator.update(Measurements(self._rows, 0))


@pytest.mark.parametrize("name", ["rolls", "turns_180", "loops"])
def test_scenario_passes_at_50_hz_with_lost_samples_and_jitter(name):
    """Each limit of the scenario, with one in twenty samples lost and intervals that scatter by 20 %."""
    assert failed(name, {"board.dt_jitter": 0.2, **LOSSY}) == []


def test_hand_launch_passes_at_400_hz_with_lost_samples_and_jitter():
    """From the hand on, at eight times the usual rate."""
    assert failed("hand_launch", UNEVEN) == []


def test_estimator_that_counts_ticks_fails_when_samples_are_lost():
    """It passes as long as every sample comes; a twentieth of each roll is then missing."""
    assert failed("rolls", {}, CountsTicks) == []
    assert "inclination error RMS while rolling" in failed("rolls", LOSSY, CountsTicks)


def test_flight_at_400_hz_runs_the_physics_as_often():
    """The rates of a resolved configuration, and a row per sample."""
    flight = fly_scenario(find("crosswind"), {"rates.imu_hz": 400, "duration_s": 2.0}, seed=0)
    rates = flight.manifest["config"]["rates"]
    assert (rates["physics_hz"], rates["imu_hz"]) == (400, 400)
    assert len(flight.log) == 800
    np.testing.assert_allclose(np.diff(flight.log.measured["t_s"]), 0.0025, rtol=0, atol=1e-12)


def test_estimate_and_command_stay_while_no_sample_comes():
    """A fifth of a second without samples: the rows repeat, and nothing is rejected afterwards."""
    flight = fly_scenario(find("crosswind"), {"faults": "imu:dropped=1@5-5.2", "duration_s": 8.0}, seed=0)
    rows = slice(249, 259)
    for name in ("R_eb", "aileron", "elevator", "throttle", "health"):
        column = flight.log.flown[name]
        np.testing.assert_array_equal(column[rows], np.broadcast_to(column[248], column[rows].shape))
    t_s = flight.log.measured["t_s"]
    assert t_s[258] == t_s[248]
    assert flight.log.measured["dt_s"][259] == pytest.approx(0.22, abs=1e-9)
    assert np.all(flight.log.flown["health"][400:] == 1)


def test_recording_with_lost_samples_replays_without_them(tmp_path):
    """Rows of lost samples are left out, of the reference too; an estimator that is given them refuses them."""
    changes = {"duration_s": 20.0, "board.dt_jitter": 0.2, "faults": "imu:dropped=0.2@-1"}
    flight = fly_scenario(find("turns_180"), changes, seed=0)
    path = recording.save(flight, tmp_path)
    log, all_rows = ours.read(path), flight.log.measured
    came = np.diff(all_rows["t_s"], prepend=-1.0) > 0.0
    assert 0.1 < np.mean(~came) < 0.3
    assert log.rows.tobytes() == all_rows[came].tobytes()
    assert log.reference is not None
    np.testing.assert_array_equal(log.reference.R_eb, flight.log.truth["R_eb"][came])
    found = Premerlani().replay(all_rows)
    np.testing.assert_array_equal(found["R_eb"][came], Premerlani().replay(log.rows)["R_eb"])
    assert np.all(found["health"][~came] == 2)
    text = export_text.columns(flight)
    assert all(len(column.values) == came.sum() for column in text)
