"""The air on the command line and in the configuration: what is typed, drawn, refused, and what is flown."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.harness.cli.app import run
from scenarios.harness.config import FlightConfig, override, resolve
from scenarios.harness.config.air import AirConfig, GustConfig, build_air, parse_gust, parse_turbulence
from sim.air import STILL
from sim.recording import load

NORTH = FlightConfig()


@pytest.mark.parametrize(
    ("text", "gust"),
    [
        ("4@12s", GustConfig(m_s=4.0, start_s=12.0)),
        ("4@12", GustConfig(m_s=4.0, start_s=12.0)),
        (" -2.5@0s/3S ", GustConfig(m_s=-2.5, start_s=0.0, length_s=3.0)),
        ("4@12s:along", GustConfig(m_s=4.0, start_s=12.0)),
        ("4@12s/1s:ACROSS", GustConfig(m_s=4.0, start_s=12.0, length_s=1.0, from_deg="across")),
        ("4@12s:90", GustConfig(m_s=4.0, start_s=12.0, from_deg=90.0)),
        ("4@12s:up", GustConfig(m_s=0.0, up_m_s=4.0, start_s=12.0, from_deg=0.0)),
        ("4@12s:down", GustConfig(m_s=0.0, up_m_s=-4.0, start_s=12.0, from_deg=0.0)),
    ],
)
def test_parse_gust_of_what_people_type(text, gust):
    """Speed at start, length after a slash, direction after a colon; a lull has a minus."""
    assert parse_gust(text) == gust


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("banana", "4@12s"),
        ("4", "4@12s"),
        ("@12s", "4@12s"),
        ("4@12s/", "4@12s"),
        ("4@12s:sideways", ":across"),
        ("4@12s:up:down", "4@12s"),
        ("nan@12s", "4@12s"),
        ("99@12s", "99 m/s is too much, at most 30 m/s"),
        ("4@-1s", "starts at -1 s; it must start 0 to 36000 s"),
        ("4@12s/0s", "is 0 s long; it must be above 0"),
        ("4@12s:400", "400 deg is outside 0 to 360 deg"),
    ],
)
def test_parse_gust_of_nonsense_is_refused_in_one_line(text, words):
    """The line shows what was typed and what would be right."""
    with pytest.raises(ValueError, match=r"gust = ") as refused:
        parse_gust(text)
    assert repr(text) in str(refused.value)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


@given(st.text(max_size=12))
def test_parse_gust_of_any_text_is_a_gust_or_a_value_error(text):
    """Nothing that is typed crashes it."""
    try:
        gust = parse_gust(text)
    except ValueError:
        return
    assert isinstance(gust, GustConfig)


@pytest.mark.parametrize(
    ("text", "w20"),
    [("calm", 0.0), ("light", 7.72), ("Moderate", 15.43), ("severe ", 23.15), ("3", 3.0), ("0.5", 0.5), ("0", 0.0)],
)
def test_parse_turbulence_of_words_and_numbers_is_the_wind_at_20_ft(text, w20):
    """15, 30 and 45 knots have names in MIL-F-8785C."""
    assert parse_turbulence(text) == w20


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"air.turbulence_w20_m_s": "lots"}, ("turbulence = 'lots'", "calm, light, moderate, severe")),
        ({"air.turbulence_w20_m_s": "-1"}, ("air.turbulence_w20_m_s = -1", "at least 0 m/s")),
        ({"air.turbulence_w20_m_s": "nan"}, ("air.turbulence_w20_m_s = nan m/s", "finite")),
        ({"air.thermals": "some"}, ("thermals = 'some'", "whole number from 0 to 20")),
        ({"air.thermals": "21"}, ("thermals = '21'", "whole number from 0 to 20")),
        ({"air.thermals": 1.5}, ("thermals = 1.5", "whole number")),
        ({"air.shear": "steep"}, ("air.shear = 'steep'", "a number")),
        ({"air.shear": "2"}, ("air.shear = 2", "at most 1")),
        ({"air.gusts": ["4@12s", "x"]}, ("gust = 'x'", "4@12s")),
        ({"air.inversion_m": "5"}, ("air.inversion_m = 5 m", "at least 100 m")),
        ({"air.thermal_m_s": "-1"}, ("air.thermal_m_s = -1 m/s", "at least 0 m/s")),
        ({"air.gust": "4@12s"}, ("unknown parameter 'air.gust'", "air.gusts")),
    ],
)
def test_override_of_air_that_cannot_be_is_refused_in_one_line(changes, words):
    """Field, value, unit, and what would be right."""
    with pytest.raises(ValueError, match=r".") as refused:
        override(NORTH, changes)
    for word in words:
        assert word in str(refused.value)
    assert "\n" not in str(refused.value)


def test_resolve_leaves_plain_numbers_that_are_the_same_air_again():
    """Directions of gusts follow the wind, thermals have places; JSON there and back, and idempotent."""
    typed = {"wind": "5@random", "air.gusts": "4@12s,2@20s:across,1@5s:up", "air.thermals": "3", "air.shear": "0.14"}
    config = resolve(override(NORTH, typed))
    text = config.air.model_dump_json()
    assert not any(word in text for word in ("random", "along", "across", "cross", '"up"'))
    from_deg = config.air.wind_from_deg
    assert [g.from_deg for g in config.air.gusts] == pytest.approx([from_deg, (from_deg + 90.0) % 360.0, 0.0])
    assert len(config.air.thermals) == 3
    assert resolve(config) == config
    assert FlightConfig(**json.loads(config.model_dump_json())) == config
    other = resolve(override(NORTH, typed | {"seed": 1}))
    assert other.air.thermals != config.air.thermals


def test_thermals_and_gusts_draw_nothing_from_other_streams():
    """With or without them wind and heading come out the same."""
    plain = resolve(override(NORTH, {"wind": "5@random"}))
    more = resolve(override(NORTH, {"wind": "5@random", "air.thermals": "3", "air.gusts": "4@12s"}))
    assert (more.air.wind_from_deg, more.start) == (plain.air.wind_from_deg, plain.start)


def test_build_air_turns_where_it_comes_from_into_where_it_goes():
    """A west wind blows east; a gust from the east blows west; one upwards has a negative down."""
    typed = {"wind": "5@270", "air.shear": 0.2, "air.gusts": ["4@12s/3s", "2@1s:90", "1@5s:up"]}
    air = build_air(resolve(override(NORTH, typed | {"air.turbulence_w20_m_s": "moderate"})).air)
    np.testing.assert_allclose(air.wind_e_m_s, (0.0, 5.0, 0.0), rtol=0, atol=1e-12)
    peaks = [gust.peak_e_m_s for gust in air.gusts]
    np.testing.assert_allclose(peaks, [(0, 4, 0), (0, -2, 0), (0, 0, -1)], rtol=0, atol=1e-12)
    assert [(gust.start_s, gust.length_s) for gust in air.gusts] == [(12.0, 3.0), (1.0, 2.0), (5.0, 2.0)]
    assert (air.shear, air.turbulence_w20_m_s, air.thermals.places_e_m) == (0.2, 15.43, ())


def test_build_air_of_what_is_not_resolved_is_refused():
    """Nobody flies in a random wind by mistake."""
    for air in (AirConfig(wind_from_deg="random"), AirConfig(thermals=2), AirConfig(gusts=("4@1s",), thermals=())):
        with pytest.raises(ValueError, match="resolve the configuration first"):
            build_air(air)


def test_build_air_of_the_default_is_still():
    """Nothing blows unless asked for."""
    assert build_air(resolve(NORTH).air).is_steady
    assert not any(build_air(resolve(NORTH).air).wind_e_m_s)
    assert STILL.is_steady


def test_command_line_of_all_air_reaches_the_manifest_in_plain_numbers(tmp_path, monkeypatch):
    """Several gusts, a word for turbulence, a number of thermals; several of them in one go."""
    monkeypatch.chdir(tmp_path)
    run(
        [
            *("fly", "hand_launch", "--no-rerun", "--duration", "1", "--wind", "5@270", "--shear", "0.14"),
            *("--gust", "4@12s", "--gust", "2@1s:up", "--turbulence", "moderate", "--thermals", "3"),
        ]
    )
    (folder,) = (tmp_path / "flights").iterdir()
    air = load(folder).manifest["config"]["air"]
    assert (air["wind_m_s"], air["wind_from_deg"], air["shear"]) == (5.0, 270.0, 0.14)
    assert air["turbulence_w20_m_s"] == 15.43
    assert [(g["m_s"], g["up_m_s"], g["start_s"], g["from_deg"]) for g in air["gusts"]] == [
        (4.0, 0.0, 12.0, 270.0),
        (0.0, 2.0, 1.0, 0.0),
    ]
    assert np.isfinite(np.array(air["thermals"], dtype=float)).all()
    assert np.shape(air["thermals"]) == (3, 2)


@pytest.mark.parametrize("command", [("fly", "hand_launch"), ("check", "hand_launch", "--seeds", "0")])
@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--wind", "banana"), "5@270"),
        (("--shear", "x"), "air.shear = 'x': must be a number"),
        (("--gust", "banana"), "gust = 'banana': write speed@start, for instance 4@12s"),
        (("--turbulence", "lots"), "turbulence = 'lots': write calm, light, moderate, severe"),
        (("--thermals", "lots"), "thermals = 'lots': write their number"),
    ],
)
def test_command_line_air_that_makes_no_sense_is_one_line(command, arguments, says, tmp_path, monkeypatch, capfd):
    """On fly and on check, before anything is flown or written."""
    monkeypatch.chdir(tmp_path)
    assert run([*command, *arguments]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert says in line
    assert not list(tmp_path.iterdir())
