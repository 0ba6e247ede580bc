"""The public API: pages and measurements, recordings shown and exported."""

import json
import sys
from pathlib import Path
from typing import Any

import pytest

import wingslevel as wl
from scenarios.harness.cli.app import run
from scenarios.harness.commands import view as viewing


def told(capsys: pytest.CaptureFixture[str], *arguments: str) -> Any:
    """What the command writes as JSON."""
    run([*arguments, "--json", "-"])
    return json.loads(capsys.readouterr().out)


def test_aircraft_page_is_that_of_the_command(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Names without an argument, the page with one, its picture in a file."""
    assert set(wl.aircraft()) == {"endurance", "gentle_lady"}
    page = wl.aircraft("endurance")
    assert page.to_json() == told(capsys, "aircraft", "endurance")
    assert page.passed
    assert repr(page) == "<Report aircraft endurance>"
    assert "endurance" in page._repr_html_()
    assert page[page.keys()[0]] == page.to_json()[page.keys()[0]]
    assert page.picture(tmp_path / "page.svg").read_text(encoding="utf-8").startswith("<?xml")
    for path, message in (
        (tmp_path / "page.txt", r"\.png, \.svg or \.pdf"),
        ("/proc/nowhere/page.png", "cannot write"),
    ):
        with pytest.raises(wl.WingslevelError, match=message):
            page.picture(path)


def test_sensor_pages_are_those_of_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    """Names of suites, and the page of a part."""
    listed = told(capsys, "list", "suites")["suites"]
    assert wl.sensors() == {name: one["about"] for name, one in listed.items()}
    page = wl.sensors("hmc5843")
    assert page.to_json() == told(capsys, "sensors", "hmc5843")


def test_bench_measures_a_class() -> None:
    """Numbers with the names of the command, in few repeats; a class may be given."""

    class Level:
        def update(self, m: wl.Measurements) -> wl.AttitudeEstimate:
            import numpy as np

            return wl.AttitudeEstimate(np.eye(3))

    report = wl.bench(Level, seconds=2, repeats=3)
    assert report["estimator_update_ns"] > 0.0
    assert report.passed == report["passed"]
    assert repr(report).startswith("<Report bench ")


def test_claims_are_tested(capsys: pytest.CaptureFixture[str]) -> None:
    """One of them, as the command does."""
    name = "rotations_do_not_commute"
    from scenarios.harness.claims.run import claims

    name = name if name in claims() else min(claims(), key=lambda n: claims()[n].seeds)
    report = wl.claims(name, workers=1)
    assert report.to_json() == told(capsys, "claims", name, "--workers", "1")
    assert report.passed


def test_agreement_of_a_verdict_with_itself(tmp_path: Path) -> None:
    """It agrees; with another value it does not."""
    data = wl.check("crosswind", seeds=0, duration=2, workers=1).to_json()
    (tmp_path / "one.json").write_text(json.dumps(data))
    assert wl.agree(tmp_path / "one.json", tmp_path / "one.json").passed
    data["flights"][0]["outcome"] = "diverged"
    (tmp_path / "two.json").write_text(json.dumps(data))
    assert not wl.agree(tmp_path / "one.json", tmp_path / "two.json", report_only=()).passed


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: wl.aircraft("albatros"), "albatros"),
        (lambda: wl.sensors("nothing"), "nothing"),
        (lambda: wl.bench("nobody"), "nobody"),
        (lambda: wl.bench(seconds=1), "2 to 3600"),
        (lambda: wl.claims("nothing*"), "nothing"),
        (lambda: wl.agree("a.json", "b.json"), "a.json"),
        (lambda: wl.agree("a.json", "b.json", tolerance=-1), "tolerance"),
        (lambda: wl.view("nowhere"), "nowhere"),
        (lambda: wl.export("nowhere", csv="x.csv"), "nowhere"),
        (lambda: wl.parameters("nobody"), "nobody"),
    ],
)
def test_pages_refuse_in_one_line(call: Any, message: str) -> None:
    """With what would be right."""
    with pytest.raises(wl.WingslevelError, match=message) as refused:
        call()
    assert "\n" not in str(refused.value)


def test_export_writes_what_the_command_writes(tmp_path: Path) -> None:
    """Of a flight in memory and of its recording, byte for byte; the text log replays with its map."""
    flight = wl.fly("hand_launch", duration=20)
    folder = flight.save(tmp_path / "flight", rerun=False)
    run(["export", str(folder), *(f"--{kind}={tmp_path / f'command.{kind}'}" for kind in ("nmea", "ubx", "csv"))])
    files = flight.export(nmea=tmp_path / "a.nmea", ubx=tmp_path / "a.ubx", csv=tmp_path / "a.csv")
    assert [path.name for path in files] == ["a.nmea", "a.ubx", "a.csv", "a.toml"]
    wl.export(folder, ubx=tmp_path / "b.ubx")
    for kind in ("nmea", "ubx", "csv"):
        assert (tmp_path / f"a.{kind}").read_bytes() == (tmp_path / f"command.{kind}").read_bytes()
    assert (tmp_path / "b.ubx").read_bytes() == (tmp_path / "a.ubx").read_bytes()
    assert wl.replay(tmp_path / "a.csv", columns=tmp_path / "a.toml").passed
    with pytest.raises(wl.WingslevelError, match="nmea, ubx or csv"):
        flight.export()


def test_view_shows_a_flight_that_is_not_recorded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a display one line says what to do; nothing else happens."""
    if sys.platform != "linux":
        pytest.skip("a display is always there")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    flight = wl.fly("crosswind", duration=1)
    with pytest.raises(wl.WingslevelError, match="web"):
        flight.view()
    shown: list[tuple[Path, bool]] = []
    monkeypatch.setattr(viewing, "open_flight", lambda path, *, web: shown.append((path, web)))
    flight.view(web=True)
    ((path, web),) = shown
    assert (path.suffix, web, path.stat().st_size > 1000) == (".rrd", True, True)
