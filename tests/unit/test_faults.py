"""Faults of the sensors: what is typed, what is refused, and what each kind does to a row."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from estimator.interface import MEASURED_DTYPE
from scenarios.harness.config import BenchStart, FlightConfig, override, resolve
from scenarios.harness.config.faults import parse_fault
from sim.clock import Rates
from sim.faults import CHANNELS as EVERY_CHANNEL
from sim.faults import Fault, family_of
from sim.log import TRUTH_DTYPE, Log
from sim.place import ELEVATION_M
from sim.rng import stream
from sim.sensors.air_data import AirspeedParams, BarometerParams
from sim.sensors.datasheet import load_part
from sim.sensors.faults import CHANNELS, fault_table, spoil
from sim.sensors.magnetometer import MagnetometerParams
from sim.sensors.suite import SUITES, Suite, SuiteParams

RELEASE_S = 1.0
N = 200  # ticks of 20 ms, from -1 s to 3 s after the release
IN = slice(99, 149)  # the rows whose intervals end at 1 s <= t < 2 s after the release
WINDOW = "@1-2"
COLUMN = {
    "gyro": "gyro_b_rad_s", "accelerometer": "force_b_m_s2", "magnetometer": "mag_b_ut",
    "airspeed": "equivalent_airspeed_m_s", "barometer": "baro_height_m",
}  # fmt: skip
SI = {"gyro": math.radians(1.0), "accelerometer": 9.80665, "magnetometer": 1.0, "airspeed": 1.0, "barometer": 1.0}
FITTED = SuiteParams(
    magnetometer=MagnetometerParams(range_ut=100.0),
    airspeed=AirspeedParams(range_pa=500.0),
    barometer=BarometerParams(rate_hz=5.0),
)  # with the gyro and accelerometer of the generic suite: 300 deg/s, 3 g, 10 bits
EVERY = {"magnetometer": 5, "airspeed": 5, "barometer": 10}  # ticks between samples: 10, 10 and 5 Hz
FIX = ("gps_p_e_m", "gps_v_e_m_s", "gps_course_rad", "gps_speed_m_s")


def is_sampled(channel, n=N):
    """In which ticks a sensor reports."""
    every = EVERY.get(channel.partition(".")[0], 1)
    return np.arange(n) % every == every - 1


def hold(column, sampled):
    """`column` as a log has it: each sample held until the next."""
    for k in np.flatnonzero(~sampled):
        column[k] = column[k - 1] if k > 0 else 0.0
    return column


def readings(n=N):
    """What sensors might report: every number another, the airspeed about 10 m/s, a fix every 10th tick."""
    rows = np.zeros(n, MEASURED_DTYPE)
    k = np.arange(n)
    for i, (part, column) in enumerate(COLUMN.items()):
        shape = rows[column].shape
        phase = k.reshape(-1, *[1] * (len(shape) - 1)) + np.arange(math.prod(shape[1:])) + i
        rows[column] = SI[part] * np.sin(1.0 + phase) + 10.0 * (part == "airspeed")
        hold(rows[column], is_sampled(part, n))
    rows["mag_new"] = rows["air_new"] = is_sampled("airspeed", n)
    fix = k // 10 * 10
    rows["gps_new"], rows["gps_valid"], rows["gps_t_s"] = k % 10 == 0, 1, 0.02 * fix
    rows["gps_p_e_m"] = fix[:, None] * [1.0, 2.0, 3.0]
    course = 0.01 * fix
    rows["gps_course_rad"], rows["gps_speed_m_s"] = course, 10.0 + fix
    rows["gps_v_e_m_s"] = np.stack([(10.0 + fix) * np.cos(course), (10.0 + fix) * np.sin(course), 0.1 * fix], axis=1)
    return rows


def table_of(*faults, n=N, seed=3, release_s=RELEASE_S, fitted=FITTED):
    """The table of faults over `n` ticks, given as text."""
    suite = Suite(fitted, Rates(), seed)
    suite.reset(Log.empty(1))
    unit = suite.snapshot().unit
    return fault_table([parse_fault(f) for f in faults], release_s, Rates(), partial(stream, seed, 0), unit, n)


def spoiled(*faults, rows=None, seed=3, fitted=FITTED):
    """Truth and measurements after the faults, what is not new held from the row before as sensors hold it."""
    clean = readings() if rows is None else rows
    truth, measured = np.zeros(len(clean), TRUTH_DTYPE), np.zeros(len(clean), MEASURED_DTYPE)
    truth["gyro_bias_b_rad_s"], truth["force_bias_b_m_s2"] = 0.01, 0.1
    table = table_of(*faults, seed=seed, fitted=fitted)
    for k in range(len(clean)):
        measured[k] = clean[k]
        held = [COLUMN[part] for part in EVERY if not is_sampled(part)[k]]
        if not clean["gps_new"][k]:
            held += ["gps_valid", "gps_t_s", *FIX]
        for column in held if k > 0 else []:
            measured[column][k] = measured[column][k - 1]
        spoil(truth, measured, k, table)
    return truth, measured


def of(channel, rows):
    """Readings of a channel, shape (n, axes)."""
    part, _, axis = channel.partition(".")
    column = rows[COLUMN[part]].reshape(len(rows), -1)
    return column[:, ["xyz".index(axis)] if axis else slice(None)]


def expected_of(channel, change):
    """Readings of a channel where the samples in the window are what `change` makes of them; held until the next."""
    column, sampled = of(channel, readings()).copy(), is_sampled(channel)
    for k in range(IN.start, N):
        if not sampled[k]:
            column[k] = column[k - 1]
        elif k < IN.stop:
            column[k] = change(column[k])
    return column


READINGS = [c for c in CHANNELS if c != "gps"]


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("gyro.x:stuck@20-25", Fault("gyro.x", "stuck", (), 20.0, 25.0)),
        (" Gyro.X : STUCK @ 20s - 25s ", Fault("gyro.x", "stuck", (), 20.0, 25.0)),
        ("gyro:bias@3", Fault("gyro", "bias", (5.0,), 3.0)),
        ("gyro:bias=-2.5@3-", Fault("gyro", "bias", (-2.5,), 3.0, math.inf)),
        ("accel.z:gain=1e1@-3--1", Fault("accelerometer.z", "gain", (10.0,), -3.0, -1.0)),
        ("mag:dropout@-.5-2", Fault("magnetometer", "dropout", (), -0.5, 2.0)),
        ("baro:spikes=7@0", Fault("barometer", "spikes", (7.0, 0.1), 0.0)),
        ("airspeed:saturated=-1@0", Fault("airspeed", "saturated", (-1.0,), 0.0)),
        ("gps:dropout@1-2", Fault("gps", "outage", (), 1.0, 2.0)),
        ("gps:jump=30,-40@10", Fault("gps", "jump", (30.0, -40.0), 10.0)),
        ("gps:jump=30@10", Fault("gps", "jump", (30.0, 0.0), 10.0)),
        ("gps:frozen_course@10", Fault("gps", "frozen_course", (), 10.0)),
        ("aileron:stuck@20-", Fault("aileron", "stuck", (), 20.0)),
        ("Aileron:stuck=-.3@20-25", Fault("aileron", "stuck", (-0.3,), 20.0, 25.0)),
        ("elevator:slow@5", Fault("elevator", "slow", (0.5,), 5.0)),
        ("rudder:slack=0.2@5", Fault("rudder", "slack", (0.2,), 5.0)),
        ("motor:dead@30-", Fault("motor", "dead", (), 30.0)),
        ("throttle:weak@30", Fault("motor", "weak", (0.6,), 30.0)),
    ],
)
def test_parse_fault_of_what_people_type(text, fault):
    """Channel, kind, value and window; short names, negative times, an open end, values not given."""
    assert parse_fault(text) == fault


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("banana", "gyro.x:stuck@20-25"),
        ("gyro:stuck", "gyro.x:stuck@20-25"),
        ("gyro:stuck@", "gyro.x:stuck@20-25"),
        ("gyro:stuck@nan", "gyro.x:stuck@20-25"),
        ("gyro:bias=@3", "'' is not a number"),
        ("gyro:bias=much@3", "'much' is not a number"),
        ("giro:stuck@3", "did you mean gyro"),
        ("gyro.w:stuck@3", "did you mean gyro"),
        ("gps.x:jump@3", "did you mean gps"),
        ("gyro:stick@3", "did you mean stuck"),
        ("gyro:jump@3", "gyro has no fault 'jump'"),
        (
            "gps:bias@3",
            "choose from drift, frozen_course, frozen_position, frozen_velocity, jump, nan, outage, rate, spikes, "
            "stuck, whole_degrees",
        ),
        ("gps:rate=0@3", "must be at least 0.1 Hz; for no fixes use outage"),
        ("gps:rate=-2@3", "must be at least 0.1 Hz"),
        ("gps:drift=0,-200@3", "must be at most 100 m/s north and east"),
        ("gps:drift=nan@3", "'nan' is not a number"),
        ("gps:frozen_velocity=3@3", "takes no value"),
        ("gps:frozen@3", "did you mean"),
        ("mag.x:dropout@3", "magnetometer.x has no fault 'dropout'"),
        ("gyro:stuck=3@3", "takes no value"),
        ("gyro:bias=1,2@3", "at most 1 value"),
        ("gyro:bias=nan@3", "'nan' is not a number"),
        ("gyro:spikes=100,2@3", "above 0 and at most 1"),
        ("gyro:saturated=0.5@3", "must be 1, the upper end of the full scale, or -1"),
        ("gyro:stuck@5-5", "end later than it begins"),
        ("gyro:stuck@5-3", "end later than it begins"),
        ("gyro:stuck@99999", "within 36000 s of the release"),
        ("ailron:stuck@3", "did you mean aileron"),
        ("motor:lost@3", "motor has no fault 'lost'; choose from dead, stuck, weak"),
        ("motor:ded@3", "did you mean dead"),
        ("rudder:reverse@3", "did you mean reversed"),
        ("rudder:reversed=1@3", "takes no value"),
        ("aileron:stuck=1.5@3", "must be from -1 to 1, in fractions of full deflection"),
        ("aileron:stuck=0,1@3", "at most 1 value"),
        ("motor:stuck=-0.1@3", "must be from 0 to 1, in fractions of full throttle"),
        ("elevator:slow=0@3", "must be above 0 and at most 100, in full deflections per second"),
        ("elevator:slack=-1@3", "must be from 0 to 2, in fractions of full deflection"),
        ("motor:weak=1.2@3", "must be from 0 to 1, in fractions of the voltage"),
    ],
)
def test_parse_fault_of_what_cannot_be_is_refused_in_one_line(text, words):
    """The line shows what was typed and what would be right."""
    with pytest.raises(ValueError, match=r"fault = ") as refused:
        parse_fault(text)
    assert repr(text) in str(refused.value)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


@given(
    st.text(max_size=25) | st.from_regex(r"(gyro|gps):(bias|jump|nan)=?[0-9e.,+-]{0,9}@[0-9.s-]{1,9}", fullmatch=True)
)
def test_parse_fault_of_any_text_is_a_fault_or_a_value_error(text):
    """Nothing that is typed crashes it."""
    try:
        fault = parse_fault(text)
    except ValueError:
        return
    assert isinstance(fault, Fault)


@given(st.data())
def test_text_of_any_fault_reads_back_as_the_fault(data):
    """What the manifest keeps is the whole fault, to the last bit of every number."""
    channel = data.draw(st.sampled_from(EVERY_CHANNEL))
    kind = data.draw(st.sampled_from(family_of(channel).kinds_of(channel)))
    finite = st.floats(-1e9, -1e-12) | st.just(0.0) | st.floats(1e-12, 1e9)
    takes = {"spikes": [finite, st.floats(1e-6, 1.0)], "bias": [finite], "gain": [finite], "jump": [finite, finite]}
    fraction = st.just(0.0) | st.floats(1e-6, 1.0)
    takes |= {"slow": [st.floats(1e-6, 100.0)], "slack": [fraction], "weak": [fraction]}
    if family_of(channel).name == "actuator" and kind == "stuck":
        takes = {"stuck": data.draw(st.sampled_from([[], [fraction]]))}
    small = st.just(0.0) | st.floats(1e-12, 100.0)
    takes |= {"rate": [st.floats(0.1, 1e3)], "drift": [small, small]}
    values = tuple(data.draw(numbers) for numbers in takes.get(kind, []))
    from_s = data.draw(st.floats(-100.0, 100.0))
    fault = Fault(channel, kind, values, from_s, from_s + data.draw(st.floats(0.01, 1e3) | st.just(math.inf)))
    assert parse_fault(str(fault)) == fault


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(("giro", "stuck"), "choose from gyro, gyro.x"), (("gyro", "jump"), "'jump': choose from stuck, dropout")],
)
def test_fault_of_what_there_is_not_is_refused(arguments, words):
    """Also where no text was typed."""
    with pytest.raises(ValueError, match=words):
        Fault(*arguments)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"faults": ["mag:stuck@3"]}, "no magnetometer fitted"),
        (
            {"faults": ["gyro:saturated@3"], "suite": "ideal"},
            "this gyro has no full scale; set gyro.range_deg_s to a finite number of deg/s, choose a suite whose",
        ),
        (
            {"faults": ["baro:saturated@3"], "suite": "ideal"},
            "this barometer has no full scale; set barometer.range_pa to a finite number of Pa",
        ),
        ({"faults": ["gyro:bias@3", "gyro:bias=5@3"]}, "named twice"),
        (
            {"faults": ["aileron:lost@3"], "aircraft": "gentle_lady"},
            "gentle_lady has no aileron; it has elevator, rudder",
        ),
        ({"faults": ["motor:dead@3"], "aircraft": "gentle_lady"}, "gentle_lady has no motor; it has elevator, rudder"),
        ({"faults": ["gps:rate=3@3"]}, "must divide the 4 Hz of the receiver: choose 4, 2, 1.33333, 1, 0.8 Hz or"),
        ({"faults": ["gps:rate=4@3"], "rates.gps_hz": 10}, "must divide the 10 Hz of the receiver"),
        ({"faults": ["gps:rate=2@3"], "suite": "devboard_red"}, "must divide the 1 Hz of the receiver"),
        ({"faults": 7}, "faults = 7: write channel:kind"),
        ({"fault": "gyro:bias@3"}, "did you mean faults"),
    ],
)
def test_override_of_faults_that_cannot_be_is_refused_in_one_line(changes, words):
    """Sensors that are not fitted, a full scale that is not there, one fault twice."""
    with pytest.raises(ValueError, match=words) as refused:
        override(FlightConfig(), changes)
    assert "\n" not in str(refused.value)


def test_fault_of_a_control_on_a_table_is_refused():
    """Nothing moves there."""
    with pytest.raises(ValueError, match="the flight is on a table, where no control moves"):
        override(FlightConfig(start=BenchStart()), {"faults": ["motor:dead@3"]})


def test_configuration_keeps_faults_as_texts_that_say_all():
    """From a list or one text; values are written out, so that the manifest does not depend on defaults."""
    config = override(FlightConfig(faults=("gps:outage@1",)), {"faults": "accel:bias@3-4 gps:jump@20"})
    assert config.faults == ("accelerometer:bias=0.2@3-4", "gps:jump=50,0@20")
    assert FlightConfig(**resolve(config).model_dump(mode="json")).faults == config.faults
    assert override(config, {"faults": ""}).faults == ()


@pytest.mark.parametrize(
    ("window", "release_s", "first", "last"),
    [
        ("1-2", 1.0, 99, 148),
        ("0.3-0.4", 0.3, 29, 33),  # in binary 0.3 + 0.3 s is just above 30 ticks of 20 ms
        ("1.005-1.015", 1.0, None, None),  # between two readings
        ("1.005-1.025", 1.0, 100, 100),
        ("-99-0", 1.0, 0, 48),
        ("2.5", 1.0, 174, 199),
        ("3.5", 1.0, None, None),
    ],
)
def test_window_holds_the_readings_from_its_begin_to_before_its_end(window, release_s, first, last):
    """A reading is wrong where its interval ends at from <= t < to after the release."""
    wrong = np.flatnonzero(table_of(f"gyro.x:nan@{window}", release_s=release_s)["kind"])
    expected = [] if first is None else range(first, last + 1)
    np.testing.assert_array_equal(wrong, expected)


@pytest.mark.parametrize("channel", READINGS)
def test_stuck_repeats_the_reading_before_the_window(channel):
    """Bit for bit; reports that come now and then repeat what was reported last."""
    _, measured = spoiled(f"{channel}:stuck{WINDOW}")
    before = of(channel, readings())[IN.start - 1]
    expected = expected_of(channel, lambda _: before)
    np.testing.assert_array_equal(of(channel, measured), expected)


@pytest.mark.parametrize("channel", [c for c in READINGS if not c.startswith("magnetometer")])
@pytest.mark.parametrize(("kind", "value"), [("dropout", 0.0), ("nan", np.nan)])
def test_dropout_reads_zero_and_nan_is_no_number(channel, kind, value):
    """What answers nothing on a bus reads zeros."""
    _, measured = spoiled(f"{channel}:{kind}{WINDOW}")
    np.testing.assert_array_equal(of(channel, measured), expected_of(channel, lambda _: value))


def test_magnetometer_dropout_brings_no_new_sample():
    """Every other tick is as it was; the last sample stays."""
    clean, (_, measured) = readings(), spoiled(f"mag:dropout{WINDOW}")
    inside = np.zeros(N, bool)
    inside[IN] = True
    np.testing.assert_array_equal(measured["mag_new"], np.where(inside, 0, clean["mag_new"]))
    lost = np.flatnonzero(inside & (clean["mag_new"] > 0))
    np.testing.assert_array_equal(measured["mag_b_ut"][lost], measured["mag_b_ut"][lost - 1])


@pytest.mark.parametrize("channel", READINGS)
@pytest.mark.parametrize(
    ("text", "of_reading"), [("bias=0.5", lambda x, si: x + 0.5 * si), ("gain=1.5", lambda x, _: 1.5 * x)]
)
def test_bias_adds_its_amount_and_gain_multiplies(channel, text, of_reading):
    """In deg/s, g, uT, m/s and m, once in each new sample; round-off of a sum or product."""
    _, measured = spoiled(f"{channel}:{text}{WINDOW}")
    expected = expected_of(channel, lambda x: of_reading(x, SI[channel.partition(".")[0]]))
    np.testing.assert_allclose(of(channel, measured), expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize(("sign", "counts"), [("1", 511), ("-1", -512)])
def test_saturated_reads_the_last_level_of_the_converter(sign, counts):
    """Two's complement of 10 bits over +-300 deg/s and +-3 g."""
    _, measured = spoiled(f"gyro:saturated={sign}{WINDOW}", f"accel.y:saturated={sign}{WINDOW}")
    rate, force = counts * math.radians(300.0) / 512, counts * 3.0 * 9.80665 / 512
    np.testing.assert_allclose(measured["gyro_b_rad_s"][IN], rate, rtol=0, atol=1e-14)
    np.testing.assert_allclose(measured["force_b_m_s2"][IN, 1], force, rtol=0, atol=1e-14)


def test_saturated_magnetometer_and_pitot_tube_read_their_full_scale():
    """100 uT; 500 Pa are sqrt(2 p / rho) of airspeed, and no pressure is less than none."""
    _, measured = spoiled(f"mag:saturated{WINDOW}", f"airspeed:saturated{WINDOW}", "airspeed:saturated=-1@2")
    np.testing.assert_allclose(measured["mag_b_ut"][104:149], 100.0, rtol=0, atol=1e-12)
    fastest = math.sqrt(2.0 * 500.0 / 1.225)
    np.testing.assert_allclose(measured["equivalent_airspeed_m_s"][104:149], fastest, rtol=1e-6, atol=0)
    np.testing.assert_array_equal(measured["equivalent_airspeed_m_s"][149:], 0.0)


def test_saturated_compass_that_tells_an_overflow_reads_its_code():
    """HMC5843: -4096 counts of 1/13 uT, at either end, and where a bias carries it past the range; not within."""
    fitted = replace(FITTED, magnetometer=load_part("hmc5843").devices["magnetometer"])
    code_ut = -4096 / 13.0
    for text in ("saturated", "saturated=-1", "bias=9999", "bias=-9999", "gain=1e6"):
        _, measured = spoiled(f"mag.y:{text}{WINDOW}", fitted=fitted)
        np.testing.assert_allclose(measured["mag_b_ut"][104:149, 1], code_ut, rtol=0, atol=1e-6)
    _, measured = spoiled(f"mag.y:bias=100{WINDOW}", fitted=fitted)
    assert np.abs(measured["mag_b_ut"][104:149, 1] - 100.0).max() <= 1.0


def test_saturated_barometer_reads_the_ends_of_its_pressure():
    """1200 mbar of an MS5611, below the sea; no pressure, where the law ends; a bias carries it no lower."""
    fitted = replace(FITTED, barometer=load_part("ms5611").devices["barometer"])
    deepest_m = _height_m(1.2e5)
    for text, height_m in (("saturated", deepest_m), ("saturated=-1", _height_m(0.0)), ("bias=-9999", deepest_m)):
        _, measured = spoiled(f"baro:{text}{WINDOW}", fitted=fitted)
        np.testing.assert_allclose(measured["baro_height_m"][109:149], height_m, rtol=0, atol=1e-6)


def _height_m(pressure_pa):
    """ISO 2533: T0 / L (1 - (p / p0)^(R L / g0))."""
    return 288.15 / 0.0065 * (1.0 - (pressure_pa / 101325.0) ** (287.05287 * 0.0065 / 9.80665)) - ELEVATION_M


@pytest.mark.parametrize("text", ["bias=9999", "gain=1e9", "spikes=9999,1"])
def test_reading_that_is_off_stays_within_full_scale(text):
    """Nothing reads more than its converter can say."""
    _, measured = spoiled(f"gyro:{text}{WINDOW}")
    rate, full_scale = np.degrees(measured["gyro_b_rad_s"]), 300.0
    assert rate.min() >= -full_scale - 1e-9
    assert rate.max() == pytest.approx(full_scale * 511 / 512, rel=0, abs=1e-9)


def test_true_bias_is_what_the_sensor_reads_without_a_signal():
    """A bias is added to it and a gain multiplies it; other kinds, spikes too, and other rows leave it."""
    truth, _ = spoiled(f"gyro.x:bias=2{WINDOW}", f"gyro.x:gain=3{WINDOW}", f"accel:bias=0.5{WINDOW}")
    expected = np.full((N, 3), 0.01)
    expected[IN, 0] = 3.0 * (0.01 + math.radians(2.0))
    np.testing.assert_allclose(truth["gyro_bias_b_rad_s"], expected, rtol=0, atol=1e-15)
    np.testing.assert_allclose(truth["force_bias_b_m_s2"][IN], 0.1 + 0.5 * 9.80665, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(truth["force_bias_b_m_s2"][: IN.start], 0.1)
    others = [f"gyro:{kind}{WINDOW}" for kind in ("stuck", "dropout", "nan", "spikes", "saturated")]
    np.testing.assert_array_equal(spoiled(*others)[0]["gyro_bias_b_rad_s"], 0.01)


def test_spikes_hit_their_share_of_the_readings_with_their_amplitude():
    """The count is binomial (bounds at 1e-5), signs are even, all axes are hit at once."""
    n, share = 20_000, 0.05
    table = table_of(f"gyro:spikes=100,{share}@-100", n=n)
    hit = table["kind"] > 0
    low, high = stats.binom.ppf([1e-5, 1.0 - 1e-5], n, share)
    assert low <= hit[:, 0].sum() <= high
    np.testing.assert_array_equal(hit, hit[:, :1].repeat(3, axis=1))
    spikes = table["value"][hit[:, 0]]
    np.testing.assert_allclose(np.abs(spikes), math.radians(100.0), rtol=0, atol=1e-14)
    low, high = stats.binom.ppf([1e-5, 1.0 - 1e-5], spikes.size, 0.5)
    assert low <= (spikes > 0.0).sum() <= high


def test_spikes_are_the_same_beside_other_faults_and_in_a_longer_flight():
    """Each fault draws from its own stream; tick k's draw does not depend on the length; another seed differs."""
    alone = table_of("gyro.y:spikes=100,0.5@-100")
    beside = table_of("accel:spikes=1,0.5@-100", "gyro.y:spikes=100,0.5@-100", n=2 * N)
    np.testing.assert_array_equal(alone[:, 0], beside[:N, 3])
    assert np.any(alone != table_of("gyro.y:spikes=100,0.5@-100", seed=4))
    assert np.any(beside["value"][:, 0] * beside["value"][:, 1] < 0.0)


def test_gps_spikes_displace_fixes_by_their_amplitude_in_any_direction():
    """Horizontally, hundreds of directions; a fix without a spike is as it was."""
    rows = readings()
    rows["gps_new"] = 1
    _, measured = spoiled(f"gps:spikes=30,0.5{WINDOW}", rows=rows)
    off = measured["gps_p_e_m"] - rows["gps_p_e_m"]
    distance = np.hypot(off[:, 0], off[:, 1])
    hit = distance > 1.0
    assert 10 <= hit.sum() <= 40  # 50 fixes, binomial at 1e-5
    np.testing.assert_allclose(distance[hit], 30.0, rtol=0, atol=1e-10)
    np.testing.assert_array_equal(off[~hit], 0.0)
    np.testing.assert_array_equal(off[:, 2], 0.0)
    assert len(np.unique(np.sign(off[hit, :2]), axis=0)) == 4  # all quadrants


def held(fixes):
    """Rows that hold each of the `fixes`, every 10th, until the next."""
    return fixes[np.arange(N) // 10 * 10]


@pytest.mark.parametrize("text", ["jump=30,-40", "nan", "stuck", "frozen_course"])
def test_gps_fault_lasts_for_the_fixes_in_its_window(text):
    """Fixes at ticks 100 to 140 are wrong, the one at 150 is right; ticks between hold the fix before them."""
    clean, (_, measured) = readings(), spoiled(f"gps:{text}{WINDOW}")
    changed = clean.copy()
    hit = np.arange(100, 150, 10)
    if text == "nan":
        for column in FIX:
            changed[column][hit] = np.nan
    elif text == "stuck":
        for column in FIX:
            changed[column][hit] = clean[column][90]
    elif text == "frozen_course":
        speed, course = clean["gps_speed_m_s"][hit], clean["gps_course_rad"][90]
        changed["gps_course_rad"][hit] = course
        changed["gps_v_e_m_s"][hit, 0], changed["gps_v_e_m_s"][hit, 1] = speed * np.cos(course), speed * np.sin(course)
    else:
        changed["gps_p_e_m"][hit] += [30.0, -40.0, 0.0]
    expected = held(changed)
    for column in FIX:
        np.testing.assert_allclose(measured[column], expected[column], rtol=0, atol=1e-12)
    for column in ("gps_new", "gps_valid", "gps_t_s"):
        np.testing.assert_array_equal(measured[column], clean[column])


def test_gps_outage_holds_the_last_good_fix():
    """No fix is new in the window; the one before it stays valid with its own stamp; then all is as before."""
    clean, (_, measured) = readings(), spoiled(f"gps:outage{WINDOW}")
    new = clean["gps_new"].copy()
    new[IN] = 0
    np.testing.assert_array_equal(measured["gps_new"], new)
    for column in ("gps_valid", "gps_t_s", *FIX):
        expected = clean[column].copy()
        expected[IN] = clean[column][98]
        expected[149] = clean[column][98]
        np.testing.assert_array_equal(measured[column], expected)


def test_gps_fault_from_power_up_has_nothing_to_repeat():
    """A receiver that is stuck before its first fix brings none; a course frozen then is north."""
    rows = readings()
    rows["gps_new"][:40] = rows["gps_valid"][:40] = 0
    for column in FIX:
        rows[column][:40] = 0.0
    _, stuck = spoiled("gps:stuck@-99-2", rows=rows)
    _, frozen = spoiled("gps:frozen_course@-99-2", rows=rows)
    assert not stuck["gps_valid"][:150].any()
    assert not stuck["gps_new"][:150].any()
    np.testing.assert_array_equal(frozen["gps_course_rad"][:150], 0.0)
    np.testing.assert_array_equal(frozen["gps_v_e_m_s"][140], [rows["gps_speed_m_s"][140], 0.0, 14.0])
    for measured in (stuck, frozen):
        assert measured[150:].tobytes() == rows[150:].tobytes()


def test_faults_overlap_in_the_order_given():
    """A bias before a gain is multiplied, after it is not; on a stuck reading it does not pile up."""
    x = readings()["gyro_b_rad_s"][:, 0]
    bias = math.radians(2.0)
    _, first = spoiled(f"gyro.x:bias=2{WINDOW}", f"gyro:gain=3{WINDOW}")
    _, last = spoiled(f"gyro:gain=3{WINDOW}", f"gyro.x:bias=2{WINDOW}")
    _, stuck = spoiled(f"gyro.x:stuck{WINDOW}", "gyro.x:bias=2@1.2-1.6")
    np.testing.assert_allclose(first["gyro_b_rad_s"][IN, 0], 3.0 * (x[IN] + bias), rtol=0, atol=1e-14)
    np.testing.assert_allclose(last["gyro_b_rad_s"][IN, 0], 3.0 * x[IN] + bias, rtol=0, atol=1e-14)
    expected = np.full(50, x[98])
    expected[10:30] += bias
    np.testing.assert_allclose(stuck["gyro_b_rad_s"][IN, 0], expected, rtol=0, atol=1e-14)


def test_reading_sticks_at_what_was_reported_wrong():
    """A bias that began before is in the reading that sticks, and is not added again."""
    _, measured = spoiled("gyro.x:bias=2@0-3", f"gyro.x:stuck{WINDOW}")
    x = readings()["gyro_b_rad_s"][:, 0]
    np.testing.assert_allclose(measured["gyro_b_rad_s"][IN, 0], x[98] + math.radians(2.0), rtol=0, atol=1e-14)


def test_jump_in_an_outage_is_seen_in_the_fixes_that_arrive():
    """The outage hides its own fixes, the jump goes on in those after it."""
    clean, (_, measured) = readings(), spoiled("gps:jump=30@1-3", f"gps:outage{WINDOW}")
    off = measured["gps_p_e_m"][:, 0] - held(clean)["gps_p_e_m"][:, 0]
    np.testing.assert_array_equal(off[[90, 150, 160, 190]], [0.0, 30.0, 30.0, 30.0])
    assert not measured["gps_new"][IN].any()


def test_suite_refuses_a_fault_of_what_is_not_fitted():
    """Also where no configuration checked it."""
    with pytest.raises(ValueError, match="no airspeed fitted"):
        Suite(SUITES["generic"], Rates(), 0, faults=[parse_fault("airspeed:nan@1")])
