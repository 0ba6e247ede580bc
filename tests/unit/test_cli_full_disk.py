"""A full disk: what was flown is judged and reported, what cannot be written is told on one line, nothing is left."""

import json
import resource
from contextlib import contextmanager
from pathlib import Path

import pytest

from scenarios.harness.cli import reports as cli_reports
from scenarios.harness.cli.app import run
from sim import recording
from sim.view import rerun_view

FLY = ["fly", "hand_launch", "--duration", "2", "--out", "flights"]


@contextmanager
def full(size):
    """No file may grow beyond `size` bytes: as on a full disk, the system refuses to write."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.fixture(scope="module")
def sizes(tmp_path_factory):
    """Sizes of the files of the recording that is written here, where there is room."""
    folder = tmp_path_factory.mktemp("room")
    run([*FLY[:-1], str(folder)])
    return {path.name: path.stat().st_size for path in folder.glob("*/*")}


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch, sizes):
    monkeypatch.chdir(tmp_path)


def test_fly_without_room_for_the_rerun_recording_keeps_the_parquet(sizes, capfd):
    """The flight is there, can be read and is complete; one line names what is missing; the command fails."""
    assert sizes["flight.rrd"] > 2 * sizes["flight.parquet"]
    with full(sizes["flight.rrd"] - 1000):
        assert run([*FLY, "--json", "f.json"]) == 2
    said = capfd.readouterr()
    folder = Path(json.loads(Path("f.json").read_text())["recording"])
    assert said.err == f"wingslevel: cannot write to {folder}/flight.rrd: File too large\n"
    assert f"recording   {folder}" in said.out
    assert {path.name for path in folder.iterdir()} == {"flight.parquet", "manifest.json"}
    assert len(recording.load(folder).log) > 0


@pytest.mark.parametrize("room", [0.1, 0.99])
def test_fly_without_room_for_the_recording_still_judges_and_reports(sizes, capfd, room):
    """No folder is left, hidden or not; the verdict is printed, and its JSON written."""
    with full(int(room * sizes["flight.parquet"])):
        assert run([*FLY, "--json", "f.json"]) == 2
    said = capfd.readouterr()
    assert "hand_launch, premerlani, seed 0" in said.out
    assert "recording  " not in said.out
    assert said.err.startswith("wingslevel: cannot write to flights/hand_launch-premerlani-seed0")
    assert (said.err.count("\n"), ".tmp" in said.err) == (1, False)
    assert json.loads(Path("f.json").read_text())["recording"] is None
    assert [path.name for path in Path().iterdir()] == ["f.json"]


def test_fly_without_room_for_the_report_is_refused_before_the_flight(capfd):
    """The device that is always full: one line, and nothing is flown or written."""
    assert run([*FLY, "--no-rerun", "--json", "/dev/full"]) == 2
    said = capfd.readouterr()
    assert said.out == ""
    assert said.err == "wingslevel: cannot write to /dev/full: no space left on device\n"
    assert not Path("flights").exists()


def test_aircraft_one_report_without_room_does_not_lose_the_other(capfd):
    """A picture that cannot be written: the page is printed and its JSON written."""
    with full(60_000):
        assert run(["aircraft", "endurance", "--picture", "p.png", "--json", "s.json"]) == 2
    said = capfd.readouterr()
    assert said.err.endswith("cannot write to p.png: File too large\n")
    assert said.out
    assert [path.name for path in Path().iterdir()] == ["s.json"]


def test_write_outside_a_command_raises(tmp_path):
    """Where nobody collects what is lost, it is an error."""
    with full(10), pytest.raises(Exception, match=r"cannot write to .*x\.json: File too large"):
        cli_reports.write(tmp_path / "x.json", lambda: "x" * 100)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("spoil", [lambda d: d[:-1], lambda d: d[:1000], lambda d: b"", lambda d: d[:5000] + d[6000:]])
def test_rerun_recording_that_is_not_complete_is_noticed(spoil):
    """The footer says how long the whole is."""
    run([*FLY, "--no-rerun"])
    (folder,) = Path("flights").iterdir()
    data = rerun_view.write(recording.load(folder), "whole.rrd").read_bytes()
    assert rerun_view._is_complete(data)
    assert not rerun_view._is_complete(spoil(data))
