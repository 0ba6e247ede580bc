"""The sensors in the configuration: suites by name and file, single figures, and the rate of the receiver."""

import json
import re

import pytest

from scenarios.harness.config import FlightConfig, override, resolve
from scenarios.harness.flight import fly_config
from scenarios.harness.registry import find
from sim.sensors.fitting import suite_params

CONFIG = FlightConfig()
MINE = """
summary = "mine"
gyro = "itg3200"
accelerometer = "my_accelerometer.toml"
gps = "ublox_m10"
"""
MY_ACCELEROMETER = """
name = "A1"
maker = "me"
summary = "an accelerometer"
datasheet = "none"

[accelerometer]
range_g = { value = 5.0, source = "typical" }
bias_g = { value = 0.05, source = "typical" }
"""


@pytest.fixture
def mine(tmp_path):
    """Path of a suite of one's own with a part of one's own."""
    (tmp_path / "mine.toml").write_text(MINE, encoding="utf-8")
    (tmp_path / "my_accelerometer.toml").write_text(MY_ACCELEROMETER, encoding="utf-8")
    return tmp_path / "mine.toml"


@pytest.mark.parametrize(
    ("changes", "gps_hz"),
    [
        ({}, 4.0),
        ({"suite": "devboard_green"}, 1.0),
        ({"suite": "dilshad_9dof"}, 5.0),
        ({"suite": "dilshad_9dof", "rates.gps_hz": "2"}, 2.0),
        ({"suite": "devboard_red", "gps.rate_hz": "2.5"}, 2.5),
        ({"rates.gps_hz": 10}, 10.0),
    ],
)
def test_gps_rate_is_the_receivers_own_unless_named(changes, gps_hz):
    """Resolved into a number, which stays when it is resolved again."""
    config = override(CONFIG, changes)
    resolved = resolve(config)
    assert resolved.rates.gps_hz == resolved.rates.build().gps_hz == gps_hz
    assert resolve(resolved) == resolved


def test_gps_rate_before_it_is_resolved_is_refused():
    """Nobody reads the generic rate by mistake."""
    with pytest.raises(ValueError, match=r"rates\.gps_hz = None: resolve the configuration first"):
        CONFIG.rates.build()


def test_gps_rate_that_the_physics_cannot_keep_is_refused():
    """A receiver of 3 Hz does not divide 200 Hz."""
    with pytest.raises(ValueError, match="GPS rate 3 Hz does not divide the physics rate of 200 Hz"):
        resolve(override(CONFIG, {"gps.rate_hz": "3"}))


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("gyro.bits", "1", 1),
        ("gps.latency_s", ".5", 0.5),
        ("gyro.output", "ratiometric", "ratiometric"),
        ("gps.course", "positions", "positions"),
        ("board.lever_arm_b_m", "[0.1, 0, -0.2]", (0.1, 0.0, -0.2)),
        ("board.converter_ratiometric", "false", False),
    ],
)
def test_sensor_figure_of_any_kind_is_changed_by_text(name, text, value):
    """Numbers, words, truth values and three numbers; the same after JSON there and back."""
    config = resolve(override(CONFIG, {name: text}))
    again = FlightConfig(**json.loads(config.model_dump_json()))
    assert again == config
    part, field = name.split(".")
    for c in (config, again):
        fitted = getattr(getattr(suite_params(c.suite, c.sensors, c.files), part), field)
        assert fitted == value
        assert type(fitted) is type(value)


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        (
            "gyro.output",
            "loud",
            "gyro.output = 'loud' of sensor suite generic: must be digital or ratiometric or absolute",
        ),
        (
            "board.lever_arm_b_m",
            "[1, 2]",
            "board.lever_arm_b_m = (1.0, 2.0) m of sensor suite generic: must be a list of 3",
        ),
        (
            "board.lever_arm_b_m",
            "0.1",
            "board.lever_arm_b_m = 0.1 m of sensor suite generic: must be a list of 3 numbers",
        ),
        ("gyro.bias_deg_s", "true", "gyro.bias_deg_s = True deg/s of sensor suite generic: must be a number"),
        ("gyro.bias_deg_s", "NaN", "write a plain finite number"),
        ("magnetometer.noise_ut", "1", "sensor suite generic: no magnetometer fitted; choose a suite that has one"),
        ("sensors.airspeed.noise_pa", "1", "sensor suite generic: no airspeed fitted; choose a suite that has one"),
        ("board.lever_arm", "1", "did you mean board.lever_arm_b_m"),
    ],
)
def test_sensor_figure_that_cannot_be_is_refused(name, text, says):
    """One line: the field, the value, the unit, and what would be right."""
    with pytest.raises(ValueError, match=re.escape(says)) as refused:
        override(CONFIG, {name: text})
    assert "\n" not in str(refused.value)


def test_figure_of_a_part_is_changed_where_the_suite_has_it():
    """The suite of the same command counts."""
    config = override(CONFIG, {"magnetometer.noise_ut": "1", "suite": "apm2"})
    assert suite_params(config.suite, config.sensors).magnetometer.noise_ut == 1.0


def test_suite_by_file_is_flown_again_from_the_manifest_alone(mine):
    """The texts go into the resolved configuration; without the files the same flight is flown, bit for bit."""
    scenario = find("crosswind")
    changes = {"suite": str(mine), "duration_s": 2.0, "gyro.gain": 0.0}
    first = fly_config(scenario, override(scenario.config, changes))
    kept = json.loads(json.dumps(first.manifest["config"]))
    assert kept["files"] == {str(mine): MINE, str(mine.parent / "my_accelerometer.toml"): MY_ACCELEROMETER}
    assert kept["rates"]["gps_hz"] == 10.0
    for path in mine.parent.iterdir():
        path.unlink()
    again = fly_config(scenario, FlightConfig(**kept))
    assert again.log.measured.tobytes() == first.log.measured.tobytes()
    assert again.log.truth.tobytes() == first.log.truth.tobytes()


def test_suite_changed_leaves_the_files_of_the_old_one_behind(mine):
    """What is kept belongs to the suite that is named."""
    resolved = resolve(override(CONFIG, {"suite": str(mine)}))
    assert resolved.files
    assert resolve(override(resolved, {"suite": "generic"})).files == {}


def test_suite_file_that_is_not_there_is_refused(tmp_path):
    """By its path."""
    with pytest.raises(ValueError, match=r"sensor suite '.*none\.toml': no such file"):
        override(CONFIG, {"suite": str(tmp_path / "none.toml")})
