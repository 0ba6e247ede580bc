"""The magnetometer: every effect alone against its closed form, and arrival to the tick."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from sim import place
from sim.clock import Rates
from sim.log import Log
from sim.magnetic_field import field_e_ut
from sim.sensors.air_data import AirspeedParams, BarometerParams
from sim.sensors.magnetometer import MagnetometerParams
from sim.sensors.suite import Suite, SuiteParams

FIELD = field_e_ut(place.LATITUDE_DEG, place.LONGITUDE_DEG, place.ELEVATION_M, place.YEAR)
STRENGTH = float(np.linalg.norm(FIELD))
DOUBTED_ONCE_IN = 1e-5
STEP = 100.0 / 1300.0  # 1300 counts per gauss


def log_of(R_eb, rpm=0.0, rates=None):
    """A log whose body has these attitudes, shape (n, 3, 3), and propeller speeds."""
    log = Log.empty(len(R_eb))
    log.truth["t_s"] = np.arange(1, len(log) + 1) * (rates or Rates()).dt_s
    log.truth["R_eb"], log.truth["rotor_rpm"] = R_eb, rpm
    return log


def sensed(params, R_eb, rpm=0.0, rates=None, seed=0, flight=0):
    """Measured rows of that flight."""
    log = log_of(R_eb, rpm, rates)
    suite = Suite(SuiteParams(magnetometer=params), rates or Rates(), seed, flight)
    suite.reset(log)
    for k in range(len(log)):
        suite.measure(k)
    return log.measured


def samples(params, R_eb, rpm=0.0, **kw):
    """The samples that arrived, shape (m, 3)."""
    rows = sensed(params, R_eb, rpm, **kw)
    return rows["mag_b_ut"][rows["mag_new"] == 1]


def level(n=50):
    """Level, nose to the north, for `n` ticks."""
    return np.tile(np.eye(3), (n, 1, 1))


def attitudes(n=20, ticks=5, seed=1):
    """`n` attitudes, each held for the 5 ticks between two samples of 10 Hz."""
    return np.repeat(Rotation.random(n, rng=np.random.default_rng(seed)).as_matrix(), ticks, axis=0)


def assert_sigma(values, sigma):
    """`values` are normal with zero mean and `sigma`: the sum of squares is within its chi-square bounds."""
    low, high = stats.chi2.ppf([DOUBTED_ONCE_IN / 2, 1 - DOUBTED_ONCE_IN / 2], np.size(values))
    assert low <= np.sum(np.square(values)) / sigma**2 <= high


def matrix_of(params, seed=0, flight=0):
    """The matrix that takes the field to readings, fitted to 20 attitudes."""
    R_eb = attitudes()
    b = np.einsum("nij,i->nj", R_eb[::5], FIELD)
    return np.linalg.lstsq(b, samples(params, R_eb, seed=seed, flight=flight), rcond=None)[0].T


def test_perfect_magnetometer_reads_the_field_in_body_axes():
    """At any attitude R^T b, to round-off; level to the north the field itself."""
    R_eb = attitudes()
    expected = np.einsum("nij,i->nj", R_eb[::5], FIELD)
    np.testing.assert_allclose(samples(MagnetometerParams(), R_eb), expected, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(samples(MagnetometerParams(), level())[0], FIELD)


@pytest.mark.parametrize(
    ("physics_hz", "imu_hz", "rate_hz"),
    [(200, 50, 8), (200, 50, 10), (200, 50, 50), (200, 40, 8), (400, 100, 8), (1000, 50, 8),
     (200, 200, 2.5), (100, 50, 10)],
)  # fmt: skip
@pytest.mark.parametrize("latency_s", ["0", "0.005", "0.02", "0.123", "0.5"])
def test_samples_arrive_exactly_a_latency_after_they_were_true(physics_hz, imu_hz, rate_hz, latency_s):
    """Sample j, of the time j / rate, is in the first tick that ends at or after that and the latency, and in no other.

    The body turns steadily about the vertical, so that a sample holds its own time.  8 Hz falls between ticks.
    """
    rates, n, yaw_rate = Rates(physics_hz, imu_hz), 3 * imu_hz, 0.7
    yaw = yaw_rate * np.arange(1, n + 1) / imu_hz
    R_eb = Rotation.from_euler("z", yaw[:, None]).as_matrix()
    rows = sensed(MagnetometerParams(rate_hz=rate_hz, latency_s=float(latency_s)), R_eb, rates=rates)
    due, j = {}, 1
    while True:
        true_at = j / Fraction(str(rate_hz))
        tick = math.ceil((true_at + Fraction(latency_s)) * imu_hz) - 1
        if tick >= n:
            break
        due[tick] = float(true_at)
        j += 1
    assert len(due) >= 5
    np.testing.assert_array_equal(np.flatnonzero(rows["mag_new"]), list(due))
    then = Rotation.from_euler("z", yaw_rate * np.array(list(due.values()))[:, None]).as_matrix()
    # Interpolated between two ticks: short by an eighth of the squared angle, of the horizontal field.
    between = np.hypot(*FIELD[:2]) * (yaw_rate / imu_hz) ** 2 / 8.0
    expected = np.einsum("nij,i->nj", then, FIELD)
    np.testing.assert_allclose(rows["mag_b_ut"][list(due)], expected, rtol=0, atol=between + 1e-12)


def test_reading_is_held_between_samples_and_zero_before_the_first():
    """It changes in ticks with a new sample alone."""
    rows = sensed(MagnetometerParams(rate_hz=8.0, latency_s=0.1), Rotation.random(200, rng=2).as_matrix())
    first = np.flatnonzero(rows["mag_new"])[0]
    np.testing.assert_array_equal(rows["mag_b_ut"][:first], 0.0)
    old = np.flatnonzero(rows["mag_new"][first + 1 :] == 0) + first + 1
    np.testing.assert_array_equal(rows["mag_b_ut"][old], rows["mag_b_ut"][old - 1])
    assert rows["mag_new"].sum() == 31  # 4 s: the sample of 4.0 s is still under way


@pytest.mark.parametrize(
    ("rate_hz", "rates", "said"),
    [
        (3.0, Rates(), "magnetometer rate 3 Hz: .* 200 Hz .* 1, 2, 2.5, 4, 5, 8, 10, 12.5, 20, 25, 40, 50 Hz"),
        (8.0, Rates(100, 50), "magnetometer rate 8 Hz: .* 100 Hz .* 1, 2, 2.5, 4, 5, 10, "),
        (100.0, Rates(), "magnetometer rate 100 Hz: .* at most the inertial rate"),
    ],
)
def test_rate_that_does_not_divide_is_refused_with_those_that_do(rate_hz, rates, said):
    """Before the flight, with the physics rate and what would do."""
    with pytest.raises(ValueError, match=said):
        Suite(SuiteParams(magnetometer=MagnetometerParams(rate_hz=rate_hz)), rates, 0)


def test_hard_iron_turns_with_the_body():
    """A fixed vector in body axes on every reading, whatever the attitude."""
    R_eb, hard = attitudes(), (12.0, -7.0, 20.0)
    added = samples(MagnetometerParams(hard_iron_b_ut=hard), R_eb) - samples(MagnetometerParams(), R_eb)
    np.testing.assert_allclose(added, np.tile(hard, (20, 1)), rtol=0, atol=1e-12)


def test_hard_iron_is_drawn_for_each_flight_with_its_sigma():
    """Constant in a flight, normal over flights and axes."""
    drawn = []
    for flight in range(200):
        added = samples(MagnetometerParams(hard_iron_ut=10.0), level(10), flight=flight) - FIELD
        np.testing.assert_array_equal(added[0], added[1])
        drawn.append(added[0])
    assert_sigma(drawn, 10.0)


def test_soft_iron_is_a_symmetric_matrix_on_the_field():
    """Readings are S b with S = S^T; each element is off the identity by the sigma, over flights."""
    drawn = []
    for flight in range(200):
        S = matrix_of(MagnetometerParams(soft_iron=0.05), flight=flight)
        np.testing.assert_allclose(S, S.T, rtol=0, atol=1e-12)
        drawn.append((S - np.eye(3))[np.tril_indices(3)])
    assert_sigma(drawn, 0.05)


def test_gains_and_cross_axes_are_drawn_with_their_sigmas():
    """The diagonal of the matrix is off 1 by the gain's sigma, the rest is the cross axes."""
    matrices = [matrix_of(MagnetometerParams(gain=0.03, cross_axis=0.01), flight=i) for i in range(200)]
    off = np.array(matrices) - np.eye(3)
    assert_sigma(off[:, np.arange(3), np.arange(3)], 0.03)
    assert_sigma(off[:, ~np.eye(3, dtype=bool)], 0.01)


def test_mounting_turns_the_part_in_the_body():
    """Readings are in the part's axes: yaw, then pitch, then roll from the body's (SciPy)."""
    M = matrix_of(MagnetometerParams(mounting_deg=(3.0, -5.0, 90.0)))
    R_bs = Rotation.from_euler("ZYX", [90.0, -5.0, 3.0], degrees=True).as_matrix()
    np.testing.assert_allclose(M, R_bs.T, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("rpm", "share"), [(0.0, 0.0), (3000.0, 0.25), (6000.0, 1.0), (9000.0, 2.25)])
def test_motor_field_grows_with_the_square_of_the_propeller_speed(rpm, share):
    """Its current does, with the torque: a quarter of the field at half the speed, also beyond full."""
    motor = np.array([4.0, -2.0, 6.0])
    params = MagnetometerParams(motor_b_ut=tuple(motor), motor_rpm=6000.0)
    np.testing.assert_allclose(samples(params, level(), rpm)[0] - FIELD, share * motor, rtol=0, atol=1e-12)


def test_effects_together_follow_the_equation_of_the_module():
    """Mounting over the sum of field, hard iron and motor field."""
    R_eb, hard, motor = attitudes(), np.array([12.0, -7.0, 20.0]), np.array([4.0, -2.0, 6.0])
    params = MagnetometerParams(
        hard_iron_b_ut=tuple(hard), motor_b_ut=tuple(motor), motor_rpm=5000.0, mounting_deg=(0.0, 0.0, 30.0)
    )
    R_bs = Rotation.from_euler("z", 30.0, degrees=True).as_matrix()
    felt_b = np.einsum("nij,i->nj", R_eb[::5], FIELD) + hard + motor * (4000.0 / 5000.0) ** 2
    np.testing.assert_allclose(samples(params, R_eb, 4000.0), felt_b @ R_bs, rtol=0, atol=1e-12)


def test_noise_is_white_with_its_sigma():
    """0.5 uT a sample and axis, neighbours uncorrelated; without it readings repeat to the bit."""
    noise = (samples(MagnetometerParams(noise_ut=0.5), level(20_000)) - FIELD) / 0.5
    assert len(noise) == 4000
    assert_sigma(noise, 1.0)
    assert abs(np.sum(noise[1:] * noise[:-1])) <= 4.5 * math.sqrt(noise.size)
    assert len(np.unique(samples(MagnetometerParams(), level(200)), axis=0)) == 1


def test_latency_does_not_change_the_noise_of_a_sample():
    """A sample carries the error of the time it was true."""
    prompt, late = (samples(MagnetometerParams(noise_ut=0.5, latency_s=s), level(500)) for s in (0.0, 0.3))
    np.testing.assert_array_equal(prompt[: len(late)], late)


def test_readings_are_whole_counts_the_nearest():
    """Every reading is a count exactly, at most half a step from the field."""
    R_eb = attitudes(50)
    read = samples(MagnetometerParams(step_ut=STEP, range_ut=2048 * STEP), R_eb)
    counts = np.round(read / STEP)
    np.testing.assert_array_equal(read, counts * STEP)
    off = read - np.einsum("nij,i->nj", R_eb[::5], FIELD)
    assert np.abs(off).max() <= STEP / 2 + 1e-12
    assert np.abs(off).max() > 0.4 * STEP


@pytest.mark.parametrize(
    ("overflow", "field_ut", "counts"),
    [
        (0, 500.0, 2047), (0, -500.0, -2048),
        (0, 2047.4 * STEP, 2047), (0, 2047.6 * STEP, 2047), (0, -2048.4 * STEP, -2048), (0, 2046.4 * STEP, 2046),
        (-4096, 500.0, -4096), (-4096, -500.0, -4096),
        (-4096, 2047.4 * STEP, 2047), (-4096, 2047.6 * STEP, -4096),
        (-4096, -2048.4 * STEP, -2048), (-4096, -2048.6 * STEP, -4096),
    ],
)  # fmt: skip
def test_saturation_is_exact_at_both_ends_of_twelve_bits(overflow, field_ut, counts):
    """-2048 to 2047 counts; beyond, the end of the range, or the count by which the part says overflow."""
    hard = (field_ut - FIELD[0], 0.0, 0.0)
    # As a part file gives it: rounded, and yet the last level is a whole count.
    params = MagnetometerParams(hard_iron_b_ut=hard, step_ut=STEP, range_ut=157.538, overflow=overflow)
    assert samples(params, level())[0, 0] == counts * STEP


def test_saturation_without_counts_clips_at_the_range():
    """Both signs, exactly; the other axes stay what they are."""
    read = samples(MagnetometerParams(hard_iron_b_ut=(200.0, -200.0, 0.0), range_ut=100.0), level())[0]
    np.testing.assert_array_equal(read[:2], [100.0, -100.0])
    assert read[2] == FIELD[2]


def whole_suite(**changes):
    """Magnetometer and air data with every error on, but for the changes to the magnetometer."""
    mag = MagnetometerParams(
        rate_hz=8.0, latency_s=0.03, hard_iron_ut=5.0, soft_iron=0.05, noise_ut=0.4, gain=0.02, cross_axis=0.01
    )
    air = AirspeedParams(noise_pa=2.0, offset_pa=3.0, gain=0.03)
    baro = BarometerParams(rate_hz=5.0, noise_pa=2.0, drift_pa_min=1.0, wander_pa=3.0, lag_s=0.1)
    return SuiteParams(magnetometer=replace(mag, **changes), airspeed=air, barometer=baro)


def drawn(params, n=100):
    """What the sensors of a flight are made of."""
    suite = Suite(params, Rates(), 5)
    suite.reset(Log.empty(n))
    return suite.snapshot()


def test_magnetometer_and_air_data_change_no_other_sensor():
    """Gyro, accelerometer and GPS keep every bit."""
    without, fitted = drawn(SuiteParams()), drawn(whole_suite())
    for name in without.noise.dtype.names:
        same = np.array_equal(without.noise[name], fitted.noise[name])
        assert same == (not name.startswith(("mag", "airspeed", "baro")))
    for part in ("gyro", "accelerometer", "gps"):
        assert without.unit[part].tobytes() == fitted.unit[part].tobytes()


@pytest.mark.parametrize(
    ("error", "holds"),
    [("noise_ut", "noise"), ("hard_iron_ut", "offset_ut"), ("soft_iron", "A"), ("gain", "A"), ("cross_axis", "A")],
)
def test_error_switched_off_leaves_every_other_draw_unchanged(error, holds):
    """Each has its own stream; gains and cross axes also bear on the irons' fields, being the part's own."""
    whole, off = drawn(whole_suite()), drawn(whole_suite(**{error: 0.0}))
    for name in whole.noise.dtype.names:
        assert np.array_equal(whole.noise[name], off.noise[name]) == (name != "mag_noise_b_ut" or holds != "noise")
    changed = [n for n in ("A", "offset_ut") if np.any(whole.unit["magnetometer"][n] != off.unit["magnetometer"][n])]
    assert changed == {"noise": [], "offset_ut": ["offset_ut"]}.get(
        holds, ["A"] if error == "soft_iron" else ["A", "offset_ut"]
    )
    assert whole.unit["air"].tobytes() == off.unit["air"].tobytes()


def test_flight_restored_half_way_goes_on_as_if_never_stopped():
    """2N ticks equal N, snapshot, restore into sensors of another seed, N more: every bit."""
    R_eb, n = Rotation.random(200, rng=4).as_matrix(), 100
    logs = [log_of(R_eb, 3000.0) for _ in range(2)]
    for log in logs:
        log.truth["airspeed_m_s"] = 12.0 + np.sin(log.truth["t_s"])
        log.truth["p_e_m"][:, 2] = -3.0 * log.truth["t_s"]
    straight, stopped = logs
    suite = Suite(whole_suite(), Rates(), 5)
    suite.reset(straight)
    for k in range(2 * n):
        suite.measure(k)
    suite.reset(stopped)
    for k in range(n):
        suite.measure(k)
    other = Suite(whole_suite(), Rates(), 99)
    other.reset(stopped)
    other.restore(suite.snapshot())
    for k in range(n, 2 * n):
        other.measure(k)
    assert stopped.measured.tobytes() == straight.measured.tobytes()


@pytest.mark.parametrize(
    ("field", "value", "unit"),
    [
        ("rate_hz", 0.0, "Hz"), ("latency_s", -0.1, "s"), ("hard_iron_ut", math.nan, "uT"), ("noise_ut", -1.0, "uT"),
        ("soft_iron", -0.1, "(a fraction)"), ("gain", math.inf, "(a fraction)"), ("cross_axis", -0.1, "(a fraction)"),
        ("motor_rpm", 0.0, "rpm"), ("hard_iron_b_ut", (1.0, math.nan, 0.0), "uT"), ("motor_b_ut", (1.0, 2.0), "uT"),
        ("mounting_deg", (0.0, 0.0, math.inf), "deg"), ("range_ut", 0.0, "uT"), ("range_ut", math.nan, "uT"),
        ("step_ut", -1.0, "uT"), ("step_ut", math.inf, "uT"), ("overflow", -4096, "counts"),
        ("year", 2031.0, "(decimal)"),
    ],
)  # fmt: skip
def test_impossible_parameter_is_refused(field, value, unit):
    """One line that names the field, its value and unit, and says what to choose."""
    with pytest.raises(ValueError, match="choose ") as error:
        MagnetometerParams(**{field: value})
    assert str(error.value).startswith(f"MagnetometerParams.{field} = {value!r} {unit}: choose ")
    assert "\n" not in str(error.value)
