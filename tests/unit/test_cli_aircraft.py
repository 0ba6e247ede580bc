"""The command `wingslevel aircraft`: page, JSON, picture, refusals."""

import json
from pathlib import Path

import pytest

import wingslevel
from scenarios.harness.cli.app import run

NUMBERS = (
    "glide_ratio", "min_sink_m_s", "stall_speed_m_s", "best_glide_speed_m_s", "top_speed_m_s", "climb_m_s",
    "static_margin", "roll_rate_deg_s",
)  # fmt: skip


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> dict:
    path = tmp_path_factory.mktemp("page") / "endurance.json"
    assert run(["aircraft", "endurance", "--json", str(path)]) == 0
    return json.loads(path.read_text())


def test_json_names_every_number_of_the_page(page):
    assert all(isinstance(page[name], float) and page[name] > 0.0 for name in NUMBERS)
    assert set(page["modes"]) == {"short_period", "phugoid", "roll", "dutch_roll", "spiral"}
    for mode in page["modes"].values():
        assert mode["omega_rad_s"] > 0.0
        assert -1.0 <= mode["damping"] <= 1.0
        assert mode["textbook"]["omega_rad_s"] > 0.0
    assert page["modes"]["spiral"]["period_s"] is None


def test_numbers_of_the_endurance_are_of_its_class(page):
    """Stall 6 to 8 m/s and climb 3 to 6 m/s, as such models fly (measured 6.95 and 4.7)."""
    assert 6.0 < page["stall_speed_m_s"] < 8.0
    assert 3.0 < page["climb_m_s"] < 6.0
    assert page["stall_speed_m_s"] < page["climb_speed_m_s"] < page["top_speed_m_s"]


def test_json_on_standard_output_is_all_that_is_there(capsys):
    assert run(["aircraft", "endurance", "--json", "-"]) == 0
    streams = capsys.readouterr()
    assert json.loads(streams.out)["aircraft"] == "endurance"
    assert "best glide" in streams.err


def test_page_fits_eighty_columns(capsys):
    assert run(["aircraft", "endurance"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(len(line) for line in lines) <= 80
    text = "\n".join(lines)
    for word in ("stall speed", "best climb", "static margin", "Dutch roll", "Level turns", "Cm_alpha"):
        assert word in text


def test_picture_is_drawn(tmp_path: Path):
    """A PNG of the page in print quality, with something on it."""
    path = tmp_path / "page.png"
    assert run(["aircraft", "endurance", "--picture", str(path)]) == 0
    data = path.read_bytes()
    assert data.startswith(b"\x89PNG")
    width, height = (int.from_bytes(data[i : i + 4], "big") for i in (16, 20))
    assert (width, height) == (2100, 1710)
    assert len(data) > 100_000  # an empty page of this size has 10 kB


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["spitfire"], "unknown aircraft 'spitfire': choose"),
        (["endurance", "--set", "airframe.mass=1"], "unknown parameter 'airframe.mass': did you mean airframe.mass_f"),
        (["endurance", "--set", "airframe.mass_factor=x"], "airframe.mass_factor = 'x': must be a number"),
        (["endurance", "--set", "airframe.cg_aft=0.4"], "airframe.cg_aft = 0.4: diverges in pitch"),
        (["gentle_lady", "--set", "airframe.thrust_factor=0.9"], "'gentle_lady' has no motor"),
        (["endurance", "--picture", "page.doc"], "page.doc: end the name in .png"),
        (["endurance", "--picture", "no/such/page.png"], "there is no folder"),
        (["endurance", "--json", "no/such/page.json"], "there is no folder"),
    ],
)
def test_mistake_is_one_line_and_code_2(arguments, words, capsys):
    assert run(["aircraft", *arguments]) == 2
    streams = capsys.readouterr()
    assert streams.out == ""
    assert len(streams.err.splitlines()) == 1
    assert words in streams.err


def test_page_of_an_aeroplane_that_is_not_as_drawn(page, capsys):
    """A fifth heavier: the stall speed grows with the root of that, and the page says why."""
    assert run(["aircraft", "endurance", "--set", "airframe.mass_factor=1.2", "--json", "-"]) == 0
    streams = capsys.readouterr()
    heavy = json.loads(streams.out)
    assert heavy["stall_speed_m_s"] == pytest.approx(1.2**0.5 * page["stall_speed_m_s"], rel=0.01)
    assert (heavy["airframe"]["mass_factor"], page["airframe"]["mass_factor"]) == (1.2, 1.0)
    assert "Not as drawn: airframe.mass_factor = 1.2." in streams.err
    assert wingslevel.aircraft("endurance", {"airframe.mass_factor": 1.2}).to_json() == heavy
