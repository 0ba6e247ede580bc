"""Metrics on flights made up with known errors; the oracle is SciPy's Rotation and plain arithmetic."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scenarios.harness.metrics import (
    NOTHING,
    Measured,
    after,
    angle_of_attack_deg,
    at,
    attitude_error_deg,
    bank_size_deg,
    end,
    gyro_bias_error_deg_s,
    heading_error_deg,
    height_at_m,
    height_m,
    highest,
    inclination_error_deg,
    launch_distance_at_m,
    lowest,
    mean_size,
    nearest_m,
    orthogonality_error,
    over,
    p95,
    pass_time_s,
    rate_error_deg_s,
    rate_size_deg_s,
    rms,
    settling,
    summary,
    survived,
    wind_error_m_s,
)
from scenarios.harness.metrics.manoeuvres import (
    RollOut,
    loops_end_s,
    most_loops,
    roll_outs,
    slowest_recovery,
    turns_of_pitch,
)
from sim.log import Flight, Log, Outcome, Phase

DT_S = 0.02
HOLD_S = 8.3  # power-up to release of the flights made here
ROUND_OFF_DEG = 1e-9  # of double precision angles in degrees


def attitudes(heading_deg=0.0, pitch_deg=0.0, roll_deg=0.0, n=1):
    """Body-to-earth rotations of Euler angles (scalars or arrays), shape (n, 3, 3), by SciPy."""
    angles = np.stack(np.broadcast_arrays(heading_deg, pitch_deg, roll_deg, np.zeros(n))[:3], axis=1)
    return Rotation.from_euler("ZYX", angles, degrees=True).as_matrix()


def made_up(duration_s=20.0, *, planned_s=None, outcome=Outcome.COMPLETED, reference="course"):
    """A flight northward at 12 m/s and 50 m, attitude and estimate level and north, released at HOLD_S."""
    log = Log.empty(round((HOLD_S + duration_s) / DT_S))
    t_s = (np.arange(len(log)) + 1) * DT_S
    log.truth["t_s"] = t_s
    log.truth["phase"] = np.where(t_s > HOLD_S + DT_S / 2, Phase.FLYING, Phase.HELD)
    log.truth["R_eb"] = np.eye(3)
    log.truth["v_e_m_s"] = (12.0, 0.0, 0.0)
    log.truth["p_e_m"][:, 2] = -50.0
    config = {"duration_s": planned_s or duration_s}
    return Flight(log, DT_S, HOLD_S, outcome, reference, manifest={"config": config})


def since_release_s(flight):
    return flight.log.truth["t_s"] - flight.release_s


@pytest.mark.parametrize("tilt_deg", [1e-5, 3.0, 90.0, 179.0])
def test_inclination_error_of_a_tilted_estimate_is_the_tilt(tilt_deg):
    """A tilt of the estimate about a horizontal axis is entirely inclination error, at any true attitude."""
    flight = made_up(1.0)
    true = Rotation.from_euler("ZYX", (130.0, 20.0, -40.0), degrees=True)
    tilt = Rotation.from_rotvec(np.radians(tilt_deg) * np.array([0.6, 0.8, 0.0]))
    flight.log.truth["R_eb"] = true.as_matrix()
    flight.log.flown["R_eb"] = (tilt * true).as_matrix()
    np.testing.assert_allclose(inclination_error_deg(flight).judged_values, tilt_deg, rtol=0, atol=ROUND_OFF_DEG)
    np.testing.assert_allclose(attitude_error_deg(flight).judged_values, tilt_deg, rtol=0, atol=1e-6)


def test_inclination_error_of_a_heading_error_is_zero():
    """A rotation of the estimate about the vertical is heading and attitude error, and no inclination error."""
    flight = made_up(1.0, reference="nose")
    flight.log.truth["R_eb"] = attitudes(170.0, 10.0, 30.0)
    flight.log.flown["R_eb"] = attitudes(-165.0, 10.0, 30.0)
    np.testing.assert_allclose(inclination_error_deg(flight).judged_values, 0.0, rtol=0, atol=ROUND_OFF_DEG)
    np.testing.assert_allclose(heading_error_deg()(flight).judged_values, 25.0, rtol=0, atol=ROUND_OFF_DEG)
    np.testing.assert_allclose(attitude_error_deg(flight).judged_values, 25.0, rtol=0, atol=1e-6)


def test_heading_error_in_a_crab_is_against_what_the_estimator_names():
    """Nose at 350 degrees, course at 10: an estimate of 12 is 2 degrees off the course and 22 off the nose."""
    course = math.radians(10.0)
    errors = {}
    for reference in ("course", "nose"):
        flight = made_up(1.0, reference=reference)
        flight.log.truth["R_eb"] = attitudes(350.0)
        flight.log.truth["v_e_m_s"] = (12.0 * math.cos(course), 12.0 * math.sin(course), 0.0)
        flight.log.flown["R_eb"] = attitudes(12.0)
        errors[reference] = heading_error_deg()(flight).judged_values[0]
        assert heading_error_deg("nose")(flight).judged_values[0] == pytest.approx(22.0, rel=0, abs=ROUND_OFF_DEG)
    assert errors["course"] == pytest.approx(2.0, rel=0, abs=ROUND_OFF_DEG)
    assert errors["nose"] == pytest.approx(22.0, rel=0, abs=ROUND_OFF_DEG)


def test_heading_error_steep_or_slow_is_not_judged():
    """Heading is not judged above 64 degrees of pitch, nor below 3 m/s over ground."""
    flight = made_up(3.0)
    t_s = since_release_s(flight)
    flight.log.truth["R_eb"] = attitudes(0.0, np.where(t_s > 2.0, 70.0, 60.0), n=len(t_s))
    flight.log.truth["v_e_m_s"][t_s < 1.0, 0] = 2.9
    judged = heading_error_deg()(flight).judged
    np.testing.assert_array_equal(judged, (t_s > 1.0 - DT_S / 2) & (t_s < 2.0 + DT_S / 2))


def test_errors_in_the_hand_are_not_judged():
    """Only errors after the release count."""
    flight = made_up(20.0)
    held = since_release_s(flight) < DT_S / 2
    flight.log.flown["R_eb"][held] = attitudes(0.0, 45.0)
    assert not inclination_error_deg(flight).judged[held].any()
    measured = over(inclination_error_deg, highest)(flight)
    assert measured.value == 0.0
    assert measured.complete


def test_reductions_of_a_sine_are_the_closed_forms():
    """A sine of amplitude A over whole periods: RMS A / sqrt 2, maximum A, 95th percentile A cos(pi / 40) of |sine|."""
    phase = np.linspace(0.0, 2.0 * np.pi, 100_001)
    wave = 7.0 * np.sin(phase)
    # Sampling error of the grid: 1e-4 relative at the very most.
    assert rms(wave) == pytest.approx(7.0 / math.sqrt(2.0), rel=0, abs=1e-3)
    assert highest(wave) == pytest.approx(7.0, rel=0, abs=1e-6)
    assert p95(np.abs(wave)) == pytest.approx(7.0 * math.cos(math.pi / 40.0), rel=0, abs=1e-3)
    assert all(math.isnan(reduce(np.array([]))) for reduce in (rms, highest, lowest, p95))


def test_window_counts_the_ticks_that_end_within_it():
    """From 5 to 10 s at 50 Hz are 250 ticks, and only what happened there counts."""
    flight = made_up(20.0)
    t_s = since_release_s(flight)
    flight.log.flown["R_eb"] = attitudes(0.0, np.where((t_s > 5.01) & (t_s < 10.01), 3.0, 20.0), n=len(t_s))
    measured = over(inclination_error_deg, rms, at(5.0), at(10.0))(flight)
    assert measured.value == pytest.approx(3.0, rel=0, abs=ROUND_OFF_DEG)
    assert measured.samples == 250
    assert measured.complete


def test_window_of_a_flight_that_ended_early_is_incomplete():
    """A value over half a window is incomplete, however good it is."""
    measured = over(inclination_error_deg, rms, at(5.0), end)(made_up(12.0, planned_s=20.0))
    assert measured.value == 0.0
    assert not measured.complete
    assert 2 * measured.samples <= measured.expected


@pytest.mark.parametrize("window", [(at(5.0), at(5.0)), (at(8.0), at(5.0)), (at(math.nan), end)])
def test_window_that_is_empty_measures_nothing(window):
    """An empty window, or one that begins at a moment that never came, measures nothing."""
    measured = over(inclination_error_deg, rms, *window)(made_up(20.0))
    assert math.isnan(measured.value)
    assert not measured.complete


def test_window_judged_too_rarely_is_incomplete():
    """If heading was judged in half of the window, a required share of nine tenths is not met."""
    flight = made_up(20.0)
    flight.log.truth["v_e_m_s"][since_release_s(flight) < 10.0] = 0.0
    assert not over(heading_error_deg(), rms, judged_share=0.9)(flight).complete
    assert over(heading_error_deg(), rms, judged_share=0.4)(flight).complete


def test_settling_time_counts_to_the_last_crossing():
    """An error that dips below the limit and rises again has not settled at the dip."""
    flight = made_up(20.0)
    t_s = since_release_s(flight)
    error = np.where(t_s < 4.0, 30.0, np.where((t_s > 6.0) & (t_s < 7.0), 16.0, 1.0))
    flight.log.flown["R_eb"] = attitudes(error, n=len(t_s))
    measured = settling(heading_error_deg(), 15.0)(flight)
    assert measured.complete
    assert measured.value == pytest.approx(7.0, rel=0, abs=1.5 * DT_S)


@pytest.mark.parametrize(("slow", "expected_s"), [((9.0, 12.0), 4.0), ((0.0, 6.0), 6.0), ((18.0, 99.0), math.nan)])
def test_settling_time_ignores_what_is_not_judged(slow, expected_s):
    """Too slow for a course: no sign of an error; but nothing is settled before it is judged, or by the end."""
    flight = made_up(20.0)
    t_s = since_release_s(flight)
    flight.log.flown["R_eb"] = attitudes(np.where(t_s < 4.0, 30.0, 1.0), n=len(t_s))
    flight.log.truth["v_e_m_s"][(t_s > slow[0]) & (t_s < slow[1])] = 0.0
    value = settling(heading_error_deg("course"), 15.0)(flight).value
    np.testing.assert_allclose(value, expected_s, rtol=0, atol=1.5 * DT_S)


def test_settling_time_of_what_never_settles_is_not_a_number():
    """Above the limit in the last tick: not settled."""
    flight = made_up(20.0)
    flight.log.flown["R_eb"][-1] = attitudes(16.0)[0]
    assert math.isnan(settling(heading_error_deg(), 15.0)(flight).value)


def test_gyro_bias_wind_and_orthogonality_errors_are_the_differences_put_in():
    """Known differences come out in their units; wind is compared with the mean, horizontally."""
    flight = made_up(4.0)
    log, n = flight.log, len(flight.log)
    log.truth["gyro_bias_b_rad_s"] = np.radians((1.0, -2.0, 0.5))
    log.flown["gyro_bias_b_rad_s"] = np.radians((1.0, 1.0, 4.5))
    gusts = np.sin(np.arange(n) * 2.0 * np.pi / n)  # one whole period: mean zero
    log.truth["wind_e_m_s"] = np.stack([3.0 + gusts, -4.0 + 0.0 * gusts, gusts], axis=1)
    log.flown["wind_e_m_s"] = (3.3, -3.6, 9.0)
    log.flown["R_eb"] = np.diag((1.0, 1.0, 1.01))
    np.testing.assert_allclose(gyro_bias_error_deg_s(flight).judged_values, 5.0, rtol=0, atol=ROUND_OFF_DEG)
    np.testing.assert_allclose(wind_error_m_s(flight).judged_values, 0.5, rtol=0, atol=1e-12)
    np.testing.assert_allclose(orthogonality_error(flight).judged_values, 1.01**2 - 1.0, rtol=0, atol=1e-12)


def test_rate_error_of_one_axis_is_estimate_less_truth():
    """-20 deg/s about y estimated as -18.5, with larger errors about x and z: 1.5 deg/s, of a true 20."""
    flight = made_up(2.0)
    flight.log.truth["imu_omega_b_rad_s"] = np.radians([3.0, -20.0, 7.0])
    flight.log.flown["omega_b_rad_s"] = np.radians([30.0, -18.5, -70.0])
    np.testing.assert_allclose(rate_error_deg_s("y")(flight).judged_values, 1.5, rtol=0, atol=ROUND_OFF_DEG)
    np.testing.assert_allclose(rate_size_deg_s("y")(flight).judged_values, 20.0, rtol=0, atol=ROUND_OFF_DEG)


def test_mean_size_lets_noise_cancel_and_forgets_the_sign():
    """-2.5 with +-1 beside it is 2.5; of nothing it is NaN."""
    assert mean_size(np.array([-1.5, -3.5, -2.5])) == 2.5
    assert math.isnan(mean_size(np.empty(0)))


def test_wind_error_where_none_is_estimated_is_not_judged():
    """An estimator without wind is not measured against it."""
    assert len(wind_error_m_s(made_up(2.0)).judged_values) == 0


def test_heights_of_a_climb_are_read_at_their_times():
    """A dip to 1.2 m and a climb of 2 m/s: the lowest point, the height at 20 s, and no height after the end."""
    flight = made_up(20.0)
    t_s = since_release_s(flight)
    flight.log.truth["p_e_m"][:, 2] = -np.maximum(2.0 * t_s, 1.2)
    assert over(height_m, lowest)(flight).value == pytest.approx(1.2, rel=0, abs=1e-12)
    assert height_at_m(20.0)(flight).value == pytest.approx(40.0, rel=0, abs=1e-6)
    assert height_at_m(21.0)(flight) == NOTHING


def test_launch_distance_at_a_time_is_horizontal():
    """30 m north and 40 m east after 10 s, however high."""
    flight = made_up(20.0)
    t_s = since_release_s(flight)
    flight.log.truth["p_e_m"] = np.outer(t_s, (3.0, 4.0, -9.0))
    assert launch_distance_at_m(10.0)(flight).value == pytest.approx(50.0, rel=0, abs=1e-6)
    assert launch_distance_at_m(21.0)(flight) == NOTHING


@pytest.mark.parametrize("roll_deg", [-170.0, -30.0, 30.0, 100.0])
def test_bank_is_the_size_of_the_roll_whatever_pitch_and_heading(roll_deg):
    """And the angle of attack is the plant's, in degrees."""
    flight = made_up(1.0)
    flight.log.truth["R_eb"] = Rotation.from_euler("ZYX", [200.0, -20.0, roll_deg], degrees=True).as_matrix()
    flight.log.truth["alpha_rad"] = math.radians(7.0)
    np.testing.assert_allclose(bank_size_deg(flight).value, abs(roll_deg), rtol=0, atol=1e-9)
    np.testing.assert_allclose(angle_of_attack_deg(flight).value, 7.0, rtol=0, atol=1e-12)


def test_pass_over_the_launch_point_is_timed_and_measured():
    """A pass at 12 m/s and 7 m: the nearest distance, and by Pythagoras the first time within 25 m."""
    flight = made_up(60.0)
    t_s = since_release_s(flight)
    flight.log.truth["p_e_m"][:, 0] = -300.0 + 12.0 * t_s
    flight.log.truth["p_e_m"][:, 1] = 7.0
    first_s = (300.0 - math.sqrt(25.0**2 - 7.0**2)) / 12.0
    assert nearest_m(0.0, 100.0)(flight).value == pytest.approx(7.0, rel=0, abs=(6.0 * DT_S) ** 2 / 14.0 + 1e-9)
    assert pass_time_s(25.0)(flight).value == pytest.approx(first_s, rel=0, abs=DT_S)
    assert nearest_m(0.0, 20.0)(flight).value == pytest.approx(math.hypot(60.0, 7.0), rel=0, abs=1e-6)
    assert math.isnan(pass_time_s(6.9)(flight).value)


def banked(t_s, turns):
    """Bank angle, degrees: ramps of 40 deg/s up to each (begin, end, bank) of `turns` and down from its end."""
    bank = np.zeros_like(t_s)
    for begin_s, end_s, bank_deg in turns:
        ramp = np.clip(40.0 * np.minimum(t_s - begin_s, end_s - t_s), 0.0, abs(bank_deg))
        bank += math.copysign(1.0, bank_deg) * ramp
    return bank


def test_roll_outs_of_three_turns_are_where_the_bank_falls_below_ten():
    """Two long turns to either side count; a short jerk and a shallow turn do not; a bank of 10 is 0.25 s of ramp."""
    flight = made_up(120.0)
    t_s = since_release_s(flight)
    turns = [(10.0, 18.0, 35.0), (40.0, 41.5, 30.0), (60.0, 70.0, -35.0), (90.0, 100.0, 20.0)]
    flight.log.truth["R_eb"] = attitudes(0.0, 5.0, banked(t_s, turns), n=len(t_s))
    found = roll_outs(flight)
    assert len(found) == 2
    np.testing.assert_allclose([r.t_s for r in found], [17.75, 69.75], rtol=0, atol=1.5 * DT_S)
    np.testing.assert_allclose([r.until_s for r in found], [60.25, 120.0], rtol=0, atol=1.5 * DT_S)


def test_roll_outs_of_a_turn_that_never_ends_are_none():
    """A bank held to the end has no roll-out."""
    flight = made_up(30.0)
    t_s = since_release_s(flight)
    flight.log.truth["R_eb"] = attitudes(0.0, 0.0, np.where(t_s > 10.0, 35.0, 0.0), n=len(t_s))
    assert roll_outs(flight) == []


def test_recovery_is_that_of_the_slowest_turn_and_wants_all_of_them():
    """Heading errors that fade after 2 and 5 s: 5 s, of two roll-outs; where three were expected, incomplete."""
    flight = made_up(120.0)
    t_s = since_release_s(flight)
    flight.log.truth["R_eb"] = attitudes(0.0, 0.0, banked(t_s, [(10.0, 18.0, 35.0), (60.0, 70.0, 35.0)]), n=len(t_s))
    (first, second) = roll_outs(flight)
    assert isinstance(first, RollOut)
    off = ((t_s >= first.t_s) & (t_s < first.t_s + 2.0)) | ((t_s >= second.t_s - 8.0) & (t_s < second.t_s + 5.0))
    flight.log.flown["R_eb"] = attitudes(np.where(off, 20.0, 4.0), n=len(t_s))
    measured = slowest_recovery(heading_error_deg(), 10.0, turns=2, within_s=10.0)(flight)
    assert measured.value == pytest.approx(5.0, rel=0, abs=2.5 * DT_S)
    assert measured.complete
    assert not slowest_recovery(heading_error_deg(), 10.0, turns=3, within_s=10.0)(flight).complete


def test_recovery_cut_short_by_the_end_does_not_count():
    """A roll-out 5 s before the end cannot show 10 s of recovery."""
    flight = made_up(25.0)
    t_s = since_release_s(flight)
    flight.log.truth["R_eb"] = attitudes(0.0, 0.0, banked(t_s, [(10.0, 20.0, 35.0)]), n=len(t_s))
    assert slowest_recovery(heading_error_deg(), 10.0, turns=1, within_s=10.0)(flight).samples == 0


def looping(pitch_deg, heading_deg=0.0, roll_deg=0.0):
    """A flight whose pitch angle goes on beyond the vertical, by SciPy, in a plane of any heading."""
    flight = made_up(len(pitch_deg) * DT_S)
    pitch = np.concatenate([np.zeros(len(flight.log) - len(pitch_deg)), pitch_deg])
    flight.log.truth["R_eb"] = attitudes(heading_deg, pitch, roll_deg, n=len(pitch))
    return flight


def test_loops_flown_are_counted_and_timed():
    """1080 degrees at 110 deg/s from 5 s on: three loops, the third ended 20 degrees short of that."""
    t_s = np.arange(1, 1001) * DT_S
    flight = looping(np.clip(110.0 * (t_s - 5.0), 0.0, 1080.0), heading_deg=200.0)
    assert most_loops(flight).value == pytest.approx(3.0, rel=0, abs=1e-9)
    assert loops_end_s(3)(flight) == pytest.approx(5.0 + 1060.0 / 110.0, rel=0, abs=1.01 * DT_S)
    assert after(loops_end_s(3), 10.0)(flight) == loops_end_s(3)(flight) + 10.0


def test_loops_that_were_not_flown_never_end():
    """Two loops are not three; dives, rolls and outside loops do not count."""
    t_s = np.arange(1, 1001) * DT_S
    assert math.isnan(loops_end_s(3)(looping(np.clip(110.0 * t_s, 0.0, 720.0))))
    assert most_loops(looping(-np.clip(110.0 * t_s, 0.0, 360.0))).value == pytest.approx(0.0, rel=0, abs=1e-9)
    rolls = looping(np.zeros(1000), roll_deg=np.linspace(0.0, 720.0, round((HOLD_S + 20.0) / DT_S)))
    np.testing.assert_allclose(turns_of_pitch(rolls), 0.0, rtol=0, atol=1e-9)


@pytest.mark.parametrize("outcome", list(Outcome))
def test_survived_is_only_a_flight_that_was_completed(outcome):
    """Every other outcome is 0."""
    assert survived(made_up(1.0, outcome=outcome)) == Measured(1.0 if outcome == Outcome.COMPLETED else 0.0)


def test_summary_is_plain_and_finite_or_none():
    """The metrics of a flight carry their units and can be written as JSON, even of a flight without a tick."""
    whole = summary(made_up(20.0))
    assert whole["inclination_rms_deg"] == 0.0
    assert whole["wind_error_rms_m_s"] is None
    assert whole["height_min_m"] == 50.0
    assert whole["flown_s"] == pytest.approx(20.0, rel=0, abs=1e-6)
    nothing = summary(Flight(Log.empty(0), DT_S, 0.0, Outcome.DIVERGED, "course"))
    assert set(nothing) == set(whole)
    assert all(value is None for value in nothing.values())


@pytest.mark.parametrize(("reference", "off_deg"), [("course", 12.0), ("nose", 22.0)])
def test_summary_heading_is_against_what_the_estimator_names(reference, off_deg):
    """North over the ground, nose at 350 degrees, estimate at 12: the error of the estimator's own reference."""
    flight = made_up(1.0, reference=reference)
    flight.log.truth["R_eb"], flight.log.flown["R_eb"] = attitudes(350.0), attitudes(12.0)
    numbers = summary(flight)
    assert numbers["heading_rms_deg"] == pytest.approx(off_deg, rel=0, abs=ROUND_OFF_DEG)
    assert numbers[f"heading_against_{reference}_rms_deg"] == numbers["heading_rms_deg"]
