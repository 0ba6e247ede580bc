"""The configuration: what people type, what is drawn, what is refused and in which words."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from scenarios.harness.config import (
    AirConfig,
    FlightConfig,
    HandThrowStart,
    InFlightStart,
    override,
    resolve,
)
from scenarios.harness.config.air import Wind, parse_wind
from scenarios.harness.equipping import equipped
from scenarios.harness.flight import prepare_config
from scenarios.harness.registry import find
from sim.clock import Rates
from sim.params import changed
from sim.sensors.fitting import suite_params
from sim.sensors.suite import SUITES

THROW = FlightConfig(start=HandThrowStart(), air=AirConfig(wind_m_s=2.0, wind_from_deg="random"))
CROSS = FlightConfig(air=AirConfig(wind_m_s=5.0, wind_from_deg="cross"), manoeuvre={"height_m": 60.0})


@pytest.mark.parametrize(
    ("text", "wind"),
    [
        ("5@270", Wind(5.0, 270.0)),
        (" 2.5@0 ", Wind(2.5, 0.0)),
        ("5@random", Wind(5.0, "random")),
        ("5@CROSS", Wind(5.0, "cross")),
        ("5@head", Wind(5.0, "head")),
        ("5@tail", Wind(5.0, "tail")),
        ("0", Wind(0.0, 0.0)),
        ("calm", Wind(0.0, 0.0)),
    ],
)
def test_parse_wind_of_what_people_type_is_speed_and_origin(text, wind):
    """Speed at the direction it comes from, or a word for it."""
    assert parse_wind(text) == wind


@pytest.mark.parametrize(
    "text", ["banana", "", "5", "@270", "5@", "-5@270", "5@-90", "5@400", "99@0", "nan@0", "5@270@1"]
)
def test_parse_wind_of_nonsense_is_refused_in_one_line(text):
    """The line shows what was typed and what would be right."""
    with pytest.raises(ValueError, match="wind") as refused:
        parse_wind(text)
    assert repr(text) in str(refused.value)
    assert "5@270" in str(refused.value) or "at most 30 m/s" in str(refused.value)
    assert "\n" not in str(refused.value)


@given(st.floats(0.0, 30.0), st.floats(0.0, 360.0))
def test_parse_wind_of_any_number_reads_it_back(speed, direction):
    """Decimal fractions of any length."""
    wind = parse_wind(f"{speed:.6f}@{direction:.6f}")
    assert wind.m_s == pytest.approx(speed, rel=0, abs=1e-6)
    assert wind.from_deg == pytest.approx(direction, rel=0, abs=1e-6)


def test_override_of_text_changes_exactly_the_field_named():
    """Nested fields, sensors with and without their prefix, wind, and the scenario's own parameters."""
    changes = {
        "duration_s": "90", "rates.gps_hz": "1", "air.turbulence_w20_m_s": "0", "wind": "3@45", "start.height_m": "80",
        "gps.latency_s": "1.0", "sensors.accelerometer.range_g": 6, "manoeuvre.height_m": "70",
        "estimator_params.k_i": "0.05", "seed": 7,
    }  # fmt: skip
    config = override(CROSS, changes)
    assert (config.duration_s, config.rates.gps_hz, config.start.height_m, config.seed) == (90.0, 1.0, 80.0, 7)
    assert config.air == AirConfig(wind_m_s=3.0, wind_from_deg=45.0)
    assert config.sensors == {"gps.latency_s": 1.0, "accelerometer.range_g": 6.0}
    assert config.manoeuvre == {"height_m": 70.0}
    assert config.estimator_params == {"k_i": 0.05}
    assert CROSS.sensors == {}
    untouched = {"aircraft", "estimator", "autopilot", "suite", "flight"}
    assert config.model_dump(include=untouched) == CROSS.model_dump(include=untouched)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"duration_s": "-5"}, ("duration_s = -5 s", "above 0 s")),
        ({"duration_s": "0"}, ("duration_s", "above 0 s")),
        ({"duration_s": "nan"}, ("duration_s", "finite")),
        ({"duration_s": "long"}, ("duration_s = 'long' s", "a number")),
        ({"rates.gps_hz": "3"}, ("GPS rate 3 Hz", "200 Hz", "1, 2, 2.5, 4, 5, 10 Hz")),
        ({"rates.physics_hz": "300"}, ("300 Hz", "100, 200, 400 or 1000")),
        ({"start.heading_deg": "400"}, ("start.heading_deg = 400 deg", "at most 360 deg", "'random'")),
        ({"air.wind_from_deg": "up"}, ("air.wind_from_deg = 'up' deg", "number", "'cross'")),
        ({"air.wind_m_s": "-1"}, ("air.wind_m_s = -1 m/s", "at least 0 m/s")),
        ({"wind": "banana"}, ("'banana'", "5@270")),
        ({"durations": 1}, ("unknown parameter 'durations'", "did you mean duration_s")),
        ({"gps.latency": 1}, ("unknown parameter 'gps.latency'", "gps.latency_s")),
        ({"manoeuvre.hight_m": 1}, ("'manoeuvre.hight_m'", "manoeuvre.height_m")),
        ({"gps.latency_s": "-1"}, ("latency_s = -1.0 s", "at least 0")),
        ({"gps.latency_s": "late"}, ("latency_s = 'late' s", "a number")),
        ({"suite": "genric"}, ("unknown sensor suite 'genric'", "generic")),
        ({"seed": "-1"}, ("seed = -1", "at least 0")),
        ({"seed": "1.5"}, ("seed = 1.5", "whole number")),
        ({"start.kind": "in_flight"}, ("unknown parameter 'start.kind'",)),
    ],
)
def test_override_of_what_cannot_be_is_refused_in_one_line(changes, words):
    """Field, value, unit, and what would be right."""
    with pytest.raises(ValueError, match=r".") as refused:
        override(CROSS, changes)
    for word in words:
        assert word in str(refused.value)
    assert "\n" not in str(refused.value)


def test_calibration_longer_than_the_hold_is_refused():
    """The gyro offset is measured in the hand."""
    with pytest.raises(ValueError, match="calibration_s = 2 s: at most hold_s, the 1 s"):
        override(THROW, {"start.hold_s": "1"})


@pytest.mark.parametrize("config", [THROW, CROSS])
def test_resolve_leaves_nothing_to_chance_and_is_idempotent(config):
    """No "random" is left, a second time changes nothing, and JSON there and back neither."""
    resolved = resolve(config)
    text = resolved.model_dump_json()
    assert "random" not in text
    assert "cross" not in text
    assert resolve(resolved) == resolved
    assert FlightConfig(**json.loads(text)) == resolved


def test_resolve_with_the_same_seed_is_equal_and_with_another_is_not():
    """Drawn by seed and flight number, and by nothing else."""
    again = resolve(THROW)
    assert resolve(THROW) == again
    for other in ({"seed": 1}, {"flight": 1}):
        resolved = resolve(override(THROW, other))
        assert resolved.start.heading_deg != again.start.heading_deg
        assert resolved.start.hand != again.start.hand
        assert resolved.air.wind_from_deg != again.air.wind_from_deg


def test_resolve_of_one_quantity_fixed_draws_the_others_as_before():
    """Each quantity has its own stream: fixing the heading moves neither the hand nor the wind."""
    free, fixed = resolve(THROW), resolve(override(THROW, {"start.heading_deg": "90"}))
    assert fixed.start.heading_deg == 90.0
    assert fixed.start.hand == free.start.hand
    assert fixed.air == free.air


def test_resolve_of_cross_wind_is_square_to_the_heading_from_both_sides():
    """Ninety degrees off the start heading; both sides come up (twenty alike: 2 in a million)."""
    sides = set()
    for seed in range(20):
        config = resolve(override(CROSS, {"seed": seed}))
        sides.add(round((config.air.wind_from_deg - config.heading_deg) % 360.0, 6))
    assert sides == {90.0, 270.0}


@pytest.mark.parametrize(("word", "beside_deg"), [("head", 0.0), ("tail", 180.0)])
def test_resolve_of_head_and_tail_wind_is_along_the_heading(word, beside_deg):
    """Wherever the nose points by chance: a head wind comes from there, a tail wind from behind."""
    for seed in range(5):
        config = resolve(override(THROW, {"wind": f"5@{word}", "seed": seed}))
        beside = (config.air.wind_from_deg - config.heading_deg - beside_deg + 180.0) % 360.0 - 180.0
        assert beside == pytest.approx(0.0, rel=0, abs=1e-9)
        assert 0.0 <= config.air.wind_from_deg < 360.0
        assert resolve(config) == config


def test_resolve_draws_headings_and_winds_uniformly_and_apart():
    """Kolmogorov-Smirnov against uniform over 300 seeds at the 0.1 % level, and no correlation beyond 3.3 sigma."""
    drawn = np.array(
        [(c.heading_deg, c.air.wind_from_deg) for c in (resolve(override(THROW, {"seed": s})) for s in range(300))]
    )
    for column in drawn.T:
        assert stats.kstest(column / 360.0, "uniform").pvalue > 1e-3
    assert abs(np.corrcoef(drawn.T)[0, 1]) < 3.3 / np.sqrt(300)


def test_resolve_draws_hands_within_what_was_asked():
    """Sway never faster than asked, and a twist whose sigma (cut at two) lies within its chi-square bounds."""
    hands = [resolve(override(THROW, {"seed": seed})).start.hand for seed in range(100)]
    assert max(max(hand.sway_deg_s) for hand in hands) <= 3.0
    assert min(min(hand.sway_hz) for hand in hands) >= 0.4
    twists = np.array([hand.release_rate_deg_s for hand in hands]).ravel()
    assert np.abs(twists).max() <= 30.0
    # Clipping a unit normal at 2 leaves a variance of 0.9205 (by quadrature); its own spread is below chi-square's.
    low, high = stats.chi2.ppf([1e-3, 1.0 - 1e-3], len(twists))
    assert low < np.sum(twists**2) / (15.0**2 * 0.9205) < high


def test_suite_params_with_changes_are_those_of_the_suite_but_for_them():
    """The suite itself is never touched."""
    fitted = suite_params("generic", {"gps.latency_s": 1.5})
    assert fitted.gps.latency_s == 1.5
    assert changed(fitted, {"gps.latency_s": SUITES["generic"].gps.latency_s}, "suite") == SUITES["generic"]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"gps.latensy_s": 1.0}, "did you mean gps.latency_s"),
        ({"gyro.bits": 9.5}, "whole number"),
        ({"gyro.bits": "ten"}, "whole number"),
    ],
)
def test_changed_with_what_cannot_be_is_refused(changes, words):
    """By name or by kind."""
    with pytest.raises(ValueError, match=words):
        changed(SUITES["generic"], changes, "suite generic")


def test_rates_config_builds_the_clock_it_names():
    """The configuration adds nothing to the clock."""
    assert resolve(FlightConfig()).rates.build() == Rates()
    assert override(CROSS, {"rates.imu_hz": "100", "rates.gps_hz": "2.5"}).rates.build() == Rates(200, 100, 2.5)


def test_heading_before_it_is_drawn_is_refused():
    """Nobody reads a random heading by mistake."""
    with pytest.raises(ValueError, match="resolve the configuration first"):
        _ = FlightConfig(start=InFlightStart()).heading_deg


def aboard(config):
    """What is known of the instruments under `config`."""
    return prepare_config(find("crosswind"), config, lenient=True).instruments


def given(config, estimator, **settings):
    """The estimator of that name as it flies under `config`."""
    return equipped(estimator, aboard(config), settings)


@pytest.mark.parametrize("name", ["instruments.gps_latency_s", "gps_latency_s"])
def test_property_that_is_set_reaches_whoever_has_a_parameter_for_it(name):
    """And nobody else; a parameter that is set by its own name is stronger."""
    config = override(CROSS, {name: "3", "duration_s": "0.1"})
    assert config.instruments == {"gps_latency_s": 3.0}
    for estimator in ("premerlani", "gps_velocity", "ins_ekf"):
        made = given(config, estimator)
        assert made.code.params.gps_latency_s == 3.0
        assert made.known["gps_latency_s"] == (3.0, "set", "")
    assert given(config, "premerlani", gps_latency_s=1.0).code.params.gps_latency_s == 1.0
    assert given(config, "gyro_only").known == {}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"instruments.gps_latency_s": "soon"}, "gps_latency_s = 'soon': must be a number"),
        ({"instruments.gps_latency_s": -1}, "gps_latency_s = -1: must be a number, zero or more"),
        ({"instruments.gps_stamped": "perhaps"}, "gps_stamped = 'perhaps': must be true or false"),
        ({"instruments.gps_latensy_s": 1}, "did you mean .*gps_latency_s"),
        ({"withheld": "gps_latensy_s"}, "did you mean gps_latency_s"),
    ],
)
def test_property_that_cannot_be_is_refused(changes, words):
    """In one line that names the property."""
    with pytest.raises(ValueError, match=words):
        override(CROSS, changes)


def test_property_that_is_withheld_is_assumed_and_says_so():
    """Nobody is told the 12 s of this receiver; what is set wins over what is withheld."""
    config = override(CROSS, {"gps.latency_s": 12.0, "withheld": "gps_latency_s"})
    assert given(config, "premerlani").known["gps_latency_s"] == (0.3, "withheld", "")
    assert aboard(override(config, {"withheld": ""}))["gps_latency_s"].value == 12.0
    assert aboard(override(config, {"gps_latency_s": 1}))["gps_latency_s"].source == "set"


@pytest.mark.parametrize(
    ("changes", "physics_hz"),
    [
        ({}, 200), ({"rates.imu_hz": 400}, 400), ({"rates.imu_hz": 200}, 200),
        ({"rates.imu_hz": 200, "rates.physics_hz": 1000}, 1000), ({"rates.physics_hz": 400}, 400),
    ],
)  # fmt: skip
def test_physics_runs_at_200_hz_or_as_fast_as_the_inertial_sensors(changes, physics_hz):
    """Unless it is set; a resolved configuration holds the number, and resolves to itself."""
    config = resolve(override(CROSS, changes))
    assert config.rates.physics_hz == physics_hz
    assert config.rates.build().steps_per_tick == physics_hz // config.rates.imu_hz
    assert resolve(config) == config


def test_inertial_rate_that_does_not_divide_a_given_physics_rate_is_refused():
    with pytest.raises(ValueError, match="inertial rate 400 Hz does not divide the physics rate of 1000 Hz"):
        override(CROSS, {"rates.imu_hz": 400, "rates.physics_hz": 1000})
