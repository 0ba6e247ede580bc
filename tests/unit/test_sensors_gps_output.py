"""What a GPS receiver puts into its messages, and the errors drawn ahead: rounding, course, outages, jumps, streams."""

import math
import re
import tomllib
from dataclasses import replace
from decimal import ROUND_HALF_UP, Decimal
from importlib.resources import files

import numpy as np
import pymap3d
import pytest
from scipy import stats

from sim.clock import Rates
from sim.log import Log
from sim.place import LATITUDE_DEG, LONGITUDE_DEG, metres_per_degree
from sim.sensors.gps import NOISE, GpsParams
from sim.sensors.suite import SUITES, Suite, SuiteParams

IDEAL = SUITES["ideal"].gps
RATES = Rates(gps_hz=5)
KNOT_M_S = 1852.0 / 3600.0
DOUBTED_ONCE_IN = 1e-5
EVERYTHING = GpsParams(
    noise_horizontal_m=0.4, noise_vertical_m=0.7, velocity_wander_m_s=0.2, first_fix_spread_s=3.0,
    resolution="nmea", course="positions", hold_below_m_s=0.5, smoothing_s=2.0,
    outage_every_s=4.0, outage_s=1.0, jump_every_s=3.0,
)  # fmt: skip


def suite_of(params, n_ticks, flight=0, rates=RATES):
    """A suite with this receiver, powered up, and its log."""
    log, suite = Log.empty(n_ticks), Suite(SuiteParams(gps=params), rates, 0, flight)
    suite.reset(log)
    return log, suite


def fixes_of(params, v_e_m_s, p_e_m=None, lost=()):
    """Fixes of a flight with these velocities and positions, shape (n, 3), without satellites in the ticks `lost`."""
    log, suite = suite_of(params, len(v_e_m_s))
    log.truth["v_e_m_s"], log.truth["p_e_m"] = v_e_m_s, np.zeros(3) if p_e_m is None else p_e_m
    suite.snapshot().noise["satellites_lost"][list(lost)] = 1
    for k in range(len(log)):
        suite.measure(k)
    return log.measured[log.measured["gps_new"] == 1]


def drawn(params, n_ticks=2000, flight=0):
    """The errors of a flight."""
    return suite_of(params, n_ticks, flight)[1].snapshot().noise


def test_metres_per_degree_agrees_with_the_ellipsoid():
    """Against pymap3d's geodetic transformation over 2e-4 degrees; curvature is below 1e-8."""
    d = 1e-4
    a = np.array(pymap3d.geodetic2ned(LATITUDE_DEG + d, LONGITUDE_DEG, 0.0, LATITUDE_DEG, LONGITUDE_DEG, 0.0))
    b = np.array(pymap3d.geodetic2ned(LATITUDE_DEG - d, LONGITUDE_DEG, 0.0, LATITUDE_DEG, LONGITUDE_DEG, 0.0))
    east = pymap3d.geodetic2ned(LATITUDE_DEG, LONGITUDE_DEG + d, 0.0, LATITUDE_DEG, LONGITUDE_DEG, 0.0)[1]
    north_m, east_m = metres_per_degree()
    np.testing.assert_allclose((a - b)[0] / (2 * d), north_m, rtol=1e-8, atol=0)
    np.testing.assert_allclose(east / d, east_m, rtol=1e-8, atol=0)


def written(value, step):
    """`value` in the decimal field of a message whose last digit is `step`, read again."""
    return float(Decimal(value).quantize(Decimal(step), ROUND_HALF_UP))


@pytest.mark.parametrize(
    ("resolution", "decimals", "per_degree", "angle", "height"),
    [("nmea", 4, 60.0, "1e-4", "0.1"), ("nmea", 5, 60.0, "1e-5", "0.1"), ("binary", 4, 1.0, "1e-7", "1e-3")],
)
def test_gps_position_is_what_the_message_can_tell(resolution, decimals, per_degree, angle, height):
    """Latitude, longitude and height written with the digits of the message and read again, to round-off."""
    p = np.random.default_rng(1).uniform(-300.0, 300.0, (2000, 3))
    params = replace(IDEAL, resolution=resolution, minute_decimals=decimals)
    told = fixes_of(params, np.zeros_like(p), p)["gps_p_e_m"]
    north_m, east_m = metres_per_degree()
    scale = np.array([north_m / per_degree, east_m / per_degree, -1.0])  # metres in the unit of each field
    # Offsets: the launch point itself is a whole number of steps in both formats, as is asked below.
    expected = [
        [written(x, step) for x, step in zip(fields, (angle, angle, height), strict=True)] * scale
        for fields in p[9::10] / scale
    ]
    assert len(told) == 200
    np.testing.assert_allclose(told, expected, rtol=0, atol=1e-9)
    for launch_deg in (LATITUDE_DEG, LONGITUDE_DEG):
        assert (Decimal(str(launch_deg)) * int(per_degree) / Decimal(angle)) % 1 == 0


def velocities(n=200):
    """Velocities of `n` fixes, held for a fix interval each, and the same per tick."""
    v = np.random.default_rng(2).uniform(-20.0, 20.0, (n, 3))
    return v, np.repeat(v, 10, axis=0)


def test_gps_nmea_tells_speed_and_course_and_no_climb():
    """0.01 knot and 0.01 degree; the velocity is made of these two, its vertical component is zero."""
    v, per_tick = velocities()
    fixes = fixes_of(replace(IDEAL, resolution="nmea"), per_tick)
    knots = [written(math.hypot(*u[:2]) / KNOT_M_S, "0.01") for u in v]
    degrees = [written(math.degrees(math.atan2(u[1], u[0])) % 360.0, "0.01") % 360.0 for u in v]
    course = np.radians(degrees)
    np.testing.assert_allclose(fixes["gps_speed_m_s"], np.array(knots) * KNOT_M_S, rtol=0, atol=1e-12)
    np.testing.assert_allclose(fixes["gps_course_rad"], course, rtol=0, atol=1e-12)
    told = fixes["gps_speed_m_s"] * np.stack([np.cos(course), np.sin(course), 0.0 * course])
    np.testing.assert_allclose(fixes["gps_v_e_m_s"], told.T, rtol=0, atol=1e-11)
    np.testing.assert_array_equal(fixes["gps_v_e_m_s"][:, 2], 0.0)


def test_gps_binary_tells_three_components_in_millimetres_per_second():
    """UBX NAV-PVT: velN, velE, velD and gSpeed in mm/s, headMot in 1e-5 degrees, each rounded for itself."""
    v, per_tick = velocities()
    fixes = fixes_of(replace(IDEAL, resolution="binary"), per_tick)
    np.testing.assert_allclose(fixes["gps_v_e_m_s"], np.round(v * 1e3) / 1e3, rtol=0, atol=1e-12)
    speed = np.hypot(v[:, 0], v[:, 1])
    np.testing.assert_allclose(fixes["gps_speed_m_s"], np.round(speed * 1e3) / 1e3, rtol=0, atol=1e-12)
    degrees = np.round(np.degrees(np.arctan2(v[:, 1], v[:, 0])) % 360.0 * 1e5) / 1e5
    np.testing.assert_allclose(np.degrees(fixes["gps_course_rad"]), degrees, rtol=0, atol=1e-11)


@pytest.mark.parametrize(("resolution", "just_below_deg"), [("nmea", 359.996), ("binary", 359.999996)])
def test_gps_course_that_rounds_to_a_full_circle_is_told_as_north(resolution, just_below_deg):
    """360.00 does not exist: 0.00."""
    c = math.radians(just_below_deg)
    fixes = fixes_of(replace(IDEAL, resolution=resolution), np.tile([10 * math.cos(c), 10 * math.sin(c), 0.0], (30, 1)))
    np.testing.assert_array_equal(fixes["gps_course_rad"], 0.0)


@pytest.mark.parametrize("rate_rad_s", [0.2, -0.7, 1.5])
def test_gps_course_from_positions_on_a_circle_is_a_fix_interval_old(rate_rad_s):
    """Closed form: the chord over two intervals h has the course of its middle, and V sin(wh) / (wh) of its speed."""
    V, w, h = 12.0, rate_rad_s, 0.2
    t = np.arange(1, 1001) * RATES.dt_s
    p = V / w * np.stack([np.sin(w * t), 1.0 - np.cos(w * t), 0.0 * t], axis=1)
    v = V * np.stack([np.cos(w * t), np.sin(w * t), 0.0 * t], axis=1)
    fixes = fixes_of(replace(IDEAL, course="positions"), v, p)
    np.testing.assert_allclose(fixes["gps_t_s"], np.arange(3, 101) * h, rtol=0, atol=1e-12)  # begins with the third
    off = fixes["gps_course_rad"] - w * (fixes["gps_t_s"] - h)
    np.testing.assert_allclose(np.exp(1j * off), 1.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(fixes["gps_speed_m_s"], V * math.sin(w * h) / (w * h), rtol=0, atol=1e-11)
    np.testing.assert_allclose(fixes["gps_p_e_m"], p[29::10], rtol=0, atol=1e-12)


def test_gps_course_from_positions_knows_of_fixes_that_were_lost():
    """Straight flight through an outage: the velocities over the gap are divided by the time that has really gone."""
    v = np.tile([8.0, -6.0, 1.0], (400, 1))
    p = v * np.arange(1, 401)[:, None] * RATES.dt_s
    fixes = fixes_of(replace(IDEAL, course="positions"), v, p, lost=range(150, 215))
    assert 38 - len(fixes) == 6  # those true at 3.2, 3.4 .. 4.2 s, in rows 159 .. 209
    np.testing.assert_allclose(fixes["gps_v_e_m_s"], np.tile(v[0], (len(fixes), 1)), rtol=0, atol=1e-11)


def test_gps_course_from_nmea_positions_is_as_coarse_as_they_are():
    """Worked out from the positions as told: velocity is half the step from the last fix but one, per interval."""
    v = np.tile([3.0, 2.0, -0.4], (500, 1))
    p = v * np.arange(1, 501)[:, None] * RATES.dt_s
    plain = fixes_of(replace(IDEAL, resolution="nmea"), v, p)["gps_p_e_m"]
    fixes = fixes_of(replace(IDEAL, resolution="nmea", course="positions"), v, p)
    np.testing.assert_allclose(fixes["gps_v_e_m_s"], (plain[2:] - plain[:-2]) / 0.4, rtol=0, atol=1e-12)
    assert np.ptp(fixes["gps_course_rad"]) > 0.01


def test_gps_at_a_standstill_keeps_its_course():
    """Positions that do not change have no direction: the last one stays."""
    v = np.zeros((300, 3))
    v[:100] = [0.0, 5.0, 0.0]
    p = np.cumsum(v, axis=0) * RATES.dt_s
    fixes = fixes_of(replace(IDEAL, course="positions"), v, p)
    assert fixes["gps_speed_m_s"][-1] == 0.0
    np.testing.assert_allclose(fixes["gps_course_rad"], math.pi / 2, rtol=0, atol=1e-12)


def test_gps_outages_come_and_go_with_their_mean_times():
    """Times with and without satellites are exponential: 2 sum / mean is chi-square with twice as many degrees."""
    lost = drawn(replace(IDEAL, outage_every_s=20.0, outage_s=4.0), 500_000)["satellites_lost"]
    assert set(np.unique(lost)) == {0, 1}
    edges = np.flatnonzero(np.diff(lost)) + 1
    lengths = np.diff(edges) * RATES.dt_s
    for times, mean in ((lengths[0::2], 4.0), (lengths[1::2], 20.0)):  # the first edge begins an outage
        assert len(times) > 300
        low, high = stats.chi2.ppf([DOUBTED_ONCE_IN / 2, 1 - DOUBTED_ONCE_IN / 2], 2 * len(times))
        # Whole ticks of 0.02 s are longer by half a tick on average, 0.25 % of 4 s.
        assert low <= 2.0 * np.sum(times - RATES.dt_s / 2) / mean <= high
        assert stats.kstest(times, "expon", args=(0.0, mean)).pvalue >= DOUBTED_ONCE_IN


def test_gps_in_an_outage_makes_no_fix_and_delays_none():
    """Fixes true in it are missing, those under way arrive on time, the rest is untouched, the last one is held."""
    v = np.random.default_rng(5).standard_normal((1500, 3))
    params = GpsParams(latency_s=0.5)
    whole, holed = fixes_of(params, v), fixes_of(params, v, lost=range(600, 800))
    inside = (whole["gps_t_s"] > 12.0 + 1e-9) & (whole["gps_t_s"] <= 16.0 + 1e-9)
    assert inside.sum() == 20
    np.testing.assert_array_equal(holed, whole[~inside])
    assert holed["t_s"].tobytes() == whole["t_s"][~inside].tobytes()


def test_gps_jumps_come_at_their_rate_with_their_size_and_decay():
    """What is not the decay of the tick before is a jump: Poisson count, chi-square sizes, exact decay between."""
    params = replace(IDEAL, jump_every_s=5.0, jump_horizontal_m=6.0, jump_vertical_m=9.0, jump_decay_s=7.0)
    n = 200_000
    x = drawn(params, n)["gps_p_wander_e_m"] / [6.0, 6.0, 9.0]
    fresh = x[1:] - math.exp(-0.02 / 7.0) * x[:-1]
    jumped = np.any(np.abs(fresh) > 1e-12, axis=1)
    np.testing.assert_allclose(fresh[~jumped], 0.0, rtol=0, atol=1e-14)
    low, high = stats.poisson.ppf([DOUBTED_ONCE_IN / 2, 1 - DOUBTED_ONCE_IN / 2], n * 0.02 / 5.0)
    assert low <= jumped.sum() <= high
    low, high = stats.chi2.ppf([DOUBTED_ONCE_IN / 2, 1 - DOUBTED_ONCE_IN / 2], 3 * jumped.sum())
    assert low <= np.sum(fresh[jumped] ** 2) <= high


def test_gps_velocity_and_position_have_white_and_wandering_errors():
    """Variances add; over a tick the white part alone changes, over the correlation time the wander too."""
    n = 100_000
    v = drawn(replace(IDEAL, velocity_noise_m_s=0.3, velocity_wander_m_s=0.4, velocity_wander_s=0.5), n)
    wander = replace(IDEAL, wander_horizontal_m=4.0, wander_vertical_m=4.0, wander_s=0.5)
    p = drawn(replace(wander, noise_horizontal_m=3.0, noise_vertical_m=3.0), n)
    for x in (v["gps_v_noise_e_m_s"], p["gps_p_wander_e_m"] / 10.0):
        for lag in (1, 10, 25):
            rho = 0.16 / 0.25 * math.exp(-lag * 0.02 / 0.5)
            # Some 3 n 0.02 / 0.5 independent pairs; the estimate of a covariance scatters by at most sqrt(2 / pairs).
            assert abs(np.mean(x[lag:] * x[:-lag]) / 0.25 - rho) <= 4.5 * math.sqrt(2.0 / (3 * n * 0.02 / 0.5))
        assert abs(np.mean(x**2) / 0.25 - 1.0) <= 4.5 * math.sqrt(2.0 / (3 * n * 0.02 / 0.5))


def test_gps_first_fix_comes_at_any_time_within_the_spread():
    """Uniform over flights, from the time without spread on: Kolmogorov and Smirnov do not object."""
    params = replace(IDEAL, first_fix_s=2.0, first_fix_spread_s=30.0)
    units = [suite_of(params, 1, flight)[1].snapshot().unit["gps"] for flight in range(400)]
    steps = np.concatenate([unit["first_fix_step"] for unit in units])
    assert steps.min() >= 400
    assert stats.kstest((steps - 400) / 200.0, "uniform", args=(0.0, 30.0)).pvalue >= DOUBTED_ONCE_IN


@pytest.mark.parametrize(
    ("error", "column"),
    [
        ({"noise_horizontal_m": 1.0}, "gps_p_wander_e_m"),
        ({"velocity_wander_m_s": 1.0}, "gps_v_noise_e_m_s"),
        ({"jump_every_s": 1.0}, "gps_p_wander_e_m"),
        ({"outage_every_s": 1.0}, "satellites_lost"),
        ({"first_fix_spread_s": 10.0}, None),
        ({"resolution": "nmea", "course": "positions", "smoothing_s": 1.0, "hold_below_m_s": 1.0}, None),
    ],
)
def test_gps_error_switched_on_moves_no_other_draw(error, column):
    """Its own column changes, every other one of the suite keeps its bits."""
    before, after = drawn(GpsParams()), drawn(GpsParams(**error))
    changed = [name for name in before.dtype.names if before[name].tobytes() != after[name].tobytes()]
    assert changed == ([] if column is None else [column])


def test_gps_errors_do_not_depend_on_the_length_of_the_flight():
    """Tick k's errors in a short flight and in a long one, bit for bit, with every source switched on."""
    short, long = drawn(EVERYTHING, 700), drawn(EVERYTHING, 3000)
    for name, *_ in NOISE:
        assert np.any(short[name] != 0)
        np.testing.assert_array_equal(short[name], long[name][:700])


def test_gps_with_everything_on_goes_on_from_a_snapshot():
    """The receiver's memory is in the snapshot: another suite flies the second half to the same bits."""
    v = np.cumsum(np.random.default_rng(7).standard_normal((2000, 3)), axis=0) * 0.1
    logs = []
    for resume in (False, True):
        log, suite = suite_of(EVERYTHING, 2000)
        log.truth["v_e_m_s"], log.truth["p_e_m"] = v, np.cumsum(v, axis=0) * 0.02
        for k in range(2000):
            if resume and k == 1111:
                snapshot, suite = suite.snapshot(), Suite(SuiteParams(gps=EVERYTHING), RATES, 99)
                suite.reset(log)
                suite.restore(snapshot)
            suite.measure(k)
        logs.append(log.measured)
    assert logs[0]["gps_new"].sum() > 50
    assert logs[0].tobytes() == logs[1].tobytes()


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("noise_horizontal_m", -1.0, "-1.0 m: choose a finite number, at least 0"),
        ("noise_vertical_m", math.nan, "nan m: choose a finite number"),
        ("velocity_wander_m_s", math.inf, "inf m/s: choose a finite number"),
        ("velocity_wander_s", 0.0, "0.0 s: choose a finite number, at least 0.001"),
        ("first_fix_spread_s", -0.1, "-0.1 s: choose"),
        ("smoothing_s", math.nan, "nan s: choose"),
        ("hold_below_m_s", -2.0, "-2.0 m/s: choose"),
        ("outage_every_s", 0.0, "0.0 s: choose a number above 0, or infinity"),
        ("outage_s", 0.0, "0.0 s: choose"),
        ("jump_every_s", math.nan, "nan s: choose a number above 0, or infinity"),
        ("jump_horizontal_m", -5.0, "-5.0 m: choose"),
        ("jump_vertical_m", math.inf, "inf m: choose"),
        ("jump_decay_s", 0.0, "0.0 s: choose"),
        ("resolution", "ubx", "'ubx': choose one of none, nmea, binary"),
        ("course", "compass", "'compass': choose one of velocity, positions"),
        ("minute_decimals", 3, "3: choose one of 4, 5"),
    ],
)
def test_gps_with_an_impossible_parameter_is_refused(field, value, said):
    """One line that names the field, its value and unit, and says what to choose."""
    with pytest.raises(ValueError, match=re.escape(f"GpsParams.{field} = {said}")) as error:
        GpsParams(**{field: value})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("part", ["em406a", "ls20031", "ublox_m10"])
def test_gps_part_gives_every_figure_a_receiver_can_have_and_a_source(part):
    """Each key is a parameter, each has a value that is accepted and says where it comes from."""
    table = tomllib.loads(files("sim").joinpath(f"sensors/parts/{part}.toml").read_text("utf-8"))
    assert all(table[key] for key in ("name", "maker", "summary", "datasheet"))
    receiver = GpsParams(**{key: entry["value"] for key, entry in table["gps"].items()})
    assert all(set(entry) == {"value", "source"} and entry["source"] for entry in table["gps"].values())
    Rates(gps_hz=receiver.rate_hz)
