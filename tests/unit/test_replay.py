"""Estimators over a log: the same as in flight, powered up as they should be, judged where they should be."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.instruments import PROPERTIES, Known
from estimator.interface import MEASURED_DTYPE, AttitudeEstimate
from scenarios.harness import logs
from scenarios.harness.equipping import equipped
from scenarios.harness.flight import fly_scenario
from scenarios.harness.logs.recorded import RecordedLog, Reference
from scenarios.harness.registry import find
from scenarios.harness.replay import Window, as_flight, at_rest, flying, judged_rows, make, replay, score, why_none
from sim import recording
from sim.log import Outcome

DATA = Path(__file__).parents[1] / "reference" / "data"
HAND, AIR, RESTED = "hand_launch", "turns_180", "turns_180 on apm2, which rested before"


class Called:
    """The DCM estimator behind `update` alone, as a person's own class has it."""

    heading_reference = "course"

    def __init__(self, instruments):
        self._dcm = equipped("premerlani", instruments).code
        self.reset = self._dcm.reset

    def update(self, m):
        return self._dcm.update(m)


class Broken:
    """Answers with something that is no rotation from 3 s on."""

    def update(self, m):
        return AttitudeEstimate(np.eye(3) * (1.0 if m.imu.t_s < 3.0 else 2.0))


@pytest.fixture(scope="module")
def flights(tmp_path_factory):
    """A short hand launch and a short flight that starts in the air: as flown, and read from their recordings."""
    found = {}
    for name, changes in ((HAND, {}), (AIR, {}), (RESTED, {"suite": "apm2"})):
        flight = fly_scenario(find(name.split()[0]), {"duration_s": 12.0, **changes}, seed=2)
        folder = recording.save(flight, tmp_path_factory.mktemp(name.split()[0]) / "flight")
        found[name] = flight, logs.read(folder)
    return found


def rest(n=200):
    """Four seconds level at rest, with a fix that says so."""
    rows = np.zeros(n, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = 0.02 * np.arange(1, n + 1), 0.02
    rows["force_b_m_s2"] = [0.0, 0.0, -9.8]
    rows["gps_valid"], rows["gps_new"] = 1, 1
    return rows


@pytest.mark.parametrize("name", [HAND, AIR, RESTED])
def test_replay_of_a_flight_is_what_was_flown_bit_for_bit(flights, name):
    """The estimate is that of the flight, calibration in the hand or on the ground before it included."""
    flight, log = flights[name]
    replayed = replay(log, "premerlani")
    assert replayed.first == (100 if name == HAND else 0)
    for column in ("R_eb", "omega_b_rad_s", "gyro_bias_b_rad_s", "health"):
        got, flown = replayed.log.flown[column], flight.log.flown[column]
        np.testing.assert_array_equal(got[replayed.first :], flown[replayed.first :])
    assert replayed.rejected == 0
    assert replayed.ns_per_update > 0.0
    assert (log.on_ground is None) is (name != RESTED)


def test_replay_with_everything_withheld_knows_no_calibration_either(flights):
    """The offset of apm2's gyros, measured before the flight, is then unknown: its error is there to be seen."""
    flight, log = flights[RESTED]
    replayed = replay(log, "premerlani", withheld=list(PROPERTIES))
    assert replayed.known["gps_filter_s"][:2] == (0.0, "withheld")
    offset_deg_s = np.degrees(np.abs(flight.log.truth["gyro_bias_b_rad_s"][0]).max())
    assert offset_deg_s > 5.0
    assert replayed.scores["inclination_max_deg"] > 5.0 * replay(log, "premerlani").scores["inclination_max_deg"]


def test_replay_called_row_by_row_is_the_same(flights):
    """An estimator without a replay of its own is called as in flight."""
    _, log = flights[HAND]
    called = replay(log, f"{__file__}:Called")
    compiled = replay(log, "premerlani")
    np.testing.assert_array_equal(called.log.flown["R_eb"], compiled.log.flown["R_eb"])
    assert called.rejected is None


def test_replay_parameters_reach_the_estimator(flights):
    """Changed by name, as text; unknown ones are refused with those that come near."""
    made = make("premerlani", {"gps_latency_s": "0.6", "turn_speed": "true"})
    assert made.code.params.turn_speed is True
    assert made.known["gps_latency_s"] == (0.6, "set", "")
    with pytest.raises(ValueError, match="unknown parameter 'gps_lateny_s' of estimator premerlani: did you mean gps"):
        make("premerlani", {"gps_lateny_s": "0.6"})
    with pytest.raises(ValueError, match="has no parameter 'gain'"):
        make("gyro_only", {"gain": "1"})
    with pytest.raises(ValueError, match="oracle reads the truth"):
        make("oracle", {})


def test_replay_takes_what_the_log_says_of_its_instruments(flights):
    """Where the estimator has such a parameter, and nobody says otherwise."""
    _, log = flights[AIR]
    assert set(log.known) >= {"gps_filter_s", "gps_latency_s", "gps_stamped", "imu_rate_hz"}
    own = Known(1.0, "log")
    knows = replace(log, known={**log.known, "gps_latency_s": own, "no_parameter_of_anything": own})
    told = replay(log, "premerlani", {"gps_latency_s": 1.0})
    found = replay(knows, "premerlani")
    assert found.scores == told.scores
    assert found.scores != replay(log, "premerlani").scores
    assert replay(knows, "premerlani", {"gps_latency_s": 0.3}).scores == replay(log, "premerlani").scores
    assert not replay(knows, "gyro_only").failure


@pytest.mark.parametrize(("scenario", "entry"), [("told_3", (3.0, "data sheet")), ("s_3", (0.3, "withheld"))])
def test_replay_of_our_recording_knows_what_was_known_in_flight(tmp_path, scenario, entry):
    """A receiver known to be 3 s late in flight is known to be in replay; what was withheld stays so."""
    recording.save(fly_scenario(find(f"gps_latency_{scenario}"), {"duration_s": 1.0}), tmp_path / "late")
    log = logs.read(tmp_path / "late")
    assert log.known["gps_latency_s"][:2] == entry
    assert replay(log, "premerlani").known["gps_latency_s"][:2] == entry
    assert replay(log, "premerlani", withheld=["gps_latency_s"]).known["gps_latency_s"][:2] == (0.3, "withheld")


def test_replay_of_an_estimator_that_fails_says_so_and_is_recorded(flights, tmp_path):
    """No scores, one line with class, time and fault, and a recording that says it too."""
    _, log = flights[AIR]
    replayed = replay(log, f"{__file__}:Broken")
    assert replayed.failure.startswith("Broken at 3.00 s: R_eb is not a rotation")
    assert np.isnan(list(replayed.scores.values())).all()
    flight = as_flight(log, replayed, Window())
    assert flight.outcome == Outcome.ESTIMATOR_FAILED
    recording.save(flight, tmp_path)


def test_score_of_known_rotations_is_their_angles():
    """Tilts and turns made with SciPy come back as inclination, heading and rotation."""
    rows = rest(3)
    reference = Rotation.from_euler("ZYX", [[40, 10, 20], [120, -30, 0], [-70, 5, -60]], degrees=True)
    turned = (
        Rotation.from_euler("z", [[3], [-4], [12]], degrees=True) * reference
    )  # about the earth's down: heading alone
    log = RecordedLog(rows, "log", (), Reference(reference.as_matrix(), "truth", "t"))
    every = np.ones(3, np.bool_)
    found = score(turned.as_matrix(), log, every)
    expected = {"inclination_rms_deg": 0.0, "heading_rms_deg": 13.0 / np.sqrt(3.0), "rotation_max_deg": 12.0}
    assert {name: found[name] for name in expected} == pytest.approx(expected, rel=0, abs=1e-9)
    level = Rotation.from_euler("z", [[40], [120], [-70]], degrees=True)
    leaning = level * Rotation.from_euler("x", [[6], [-8], [24]], degrees=True)  # bank alone
    log = replace(log, reference=Reference(level.as_matrix(), "truth", "t"))
    found = score(leaning.as_matrix(), log, every)
    assert found["inclination_rms_deg"] == pytest.approx(26.0 / np.sqrt(3.0), rel=0, abs=1e-9)
    assert found["inclination_max_deg"] == pytest.approx(24.0, rel=0, abs=1e-9)
    assert found["rotation_rms_deg"] == pytest.approx(26.0 / np.sqrt(3.0), rel=0, abs=1e-9)
    assert found["heading_rms_deg"] == pytest.approx(0.0, rel=0, abs=1e-9)


def test_judged_are_airborne_rows_after_settling():
    """On the ground nothing is judged, nor where there is no reference, nor while it settles."""
    rows = rest(1000)
    rows["gps_speed_m_s"][200:800] = 12.0
    R_eb = np.tile(np.eye(3), (1000, 1, 1))
    R_eb[600] = np.nan
    log = RecordedLog(rows, "log", ("gyro", "accelerometer", "gps"), Reference(R_eb, "truth", "t"))
    judged = np.flatnonzero(judged_rows(log, Window(settle_s=2.0)))
    assert judged.tolist() == [k for k in range(301, 800) if k != 600]
    assert why_none(log, Window(settle_s=2.0)) == ""
    assert not judged_rows(log, Window(airborne_m_s=13.0)).any()
    assert "fastest fix: 12.0 m/s" in why_none(log, Window(airborne_m_s=13.0))
    assert not judged_rows(replace(log, reference=None), Window()).any()
    assert "no attitude" in why_none(replace(log, reference=None), Window())
    assert "after 100 s to settle" in why_none(log, Window(settle_s=100.0))
    elsewhere = replace(log, reference=replace(log.reference, R_eb=np.full((1000, 3, 3), np.nan)))
    assert "do both use one clock?" in why_none(elsewhere, Window())


def test_judged_with_a_limit_of_zero_are_all_rows_even_at_a_speed_of_exactly_zero():
    """On a bench with a GPS nothing moves."""
    log = RecordedLog(rest(), "log", ("gyro", "gps"), Reference(np.tile(np.eye(3), (200, 1, 1)), "truth", "t"))
    assert not judged_rows(log, Window(settle_s=1.0)).any()
    assert judged_rows(log, Window(airborne_m_s=0.0, settle_s=1.0)).sum() == 200 - 51


def test_flying_after_the_last_fix_lasts_as_long_as_a_fix_is_fresh():
    """A GPS lost in flight says nothing of the ground after it; a gap between two fast fixes is flight."""
    rows = rest(3000)
    rows["gps_new"] = 0
    rows["gps_new"][[*range(0, 500, 10), *range(1500, 2000, 10)]] = 1
    rows["gps_speed_m_s"] = 12.0
    expected = np.zeros(3000, np.bool_)
    expected[: 1990 + 101] = True  # 2 s after the last fix
    np.testing.assert_array_equal(flying(rows, 5.0), expected)
    rows["gps_speed_m_s"][1500:] = 0.0  # it landed in the silence
    expected[490 + 101 :] = False
    np.testing.assert_array_equal(flying(rows, 5.0), expected)


def test_judged_are_all_rows_without_gps_after_settling_and_all_against_firmware():
    """A bench log has no flight in it; two runs of one algorithm agree from the first row on."""
    log = RecordedLog(
        rest(), "log", ("gyro", "accelerometer"), Reference(np.tile(np.eye(3), (200, 1, 1)), "truth", "t")
    )
    assert judged_rows(log, Window(settle_s=1.0)).sum() == 200 - 51
    firmware = replace(log, reference=replace(log.reference, kind="firmware"))
    assert judged_rows(firmware, Window(settle_s=1.0), first=100).all()


def test_power_up_at_rest_takes_the_mean_and_in_the_air_nothing():
    """Turning, shaken, felt too heavy or moving over the ground is not at rest."""
    rows = rest()
    rows["gyro_b_rad_s"] = [0.01, -0.02, 0.03]
    sample = at_rest(rows)
    np.testing.assert_allclose(sample.gyro_b_rad_s, [0.01, -0.02, 0.03], rtol=1e-12)
    for column, value in (("gyro_b_rad_s", 0.9), ("force_b_m_s2", [0.0, 0.0, -13.0]), ("gps_speed_m_s", 9.0)):
        moved = rows.copy()
        moved[column] = value
        assert at_rest(moved) is None
    rows["force_b_m_s2"][::2, 0] = 2.0
    assert at_rest(rows) is None


def test_power_up_is_in_the_air_against_firmware_and_as_told(flights):
    """Reference vectors of a firmware start as it did; --calibration decides where it is given."""
    folder = DATA / "ap_ahrs_dcm"
    truth = logs.read(folder / "A50_in.csv.gz")
    firmware = logs.read(folder / "A50_in.csv.gz", reference=folder / "A50_ap2013_gps.csv.gz")
    assert replay(truth, "premerlani").first == 100
    assert replay(firmware, "premerlani").first == 0
    assert replay(firmware, "premerlani", window=Window(calibration_s=1.0)).first == 50
    assert replay(truth, "premerlani", window=Window(calibration_s=0.0)).first == 0
    with pytest.raises(ValueError, match=r"calibration_s = 1000 s: the log is 130\.0 s long"):
        replay(truth, "premerlani", window=Window(calibration_s=1000.0))


def test_window_refuses_what_cannot_be():
    """One line with the name, the value and the unit."""
    with pytest.raises(ValueError, match="settle_s = -1 s: must be zero or more"):
        Window(settle_s=-1.0)


def test_flight_of_a_replay_shows_reference_and_gps_track(flights, tmp_path):
    """The reference where the truth would be, the way between the fixes; it can be replayed again, to the same."""
    _, log = flights[AIR]
    replayed = replay(log, "premerlani")
    flight = as_flight(log, replayed, Window())
    np.testing.assert_array_equal(flight.log.truth["R_eb"], log.reference.R_eb)
    fixes = np.flatnonzero(log.rows["gps_new"])
    np.testing.assert_allclose(flight.log.truth["p_e_m"][fixes], log.rows["gps_p_e_m"][fixes], rtol=0, atol=1e-9)
    again = replay(logs.read(recording.save(flight, tmp_path / "again")), "premerlani")
    np.testing.assert_array_equal(again.log.flown["R_eb"], replayed.log.flown["R_eb"])


def test_replay_without_reference_has_no_scores(flights):
    """Nothing to score against is no failure."""
    _, log = flights[AIR]
    replayed = replay(replace(log, reference=None), "gyro_only")
    assert np.isnan(list(replayed.scores.values())).all()
    assert replayed.to_json()["inclination_rms_deg"] is None
    assert not replayed.failure


@pytest.mark.skipif("WINGSLEVEL_DATA" not in os.environ, reason="WINGSLEVEL_DATA names no folder with thor75.mat")
def test_replay_of_a_real_flight_stays_near_the_filter_aboard():
    """University of Minnesota, 360 s in wind, a quarter of it banked above 30 degrees.

    The map of these logs knows the receiver.  Airspeed and course over ground leave 2.58 degrees of inclination RMS
    against the filter aboard, an accelerometer taken at its word 23.
    """
    log = logs.read(Path(os.environ["WINGSLEVEL_DATA"]) / "thor75.mat")
    assert log.rows["gps_new"].sum() == 674
    assert log.repairs == ("1 rows of zeros before the first reading left out, first row 1",)
    dcm = replay(log, "premerlani")
    assert dcm.scores["inclination_rms_deg"] <= 2.6
    assert replay(log, "accelerometer_only").scores["inclination_rms_deg"] >= 15.0
