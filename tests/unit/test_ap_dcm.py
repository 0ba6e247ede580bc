"""`ap_dcm` on prescribed motion: what each option and each quirk does, and that nothing takes it off the rotations."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.ap_dcm import JULY_2013, STATE_DTYPE, ApDcm, ApDcm2013, ApDcmParams, Quirk, spin_gain
from estimator.ap_dcm.wind import learn_wind
from estimator.compiler.jit import kernel
from estimator.interface import MEASURED_DTYPE, Health, ImuSample, Measurements
from estimator.rotation import heading_error_rad, heading_rad, inclination_error_rad
from scenarios.harness.equipping import equipped
from scenarios.harness.replay import make

G_M_S2 = 9.80665
DECLINATION_RAD = math.radians(8.0)


def fly(euler_rad, v_e_m_s, *, hz=50, gps_every=10, wind_e_m_s=(0.0, 0.0, 0.0), compass=False, airspeed_m_s=None):
    """Rows and true attitudes of a motion through moving air, by ideal sensors.

    euler_rad : shape (n + 1, 3), yaw, pitch, roll at the ends of the ticks      v_e_m_s : the same of air velocity
    """
    n = len(euler_rad) - 1
    attitude = Rotation.from_euler("ZYX", euler_rad)
    v_e = np.asarray(v_e_m_s) + wind_e_m_s
    rows = np.zeros(n, MEASURED_DTYPE)
    rows["dt_s"] = 1.0 / hz
    rows["t_s"] = np.arange(1, n + 1) / hz
    rows["gyro_b_rad_s"] = (attitude[:-1].inv() * attitude[1:]).as_rotvec() * hz
    force_e = np.diff(v_e, axis=0) * hz - [0.0, 0.0, G_M_S2]
    rows["force_b_m_s2"] = attitude[1:].inv().apply(force_e)
    if gps_every:
        rows["gps_new"][gps_every - 1 :: gps_every] = 1
        rows["gps_valid"][gps_every - 1 :] = 1
        rows["gps_v_e_m_s"] = v_e[1:]
        rows["gps_speed_m_s"] = np.hypot(v_e[1:, 0], v_e[1:, 1])
        rows["gps_course_rad"] = np.arctan2(v_e[1:, 1], v_e[1:, 0]) % (2.0 * np.pi)
    if compass:
        rows["mag_new"][4::5] = 1
        field_e = [20.0 * np.cos(DECLINATION_RAD), 20.0 * np.sin(DECLINATION_RAD), 44.0]
        rows["mag_b_ut"] = attitude[1:].inv().apply(field_e)
    if airspeed_m_s is not None:
        rows["air_new"], rows["equivalent_airspeed_m_s"] = 1, airspeed_m_s
    return rows, attitude[1:].as_matrix()


def turning(seconds, *, speed_m_s=15.0, **options):
    """A coordinated level turn at 45 degrees of bank, from north, through `fly`."""
    bank_rad = math.radians(45.0)
    t_s = np.arange(seconds * 50 + 1) / 50
    yaw = G_M_S2 * math.tan(bank_rad) / speed_m_s * t_s
    v_e = speed_m_s * np.stack([np.cos(yaw), np.sin(yaw), 0.0 * yaw], axis=1)
    return fly(np.stack([yaw, 0.0 * yaw, 0.0 * yaw + bank_rad], axis=1), v_e, **options)


def straight(seconds, *, speed_m_s=15.0, heading_rad=0.0, hz=50, **options):
    """Straight level flight, through `fly`."""
    n = round(seconds * hz) + 1
    v_e = speed_m_s * np.array([np.cos(heading_rad), np.sin(heading_rad), 0.0])
    return fly(np.tile([heading_rad, 0.0, 0.0], (n, 1)), np.tile(v_e, (n, 1)), hz=hz, **options)


def run(rows, *quirks, **options):
    """Estimates of a fresh estimator over `rows`."""
    return ApDcm(ApDcmParams(quirks=frozenset(quirks), declination_rad=DECLINATION_RAD, **options)).replay(rows)


@pytest.mark.parametrize("wind_e_m_s", [(0.0, 0.0, 0.0), (4.0, -3.0, 0.0)])
def test_turn_in_wind_is_no_tilt(wind_e_m_s):
    """The change of GPS velocity is the acceleration of the aeroplane, wind or not: tilt stays right in a long turn."""
    rows, truth = turning(60, wind_e_m_s=wind_e_m_s, compass=True)
    tilt = np.degrees(inclination_error_rad(run(rows)["R_eb"], truth))
    assert tilt[1500:].max() < 0.5  # from 45 degrees at the start; 0.2 s of turn is a chord, not an arc
    heading = np.degrees(np.abs(heading_error_rad(run(rows)["R_eb"], truth)))
    assert heading[1500:].max() < 1.0


def test_wind_is_learnt_in_turns():
    """Two turns tell a steady wind of 5 m/s to half a metre a second; before the first there is none to tell."""
    rows, _ = turning(60, wind_e_m_s=(4.0, -3.0, 0.0), compass=True)
    wind = run(rows)["wind_e_m_s"]
    assert np.all(np.isnan(wind[0]))
    np.testing.assert_allclose(wind[-1], [4.0, -3.0, 0.0], rtol=0, atol=0.5)
    assert np.all(np.isnan(run(rows, estimate_wind=False)["wind_e_m_s"]))


@kernel
def call_learn_wind(state):
    learn_wind(state[0])


@pytest.mark.parametrize("from_deg", range(0, 360, 45))
@pytest.mark.parametrize("yaw_error_deg", [-50.0, 0.0, 20.0])
def test_wind_from_any_direction_is_found_whatever_the_error_of_yaw(from_deg, yaw_error_deg):
    """Two velocities and noses 70 degrees apart tell wind, speed and error of yaw; a twentieth is taken each time."""
    wind = np.array([-6.0 * math.cos(math.radians(from_deg)), -6.0 * math.sin(math.radians(from_deg)), 0.3])
    state = ApDcm().snapshot()
    for pair in range(81):
        attitude = Rotation.from_euler("ZYX", [-70.0 * pair, 8.0, 30.0], degrees=True).as_matrix()
        state["R_eb"] = Rotation.from_euler("z", yaw_error_deg, degrees=True).as_matrix() @ attitude
        state["v_e_m_s"] = 13.0 * attitude[:, 0] + wind
        state["clock_s"] = 20.0 + 2.0 * pair
        call_learn_wind(state)
    np.testing.assert_allclose(state["wind_e_m_s"][0], wind * (1.0 - 0.95**80), rtol=0, atol=1e-12)


def test_wind_is_learnt_straight_with_an_airspeed_sensor():
    """The velocity less airspeed along the nose, 8 % a fix, two seconds in ten: known to 5 % after a minute."""
    rows, _ = straight(60, wind_e_m_s=(3.0, 1.0, 0.0), compass=True, airspeed_m_s=15.0)
    np.testing.assert_allclose(run(rows)["wind_e_m_s"][-1], [3.0, 1.0, 0.0], rtol=0, atol=0.15)
    without, _ = straight(60, wind_e_m_s=(3.0, 1.0, 0.0), compass=True)
    assert np.all(np.isnan(run(without)["wind_e_m_s"]))


@pytest.mark.parametrize("compass", [False, True])
def test_heading_is_found_from_course_or_compass(compass):
    """Flying at 250 degrees in still air: the first fix or the first magnetometer sample sets the heading."""
    rows, truth = straight(5, heading_rad=math.radians(250.0), compass=compass)
    estimates = run(rows)
    assert np.degrees(np.abs(heading_error_rad(estimates["R_eb"][20:], truth[20:]))).max() < 0.1
    assert estimates["health"][0] == Health.STARTING
    assert np.all(estimates["health"][20:] == Health.GOOD)


def test_declination_turns_the_compass():
    """A heading by compass that takes no account of 8 degrees of declination is 8 degrees short."""
    rows, truth = straight(10, compass=True, gps_every=0)
    params = ApDcmParams(fly_forward=False)
    error = heading_error_rad(ApDcm(params).replay(rows)["R_eb"][-1], truth[-1])
    assert np.degrees(error) == pytest.approx(-8.0, rel=0, abs=0.01)
    assert heading_error_rad(run(rows, fly_forward=False)["R_eb"][-1], truth[-1]) == pytest.approx(0.0, abs=1e-6)


def test_use_magnetometer_off_takes_the_course():
    """In 4 m/s of crosswind nose and course are 15 degrees apart; without compass the heading is the course."""
    rows, truth = straight(20, wind_e_m_s=(0.0, 4.0, 0.0), compass=True)
    crab = np.degrees(np.arctan2(4.0, 15.0))
    by_compass = heading_error_rad(run(rows)["R_eb"][-1], truth[-1])
    by_course = heading_error_rad(run(rows, use_magnetometer=False)["R_eb"][-1], truth[-1])
    assert np.degrees(by_compass) == pytest.approx(0.0, abs=0.5)
    assert np.degrees(by_course) == pytest.approx(crab, abs=0.5)


@pytest.mark.parametrize(("fitted", "reference"), [(True, "nose"), (False, "course"), (None, "course")])
@pytest.mark.parametrize("cls", [ApDcm, ApDcm2013])
def test_heading_reference_is_the_nose_where_a_magnetometer_is_known_to_be_fitted(cls, fitted, reference):
    """It is judged by it: by the nose with a compass, by the course without one and where nobody knows."""
    assert cls(replace(cls().params, use_magnetometer=fitted)).heading_reference == reference


@pytest.mark.parametrize("value", [0.0, False, 1.0, True])
def test_use_magnetometer_as_a_record_or_a_command_line_has_it(value):
    """Numbers for truth values: what is known of the instruments comes from files as well."""
    estimator = equipped("ap_dcm", settings={"use_magnetometer": value}).code
    assert estimator.params.use_magnetometer is bool(value)
    assert estimator.snapshot()["use_magnetometer"][0] == int(value)


def test_without_gps_tilt_comes_back_with_the_gain():
    """Started 20 degrees off, at rest, the tilt falls at the rate kp, a delay of 0.2 s allowed for."""
    rows, truth = fly(np.tile([0.0, 0.0, math.radians(20.0)], (1501, 1)), np.zeros((1501, 3)), gps_every=0)
    tilt = inclination_error_rad(run(rows, ki=0.0)["R_eb"], truth)
    fall_hz = math.log(tilt[200] / tilt[500]) / 6.0
    # The mean over one 0.2 s acts through the next: de/dt = -kp e(t - 0.2 s) falls at the rate a = kp exp(0.2 s a).
    assert fall_hz == pytest.approx(0.3 * math.exp(0.2 * fall_hz), rel=0.01)


def test_offset_is_learnt_no_faster_than_a_gyro_drifts():
    """1 deg/s of offset, all at once: the integral takes 0.042 deg/s in every five seconds and a fifth, no more."""
    rows, _ = straight(60, compass=True)
    rows["gyro_b_rad_s"][:, 1] += math.radians(1.0)
    bias_deg_s = np.degrees(run(rows)["gyro_bias_b_rad_s"][:, 1])
    steps = np.diff(bias_deg_s)[np.diff(bias_deg_s) != 0.0]
    assert len(steps) == 11
    np.testing.assert_allclose(steps, 0.5 / 60.0 * 5.2, rtol=0.05, atol=0)


def test_gps_gain_zero_believes_no_acceleration():
    """Without the GPS the accelerometer takes a 45 degree turn for level flight, wings drawn to the apparent down."""
    rows, truth = turning(60, compass=True)
    tilt = np.degrees(inclination_error_rad(run(rows, gps_gain=0.0)["R_eb"], truth))
    assert tilt[-500:].max() > 10.0


def test_spin_gain_grows_as_fast_rotations_wants_or_is_stuck():
    """One to 50 deg/s, two at 100, ten from 500 on; the original's is one at any rate a gyro can measure."""
    state = np.zeros(1, STATE_DTYPE)[0]
    for stuck, wanted in ((0, [1.0, 1.0, 2.0, 10.0, 10.0]), (1, [1.0] * 5)):
        state["stuck_p_gain"] = stuck
        gains = []
        for rate_deg_s in (0.0, 50.0, 100.0, 500.0, 2000.0):
            state["spin_rad_s"] = math.radians(rate_deg_s)
            gains.append(spin_gain(state))
        np.testing.assert_allclose(gains, wanted, rtol=1e-12, atol=0)


def corrected(forward_m_s2, speed_m_s, pitch_deg, fly_forward=True):
    """Proportional correction after two fixes of a steady velocity, pushed forward with that specific force."""
    rows = np.zeros(11, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = 0.02 * np.arange(1, 12), 0.02
    rows["force_b_m_s2"] = [forward_m_s2, 0.0, -9.8]
    rows["gps_new"][[0, 10]], rows["gps_valid"] = 1, 1
    rows["gps_v_e_m_s"], rows["gps_speed_m_s"] = [speed_m_s, 0.0, 0.0], speed_m_s
    estimator = ApDcm(ApDcmParams(fly_forward=fly_forward))
    state = estimator.snapshot()
    attitude = Rotation.from_euler("ZYX", [0.0, pitch_deg, 0.0], degrees=True)
    state["R_eb"] = state["R_euler_eb"] = attitude.as_matrix()
    estimator.restore(state)
    estimator.replay(rows)
    return estimator.snapshot()["omega_p_b"][0, 1]


@pytest.mark.parametrize(
    ("forward_m_s2", "speed_m_s", "pitch_deg", "fly_forward", "part"),
    [
        (9.0, 1.0, 10.0, True, 0.5), (9.0, 1.0, -20.0, True, 0.5),
        (9.0, 5.0, 10.0, True, 1.0), (5.0, 1.0, 10.0, True, 1.0), (9.0, 1.0, 45.0, True, 1.0),
        (9.0, 1.0, -45.0, True, 1.0), (9.0, 1.0, 10.0, False, 1.0),
    ],
)  # fmt: skip
def test_throw_halves_the_correction_of_an_aeroplane_that_is_slow(
    forward_m_s2, speed_m_s, pitch_deg, fly_forward, part
):
    """Pushed by 7 m/s^2 or more, below 3 m/s, within 30 degrees of pitch: half of what the sine of the error asks."""
    tilt = math.atan2(forward_m_s2, 9.8) - math.radians(pitch_deg)
    expected = part * ApDcmParams().kp * math.sin(tilt)
    assert corrected(forward_m_s2, speed_m_s, pitch_deg, fly_forward) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("quirks", [(), (Quirk.DECAY_PER_SAMPLE,)])
def test_yaw_term_fades_the_same_at_any_sample_rate_unless_the_quirk(quirks):
    """In the second after a fix the proportional yaw term fades by 0.97^50; per sample, four times that at 200 Hz."""
    left = {}
    for hz in (50, 200):
        rows, _ = straight(3, heading_rad=0.3, hz=hz, gps_every=hz)
        rows["gps_course_rad"][hz:] += 0.2
        estimator = ApDcm(ApDcmParams(quirks=frozenset(quirks)))
        estimator.replay(rows[: 2 * hz])
        at_fix = estimator.snapshot()["omega_yaw_p"][0]
        estimator.replay(rows[2 * hz : 3 * hz - 1])
        left[hz] = math.log(estimator.snapshot()["omega_yaw_p"][0] / at_fix) / math.log(0.97)
    assert left[50] == pytest.approx(49.0, abs=1e-6)
    assert left[200] == pytest.approx(199.0 if quirks else 49.75, abs=1e-6)


@pytest.mark.parametrize(("quirks", "waits"), [((), True), ((Quirk.HASTY_COMPASS,), False)])
def test_compass_off_the_course_is_dropped_after_two_seconds(quirks, waits):
    """A course 60 degrees off the nose for 1.5 s, a bad fix or two: the heading stays, or jumps to it as in 2013."""
    rows, _ = straight(20, wind_e_m_s=(0.0, 6.0, 0.0), compass=True)
    rows["gps_course_rad"][500:575] += math.radians(40.0)  # on top of 22 of crab
    heading = np.degrees(heading_rad(run(rows, *quirks)["R_eb"][500:575]))
    assert (np.abs(heading).max() < 5.0) == waits


@pytest.mark.parametrize(("quirks", "jumps"), [((), False), ((Quirk.COMPASS_IS_NO_YAW,), True)])
def test_course_after_long_use_of_the_compass(quirks, jumps):
    """30 s by compass, then it breaks: the crab of 22 degrees is drawn in slowly, or at once by the original."""
    rows, _ = straight(31, wind_e_m_s=(0.0, 6.0, 0.0), compass=True)
    rows["mag_new"][1500:] = 0
    heading = np.degrees(heading_rad(run(rows, *quirks)["R_eb"]))
    assert (np.abs(np.diff(heading)).max() > 15.0) == jumps


def test_replay_equals_streaming_and_snapshot_goes_on():
    """Bit for bit, the original and the mended, with GPS, compass and airspeed."""
    rows, _ = turning(20, wind_e_m_s=(2.0, 1.0, 0.0), compass=True, airspeed_m_s=15.0)
    for quirks in (frozenset(), JULY_2013):
        params = ApDcmParams(quirks=quirks, gps_delay_fixes=2)
        whole = ApDcm(params).replay(rows)
        streaming = ApDcm(params)
        for k in range(500):
            estimate = streaming.update(Measurements(rows, k))
            np.testing.assert_array_equal(estimate.R_eb, whole["R_eb"][k])
        other = ApDcm()
        other.restore(streaming.snapshot())
        np.testing.assert_array_equal(other.replay(rows[500:])["R_eb"], whole["R_eb"][500:])


def test_reset_without_a_sample_is_level_north_and_with_one_as_it_lies():
    """`reset(None)` begins as the original did, R = I; a mean sample gives tilt and gyro offset."""
    estimator = ApDcm()
    estimator.replay(turning(5)[0])
    estimator.reset()
    np.testing.assert_array_equal(estimator.snapshot()["R_eb"][0], np.eye(3))
    attitude = Rotation.from_euler("ZYX", [0.0, 0.2, -0.1])
    force = attitude.inv().apply([0.0, 0.0, -G_M_S2])
    estimator.reset(ImuSample(2.0, 0.02, np.array([0.01, -0.02, 0.03]), force))
    np.testing.assert_allclose(estimator.snapshot()["R_eb"][0], attitude.as_matrix(), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(estimator.snapshot()["gyro_bias_b_rad_s"][0], [0.01, -0.02, 0.03])


@pytest.mark.parametrize("quirks", [frozenset(), JULY_2013])
def test_nothing_takes_it_off_the_rotations(quirks):
    """Noise up to the range of any sensor, NaN and infinity in every column, gaps: a finite rotation all the same."""
    rng = np.random.default_rng(8)
    n = 5000
    rows = np.zeros(n, MEASURED_DTYPE)
    rows["dt_s"] = rng.choice([0.005, 0.02, 0.1, 0.3], n)
    rows["t_s"] = np.cumsum(rows["dt_s"])
    for name in rows.dtype.names[2:]:
        column = rows[name]
        if name.endswith(("_new", "_valid")):
            column[:] = rng.integers(0, 2, n)
        else:
            column[:] = rng.normal(0.0, 10.0 ** rng.uniform(-2.0, 3.0, (n,) + (1,) * (column.ndim - 1)), column.shape)
            column[rng.random(n) < 0.02] = rng.choice([np.nan, np.inf, -np.inf])
    estimates = ApDcm(ApDcmParams(quirks=quirks, gps_delay_fixes=3)).replay(rows)
    R = estimates["R_eb"]
    assert np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max() < 1e-3
    assert np.linalg.det(R).min() > 0.0
    for name in ("omega_b_rad_s", "gyro_bias_b_rad_s"):
        assert np.all(np.isfinite(estimates[name]))


@pytest.mark.parametrize("spoilt", ["omega_i_b", "omega_p_b", "omega_sum_b", "omega_yaw_p", "R_eb", "R_euler_eb"])
def test_number_that_is_none_in_a_correction_is_gone_with_the_next_sample(spoilt):
    """NaN in the state, however it got there: the attitude of before, no corrections, and the flight goes on."""
    rows, _ = turning(20)
    estimator = ApDcm()
    estimator.replay(rows[:500])
    broken = estimator.snapshot()
    before = broken["R_eb"][0].copy()
    broken[spoilt] = np.nan
    estimator.restore(broken)
    estimates = estimator.replay(rows[500:])
    for name in ("R_eb", "omega_b_rad_s", "gyro_bias_b_rad_s"):
        assert np.all(np.isfinite(estimates[name])), name
    assert np.degrees(inclination_error_rad(estimates["R_eb"][0], before)) < 1.0  # no more than a tick of the turn


def test_lost_samples_of_the_accelerometer_do_not_tilt():
    """Every third sample lost in a turn: the mean is over those that came, and so the tilt stays right."""
    rows, truth = turning(60, compass=True)
    rows["force_b_m_s2"][::3] = np.nan
    tilt = np.degrees(inclination_error_rad(run(rows)["R_eb"], truth))
    assert tilt[1500:].max() < 1.0


def test_quirks_can_be_typed_and_the_original_takes_settings():
    """As on the command line, ``--set quirks=...``; what `ap_dcm_2013` is told nothing of stays as it was."""
    assert ApDcmParams(quirks="vertical_clip, stuck_p_gain").quirks == {Quirk.VERTICAL_CLIP, Quirk.STUCK_P_GAIN}
    assert ApDcmParams(quirks="JULY_2013").quirks == JULY_2013
    assert ApDcmParams(quirks="").quirks == frozenset()
    assert ApDcm2013().params == ApDcmParams(quirks=JULY_2013)
    assert make("ap_dcm_2013", {"kp": "0.2"}).code.params == ApDcmParams(quirks=JULY_2013, kp=0.2)
    assert make("ap_dcm", {"quirks": "vertical_clip"}).code.params.quirks == {Quirk.VERTICAL_CLIP}


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ({"quirks": "vertical_clip,typo"}, "quirks has 'typo'"),
        ({"quirks": frozenset({"typo"})}, "quirks has 'typo'; choose from compass_is_no_yaw, "),
        ({"kp": -0.1}, "kp is -0.1; it must be a finite number, zero or more"),
        ({"ki_yaw": math.inf}, "ki_yaw is inf"),
        ({"gps_gain": 1.5}, "gps_gain is 1.5; it must be 0 to 1"),
        ({"gps_delay_fixes": 6}, "gps_delay_fixes is 6; it must be a whole number, 0 to 5"),
        ({"declination_rad": 10.0}, "declination_rad is 10.0 rad; it must be -pi to pi"),
        ({"gyro_range_rad_s": 0.0}, "gyro_range_rad_s is 0.0; it must be more than zero"),
    ],
)
def test_settings_that_make_no_sense_are_refused(setting, said):
    """One line that names the setting, its value, and what would be right."""
    with pytest.raises(ValueError, match=said) as error:
        ApDcmParams(**setting)
    assert "\n" not in str(error.value)
