"""The command `wingslevel sensors`: list, page, JSON, picture, refusals; on two short records instead of hours."""

import json
import math
import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from scenarios.harness.cli.app import run
from scenarios.harness.commands import sensor_names
from scenarios.harness.commands import sensors as sensor_page
from sim.clock import Rates
from sim.params import unit_of, words_of
from sim.sensors import trial as sensor_trial
from sim.sensors.board import BoardParams
from sim.sensors.datasheet import GENERIC, PERFECT, part_names
from sim.sensors.fitting import SUITES
from sim.sensors.gps import GpsParams
from sim.truth import gravity_m_s2


@pytest.fixture
def short(monkeypatch):
    """Ten minutes at rest, twice."""
    whole = sensor_page.make
    monkeypatch.setattr(sensor_page, "make", lambda subject, advance: whole(subject, advance, flights=2, seconds=600.0))


def page_json(tmp_path: Path, name: str) -> dict:
    path = tmp_path / "page.json"
    assert run(["sensors", name, "--json", str(path)]) == 0
    return json.loads(path.read_text())


def test_list_names_every_part_and_suite_within_eighty_columns(capsys):
    assert run(["sensors"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(len(line) for line in lines) <= 80
    first_words = {line.split()[0] for line in lines if line.strip()}
    assert {*part_names(), *SUITES} <= first_words


def test_list_as_json_says_what_a_suite_is_made_of(capsys):
    assert run(["sensors", "--json", "-"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert set(data["parts"]) == set(part_names())
    assert data["parts"]["itg3200"]["sensors"] == ["gyro"]
    assert data["suites"]["devboard_red"]["gyro"] == "lisy300al"


@pytest.mark.parametrize("spelling", ["itg3200", "ITG-3200", "Itg_3200"])
def test_part_is_found_however_it_is_spelt(spelling):
    assert sensor_names.subject(spelling).name == "ITG-3200"


def test_suite_and_generic_are_found():
    """A suite before a part of the same name: generic is both."""
    assert sensor_names.subject("Devboard-Green").members["gyro"] == "adxrs401"
    assert sensor_names.subject("generic").members


def test_json_has_measured_and_stated_noise_of_gyro_and_accelerometer(short, tmp_path):
    data = page_json(tmp_path, "MPU-6000")
    assert data["part"] == "MPU-6000"
    assert data["gyro"]["noise_density"]["unit"] == "deg/s/sqrt(Hz)"
    assert data["gyro"]["noise_density"]["datasheet"] == 0.005
    assert data["accelerometer"]["noise_density"]["datasheet"] == 400.0
    for kind in ("gyro", "accelerometer"):
        density = data[kind]["noise_density"]
        # White noise over 2 x 3 records of 30 000 samples scatters by well under 1 %.
        assert density["measured"] == pytest.approx(density["datasheet"], rel=0.02)
        assert data[kind]["bias_instability"]["measured"] > 0.0
        assert data[kind]["axis_hours"] == pytest.approx(1.0)


def test_page_of_one_part_fits_eighty_columns_and_gives_sources(short, capsys):
    assert run(["sensors", "mpu6000"]) == 0
    text = capsys.readouterr().out
    assert max(len(line) for line in text.splitlines()) <= 80
    for words in ("PS-MPU-6000A", "typical", "noise density", "bias instability", "sigma of a sample", "full scale"):
        assert words in text


def test_own_part_without_bias_instability_has_none_stated(short, tmp_path):
    """A file of one's own; where it is silent, `datasheet` is null and the measured figure is there."""
    part = tmp_path / "my_gyro.toml"
    part.write_text(
        'name = "Mine"\nmaker = "me"\nsummary = "a gyro"\ndatasheet = "none, measured on the bench"\n[gyro]\n'
        'noise_density_deg_s_sqrt_hz = { value = 0.02, source = "bench" }\n'
        'range_deg_s = { value = 250.0, source = "bench" }\n'
    )
    instability = page_json(tmp_path, str(part))["gyro"]["bias_instability"]
    assert instability["datasheet"] is None
    assert 0.0 <= instability["measured"] < 0.02


@pytest.mark.parametrize(
    ("name", "ending"), [("apm2", "png"), ("itg3200", "svg"), ("hmc5843", "pdf"), ("ls20031", "png")]
)
def test_picture_is_drawn(short, tmp_path, name, ending):
    """Every sensor there is, in every format."""
    path = tmp_path / f"page.{ending}"
    assert run(["sensors", name, "--picture", str(path)]) == 0
    assert path.stat().st_size > 15_000


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["itg3201"], "did you mean itg3200"),
        (["Devboard-Gren"], "did you mean devboard_green"),
        (["nonsense.toml"], "no such file"),
        (["itg3200", "--picture", "page.gif"], ".png, .svg, .pdf"),
        (["--picture", "page.png"], "name the part"),
    ],
)
def test_refusal_is_one_line_and_code_2(capsys, arguments, words):
    assert run(["sensors", *arguments]) == 2
    streams = capsys.readouterr()
    assert words in streams.err
    assert len(streams.err.splitlines()) == 1
    assert streams.out == ""


@pytest.mark.parametrize(("kind", "rate_hz"), [("magnetometer", 75.0), ("gps", 7.0), ("barometer", 60.0)])
def test_page_of_a_rate_that_cannot_be_tried_is_refused_in_one_line(tmp_path, capsys, kind, rate_hz):
    """Before anything is computed, with the file and what would be right."""
    part = tmp_path / "mine.toml"
    part.write_text(
        f'name = "Mine"\nmaker = "me"\nsummary = "mine"\ndatasheet = "none"\n[{kind}]\n'
        f'rate_hz = {{ value = {rate_hz}, source = "typical" }}\n'
    )
    assert run(["sensors", str(part)]) == 2
    streams = capsys.readouterr()
    assert streams.out == ""
    assert len(streams.err.splitlines()) == 1
    assert f"mine.toml: {'GPS' if kind == 'gps' else kind} rate {rate_hz:g} Hz" in streams.err
    assert "choose" in streams.err


def test_json_says_where_each_figure_comes_from(short, tmp_path):
    """So that a `datasheet` figure that is only typical can be told from one that the data sheet has."""
    sources = page_json(tmp_path, "ms5611")["barometer"]["sources"]
    assert sources["drift_pa_min"] == "typical"
    assert "0.012 mbar" in sources["noise_pa"]


def test_every_figure_with_a_unit_in_its_name_shows_it():
    """Weather's drift is in Pa/min."""
    assert (unit_of("drift_pa_min"), words_of("drift_pa_min")) == ("Pa/min", "drift")
    assert (unit_of("noise_pa"), words_of("noise_pa")) == ("Pa", "noise")


def test_no_two_figures_of_a_part_or_board_are_called_alike():
    """Rows of one table with different units have different words."""
    for params in [*GENERIC.values(), BoardParams()]:
        words = [words_of(f.name) for f in fields(params)]
        assert len(set(words)) == len(words), words
    assert (words_of("bias_per_k_deg_s"), words_of("gain_per_k")) == ("bias per kelvin", "gain per kelvin")
    assert (words_of("hard_iron_b_ut"), words_of("sensitivity_mv_g")) == ("hard iron, body axes", "sensitivity")


def test_page_of_a_suite_has_its_board_its_changes_and_what_a_wrong_supply_reads(short, tmp_path, capsys):
    """Green board: an absolute null through a ratiometric converter, V0 / (1 + e) - V0 of the null in deg/s."""
    gyro = sensor_names.subject("adxrs401").devices["gyro"]
    data = page_json(tmp_path, "devboard_green")
    assert data["settings"]["board.supply_tolerance"] == 0.005
    assert data["settings"]["board.converter.reference_v"] == 5.0
    effects = data["gyro"]["effects"]
    shift = gyro.null_deg_s * (1.0 / 1.005 - 1.0)
    assert effects["at rest, supply 0.5 % high, its sigma (deg/s)"] == pytest.approx(shift, rel=1e-12)
    assert effects["at rest, supply 0.2 % low, full throttle (deg/s)"] == pytest.approx(
        gyro.null_deg_s * (1.0 / 0.998 - 1.0), rel=1e-12
    )
    assert not any("supply" in what for what in data["accelerometer"]["effects"])  # ratiometric as the converter
    assert run(["sensors", "devboard_green"]) == 0
    text = capsys.readouterr().out
    for words in ("board: supply tolerance", "board converter: reference", "accelerometer: bias", "supply 0.5 % high"):
        assert words in text


def test_exercise_is_the_motion_it_says():
    """Rates and forces of the closed form are the derivatives of its attitude and path."""
    motion, dt_s = sensor_trial.Exercise(), 1e-4
    t_s = np.arange(0.0, motion.seconds, 0.01)
    before, at, after = motion.at(t_s - dt_s), motion.at(t_s), motion.at(t_s + dt_s)
    velocity, force = ((a - b) / (2 * dt_s) for a, b in ((after.p_e_m, before.p_e_m), (after.v_e_m_s, before.v_e_m_s)))
    # Central differences are wrong by dt^2 / 6 of a third derivative, below 1e3 here, and by round-off over dt.
    np.testing.assert_allclose(velocity, at.v_e_m_s, rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(force, at.a_e_m_s2, rtol=0.0, atol=1e-5)
    turn = np.swapaxes(at.R_eb, 1, 2) @ (after.R_eb - before.R_eb) / (2 * dt_s)
    np.testing.assert_allclose(turn[:, 2, 1], at.omega_b_rad_s[:, 0], rtol=0.0, atol=1e-5)
    assert math.degrees(at.omega_b_rad_s[:, 0].max()) == pytest.approx(120.0, abs=0.1)


def test_perfect_sensors_repeat_the_exercise():
    """Without errors the reading is the truth: specific force level at rest is (0, 0, -g)."""
    log = sensor_trial.exercise({kind: PERFECT[kind] for kind in ("gyro", "accelerometer")})
    np.testing.assert_allclose(log.measured["gyro_b_rad_s"], log.truth["imu_omega_b_rad_s"], rtol=0.0, atol=1e-12)
    g = gravity_m_s2(math.radians(sensor_trial.LATITUDE_DEG))
    np.testing.assert_allclose(log.measured["force_b_m_s2"][0], (0.0, 0.0, -g), rtol=0.0, atol=0.01)


@pytest.mark.parametrize(("filter_s", "latency_s", "rate_hz"), [(1.0, 0.3, 4.0), (0.5, 0.1, 10.0), (1.0, 0.0, 1.0)])
def test_step_of_speed_is_reported_after_filter_latency_and_half_an_interval(filter_s, latency_s, rate_hz):
    """A first-order lag does 63 % in its time constant; the next report comes half an interval later on average."""
    response = sensor_trial.respond(GpsParams(filter_s=filter_s, latency_s=latency_s, rate_hz=rate_hz))
    expected_s = filter_s + latency_s + 0.5 / rate_hz
    # Delivery waits for the end of a tick, 20 ms; eight phases sample an interval to a sixteenth of it.
    assert response.speed_delay_s == pytest.approx(expected_s, abs=0.025 + 1.0 / (16.0 * rate_hz))


def test_speed_reported_in_the_quarter_turn_shrinks_as_the_filter_has_it():
    """Least length of the velocity vector out of a first-order lag during 2 s at 45 deg/s, by its closed form."""
    T_s, rate_rad_s, speed_m_s = 1.0, math.pi / 4.0, 12.0
    t_s = np.linspace(0.0, 6.0, 6001)
    # Complex velocity: V exp(i w t) for t < 2 s, then V i; y' = (u - y) / T from y = V.
    turning = (np.exp(1j * rate_rad_s * t_s) + 1j * rate_rad_s * T_s * np.exp(-t_s / T_s)) / (1 + 1j * rate_rad_s * T_s)
    end = turning[2000]
    y = np.where(t_s <= 2.0, turning, 1j + (end - 1j) * np.exp(-(t_s - 2.0) / T_s))
    response = sensor_trial.respond(GpsParams(filter_s=T_s, rate_hz=10.0))
    assert response.least_speed_m_s == pytest.approx(speed_m_s * np.abs(y).min(), abs=0.02)


def test_perfect_compass_and_air_data_have_no_error():
    """The heading of a perfect magnetometer, and the readings of perfect air data, are the truth."""
    assert sensor_trial.turn_around(PERFECT["magnetometer"]).heading_rms_deg < 0.01
    log = sensor_trial.swing({kind: PERFECT[kind] for kind in ("airspeed", "barometer")})
    for kind in ("airspeed", "barometer"):
        assert np.abs(sensor_trial.air_errors(log, kind)).max() < 1e-6


def test_sigma_of_a_sample_is_what_the_density_makes_at_50_hz():
    """n sqrt(f / 2), from the fitted white noise."""
    rest = sensor_trial.at_rest("gyro", GENERIC["gyro"], flights=2, seconds=600.0)
    expected = GENERIC["gyro"].noise_density_deg_s_sqrt_hz * math.sqrt(Rates().imu_hz / 2.0)
    assert rest.sample_sigma == pytest.approx(expected, rel=0.02)


def test_sigma_of_a_sample_has_what_folds_down_into_it():
    """ITG-3200, read once a tick: its density over the noise bandwidth of its filter, pi/2 42 Hz."""
    params = sensor_names.subject("itg3200").devices["gyro"]
    rest = sensor_trial.at_rest("gyro", params, flights=2, seconds=600.0)
    assert rest.sample_sigma == pytest.approx(0.03 * math.sqrt(math.pi / 2.0 * 42.0), rel=0.02)


def test_manual_lists_every_part_and_suite_and_its_examples_can_be_flown(tmp_path):
    """docs/sensors.md: the tables are complete, and the part and the suite of one's own are accepted as written."""
    manual = (Path(__file__).parents[2] / "docs" / "sensors.md").read_text(encoding="utf-8")
    missing = [name for name in [*part_names(), *SUITES] if f"| `{name}` |" not in manual]
    assert not missing
    part, suite = re.findall(r"```toml\n(.*?)```", manual, re.DOTALL)
    (tmp_path / "my_gyro.toml").write_text(part)
    (tmp_path / "my_board.toml").write_text(suite)
    subject = sensor_names.subject(str(tmp_path / "my_board.toml"))
    assert subject.devices["gyro"].noise_density_deg_s_sqrt_hz == 0.01
    assert subject.members["gps"] == "ls20031"


def test_step_of_a_reading_is_that_of_the_data_sheet():
    """ITG-3200: 14.375 counts per deg/s (PS-ITG-3200A-00-01.4, section 3.1)."""
    gyro = sensor_names.subject("itg3200").devices["gyro"]
    assert sensor_trial.step("gyro", gyro) == pytest.approx(1.0 / 14.375, rel=1e-4)
