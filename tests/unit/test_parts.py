"""Parts and suites by file: what is committed is sound and sourced, what is wrong is refused in one line."""

import math
import re
import tomllib
from dataclasses import fields, replace

import numpy as np
import pytest

from sim.clock import Rates
from sim.log import Log
from sim.sensors import datasheet, fitting
from sim.sensors.accelerometer import AccelerometerParams
from sim.sensors.datasheet import KINDS, PERFECT, load_part, part_names
from sim.sensors.fitting import SUITES, SuiteParams, load_suite, own_files
from sim.sensors.gps import GpsParams
from sim.sensors.gyro import GyroParams
from sim.sensors.suite import Suite

DEG, G0 = math.pi / 180.0, 9.80665
HEAD = 'name = "X1"\nmaker = "X"\nsummary = "a gyro"\ndatasheet = "X1, Rev 1"\n'
GYRO = HEAD + "[gyro]\n"
SUITE = 'summary = "mine"\ngyro = "itg3200"\naccelerometer = "bma180"\ngps = "generic"\n'
WANTED = {
    "adxrs401", "lisy300al", "itg3200", "mpu6000", "mma7260q", "bma180", "hmc5843", "em406a", "ls20031", "ublox_m10",
    "mpxv7002dp", "ms5611",
}  # fmt: skip
PARTS = {
    "devboard_green": ("adxrs401", "mma7260q", "em406a", None),
    "devboard_red": ("lisy300al", "mma7260q", "em406a", None),
    "dilshad_9dof": ("itg3200", "bma180", "ls20031", "hmc5843"),
    "apm2": ("mpu6000", "mpu6000", "ls20031", "hmc5843"),
}


def test_parts_that_the_boards_carry_are_all_here():
    """One file a part."""
    assert set(part_names()) >= WANTED


@pytest.mark.parametrize("name", part_names())
def test_part_committed_loads_and_every_figure_says_where_it_comes_from(name):
    """Read twice: by the loader, and as plain TOML, figure by figure."""
    part = load_part(name)
    data = tomllib.loads((datasheet.FOLDER / f"{name}.toml").read_text(encoding="utf-8"))
    cited = {}
    for kind in set(data) & set(KINDS):
        for key, figure in data[kind].items():
            cited[f"{kind}.{key}"] = figure["source"]
            given = tuple(figure["value"]) if isinstance(figure["value"], list) else figure["value"]
            assert getattr(part.devices[kind], key) == given
    assert dict(part.sources) == cited
    assert all(len(source) > 3 for source in cited.values())
    assert part.devices.keys() == set(data) & set(KINDS)
    assert all("\n" not in line and line for line in (part.name, part.maker, part.summary, part.datasheet))


@pytest.mark.parametrize("name", part_names())
def test_part_leaves_out_nothing_but_perfection(name):
    """A figure that the file does not give has no error and no limit."""
    part = load_part(name)
    for kind, device in part.devices.items():
        for f in fields(device):
            if f"{kind}.{f.name}" not in part.sources:
                assert getattr(device, f.name) == getattr(PERFECT[kind], f.name)


@pytest.mark.parametrize("spelled", ["itg3200", "ITG-3200", "itg_3200", "Itg 3200"])
def test_part_is_found_however_it_is_spelled(spelled):
    """Case and punctuation do not matter."""
    assert load_part(spelled) == load_part("itg3200")


def test_part_unknown_is_refused_with_what_is_near():
    """And with how to name one's own."""
    with pytest.raises(ValueError, match=r"unknown part 'itg3300': did you mean itg3200.*part\.toml"):
        load_part("itg3300")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            GYRO + "bias_deg = { value = 1.0, source = 'typical' }",
            "gyro.bias_deg: unknown key: did you mean bias_deg_s",
        ),
        (
            GYRO + "noise_density_deg_s_sqrt_hz = { value = -0.1, source = 'typical' }",
            "gyro.noise_density_deg_s_sqrt_hz = -0.1 deg/s/sqrt(Hz): choose a finite number, at least 0",
        ),
        (GYRO + "bias_deg_s = 1.0", "gyro.bias_deg_s = 1.0 deg/s: source missing; write { value = ..., source ="),
        (GYRO + "bias_deg_s = { value = 1.0 }", "gyro.bias_deg_s = 1.0 deg/s: source missing; name the row"),
        (GYRO + "bias_deg_s = { value = 1.0, source = ' ' }", "gyro.bias_deg_s = 1.0 deg/s: source missing; name the"),
        (GYRO + "bias_deg_s = { source = 'typical' }", "gyro.bias_deg_s: value missing, deg/s; write"),
        (GYRO + "bias_deg_s = { value = 1.0, sorce = 'typical' }", "gyro.bias_deg_s: unknown key 'sorce'; write"),
        (GYRO + "bias_deg_s = { value = 'one', source = 'x' }", "gyro.bias_deg_s = 'one' deg/s: must be a number"),
        (GYRO + "bits = { value = 9.5, source = 'x' }", "gyro.bits = 9.5 bit: must be a whole number"),
        (GYRO + "bits = { value = 99, source = 'x' }", "gyro.bits = 99 bit: choose a whole number from 1 to 24"),
        (GYRO + "output = { value = 'loud', source = 'x' }", "gyro.output = 'loud': must be digital or ratiometric or"),
        (HEAD + "[giro]\n", "unknown section [giro]: did you mean gyro"),
        (HEAD + "gyro = 3", "unknown section [gyro]"),
        (HEAD, "describes no sensor: give it a section, one of [gyro], [accelerometer]"),
        (GYRO.replace('maker = "X"\n', ""), "maker is missing: must be a line of text"),
        (GYRO.replace('"X1, Rev 1"', "[]"), "datasheet = []: must be a line of text, or a list of such lines"),
        (GYRO + "bias_deg_s = {", "not TOML: "),
    ],
)
def test_part_file_that_is_wrong_is_refused_in_one_line(text, says, tmp_path):
    """The file, the key, the value, the unit, and what would be right."""
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match="^" + re.escape(f"{path}: {says}")) as refused:
        load_part(str(path))
    assert "\n" not in str(refused.value)


def test_part_file_that_is_not_there_is_refused(tmp_path):
    """By its path."""
    with pytest.raises(ValueError, match=r"part '.*none\.toml': no such file"):
        load_part(str(tmp_path / "none.toml"))


def test_suites_by_name_are_what_they_were():
    """Campaigns that name these depend on them; `generic` is the dataclasses' defaults."""
    assert SUITES["generic"] == SuiteParams()
    assert SUITES["generic_6g"] == SuiteParams(accelerometer=AccelerometerParams(range_g=6.0))
    ideal = SUITES["ideal"]
    assert ideal.gyro == GyroParams(
        bias_deg_s=0.0, drift_deg_s_min=0.0, walk_deg_s_sqrt_s=0.0, noise_density_deg_s_sqrt_hz=0.0, gain=0.0,
        cross_axis=0.0, range_deg_s=math.inf, bits=0,
    )  # fmt: skip
    assert ideal.accelerometer == AccelerometerParams(
        bias_g=0.0, noise_density_ug_sqrt_hz=0.0, range_g=math.inf, bits=0
    )
    assert ideal.gps == GpsParams(
        filter_s=0.0, latency_s=0.0, first_fix_s=0.0, velocity_noise_m_s=0.0, wander_horizontal_m=0.0,
        wander_vertical_m=0.0,
    )  # fmt: skip
    assert set(SUITES) >= {"generic", "generic_6g", "ideal", *PARTS}
    with pytest.raises(KeyError):
        SUITES["nothing"]


@pytest.mark.parametrize("name", PARTS)
def test_suite_carries_the_parts_of_its_board(name):
    """The receiver and the compass are the part as it is; gyro and accelerometer but for converter and changes."""
    suite, (gyro, accelerometer, gps, magnetometer) = SUITES[name], PARTS[name]
    assert suite.gps == load_part(gps).devices["gps"]
    assert suite.magnetometer == (load_part(magnetometer).devices["magnetometer"] if magnetometer else None)
    for kind, part in (("gyro", gyro), ("accelerometer", accelerometer)):
        fitted, sheet = getattr(suite, kind), load_part(part).devices[kind]
        own = {"bits", "step_deg_s", "step_g", "conversions", "bias_g"} if name.startswith("devboard") else set()
        own |= {"conversions"} if name == "apm2" else set()
        own |= {"bias_deg_s"} if name == "dilshad_9dof" else set()
        for f in fields(sheet):
            assert f.name in own or getattr(fitted, f.name) == getattr(sheet, f.name)


# One step in deg/s or g, and how many of them to either end: codes in two's complement or the range, what ends first.
# The boards' 10-bit converter of 5 V has steps of 5000 mV / 1024; these, over the sensitivity in mV.
ADC_MV = 5000.0 / 1024.0
SCALES = [
    ("dilshad_9dof", "gyro", 1.0 / 14.375, -28750, 28750),
    ("dilshad_9dof", "accelerometer", 1.0 / 2048.0, -8192, 8191),
    ("apm2", "gyro", 1.0 / 65.5, -32750, 32750),
    ("apm2", "accelerometer", 1.0 / 8192.0, -32768, 32767),
    ("devboard_green", "gyro", ADC_MV / 15.0, -230, 230),
    ("devboard_red", "gyro", ADC_MV / 3.3, -202, 202),
    ("devboard_green", "accelerometer", ADC_MV / 200.0, -245, 245),
    ("devboard_red", "accelerometer", ADC_MV / 200.0, -245, 245),
]


@pytest.mark.parametrize(("name", "kind", "step", "lowest", "highest"), SCALES)
def test_part_saturates_and_steps_exactly_as_its_data_sheet_says(name, kind, step, lowest, highest):
    """Through a slow sweep past both ends every reading is the nearest step, and the ends are those of the part."""
    scale, truth, reading = (
        (DEG, "imu_omega_b_rad_s", "gyro_b_rad_s") if kind == "gyro" else (G0, "imu_force_b_m_s2", "force_b_m_s2")
    )
    part, sheet = PERFECT[kind], getattr(SUITES[name], kind)
    converter = {f.name: getattr(sheet, f.name) for f in fields(part) if f.name.startswith(("range", "bits", "step"))}
    part = replace(part, **converter, conversions=sheet.conversions, output=sheet.output)
    n = 5001
    log = Log.empty(n)
    swept = np.linspace(1.1 * lowest, 1.1 * highest, n) + 0.123  # in steps, none half-way between two
    log.truth[truth] = (swept * step * scale)[:, None]
    suite = Suite(replace(SUITES["ideal"], **{kind: part}), Rates(), 0)
    suite.reset(log)
    for k in range(n):
        suite.measure(k)
    steps = log.measured[reading] / (step * scale)
    # Round-off: a few ulps of 32768 steps.
    expected = np.clip(np.rint(swept), lowest, highest)[:, None] * np.ones(3)
    np.testing.assert_allclose(steps, expected, rtol=0, atol=1e-10)
    assert (steps.min().round(), steps.max().round()) == (lowest, highest)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (SUITE.replace("bma180", "bma181"), "accelerometer: unknown part 'bma181': did you mean bma180"),
        (SUITE.replace("bma180", "itg3200"), "accelerometer = 'itg3200': that part has no accelerometer, only gyro"),
        (SUITE.replace('gps = "generic"\n', ""), "gps is missing: must be the name of a part"),
        (SUITE.replace('"generic"', "4"), "gps = 4: must be the name of a part"),
        (SUITE.replace("summary", "sumary"), "unknown key 'sumary': did you mean summary"),
        (SUITE.replace('"mine"', "1"), "summary = 1: must be a line of text"),
        (SUITE + "[bord]", "unknown key 'bord': did you mean board"),
        ("board = 3\n" + SUITE, "board = 3: must be a section, [board]"),
        (
            SUITE + "[board]\nlever_arm = [0, 0, 0]",
            "unknown parameter 'lever_arm' of board: did you mean lever_arm_b_m",
        ),
        (SUITE + "[board]\nmounting_deg = [0, 1]", "mounting_deg = [0, 1] deg of board: must be a list of 3 numbers"),
        (SUITE + "[board]\nwarming_k = -1.0", "BoardParams.warming_k = -1.0 K: choose"),
        (SUITE + "[changes]\n'gyro.bit' = 9", "unknown parameter 'gyro.bit' of this suite: did you mean gyro.bits"),
        (SUITE + "[changes]\n'magnetometer.noise_ut' = 1.0", "parameter 'magnetometer.noise_ut' of this suite: no mag"),
        (
            SUITE.replace("itg3200", "adxrs401") + "[board.converter]\nbits = 10",
            "board.converter = {'bits': 10}: must have bits and reference_v",
        ),
        (
            SUITE.replace("itg3200", "adxrs401") + "[board.converter]\nbits = 10\nreference_v = -5.0",
            "board.converter.reference_v = -5.0 V: choose a number above 0",
        ),
        (
            SUITE.replace("itg3200", "adxrs401") + "[board.converter]\nbits = 0\nreference_v = 5.0",
            "board.converter.bits = 0 bit: choose a whole number from 1",
        ),
    ],
)
def test_suite_file_that_is_wrong_is_refused_in_one_line(text, says, tmp_path):
    """The file, the key, the value, and what would be right."""
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match="^" + re.escape(f"{path}: {says}")) as refused:
        load_suite(str(path))
    assert "\n" not in str(refused.value)


def test_suite_of_ones_own_with_a_part_of_ones_own_is_kept_as_text(tmp_path):
    """The part lies beside the suite; with the texts kept, neither file is needed again."""
    (tmp_path / "mine.toml").write_text(SUITE.replace("itg3200", "my_gyro.toml"), encoding="utf-8")
    text = GYRO + "range_deg_s = { value = 123.0, source = 'typical' }"
    (tmp_path / "my_gyro.toml").write_text(text, encoding="utf-8")
    name = str(tmp_path / "mine.toml")
    suite, files = load_suite(name), own_files(name)
    assert suite.gyro == replace(PERFECT["gyro"], range_deg_s=123.0)
    assert files[str(tmp_path / "my_gyro.toml")] == text
    for path in tmp_path.iterdir():
        path.unlink()
    assert load_suite(name, files) == suite
    assert own_files(name, files) == files
    assert own_files("generic") == {}


def test_suites_folder_holds_nothing_that_does_not_load():
    """Every file there is a suite."""
    for path in fitting.FOLDER.glob("*.toml"):
        assert isinstance(SUITES[path.stem], SuiteParams)
