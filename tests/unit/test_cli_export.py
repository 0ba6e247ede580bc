"""The command `export`: a recorded flight as the messages of its receiver."""

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from scenarios.harness.cli.app import run
from sim import gps_messages, recording
from sim.gps_messages import LAUNCH, START

FLIGHT = "hand_launch-premerlani-seed0"


@pytest.fixture(scope="module")
def flown(tmp_path_factory) -> Path:
    """The recording of a short flight."""
    folder = tmp_path_factory.mktemp("export")
    assert run(["fly", "hand_launch", "--no-rerun", "--duration", "5", "--out", str(folder)]) in (0, 1)
    return folder / FLIGHT


@pytest.fixture
def here(tmp_path: Path, flown: Path, monkeypatch) -> Path:
    """A working directory with that flight where `fly` would put it."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(flown, tmp_path / "flights" / FLIGHT)
    return tmp_path


def test_export_of_a_flight_reads_back_as_its_log(here: Path, capsys) -> None:
    """Both files hold every fix that arrived, at its time exactly, and where and how fast within their digits."""
    assert run(["export", f"flights/{FLIGHT}", "--nmea", "fixes.nmea", "--ubx", "fixes.ubx"]) == 0
    rows = recording.load(here / "flights" / FLIGHT).log.measured
    rows = rows[rows["gps_new"] == 1]
    assert len(rows) > 20
    nmea = gps_messages.read_nmea("fixes.nmea", LAUNCH, START)
    ubx = gps_messages.read_ubx("fixes.ubx", LAUNCH, START)
    assert not nmea.problems + ubx.problems
    for fixes, half_m in ((nmea.fixes, 0.1e-3), (ubx.fixes, 5.6e-3)):  # of 1e-7 min and of 1e-7 deg
        np.testing.assert_array_equal(fixes.t_s, rows["gps_t_s"])
        np.testing.assert_allclose(fixes.p_e_m[:, :2], rows["gps_p_e_m"][:, :2], rtol=0, atol=half_m)
        np.testing.assert_allclose(fixes.p_e_m[:, 2], rows["gps_p_e_m"][:, 2], rtol=0, atol=0.5001e-3)
        np.testing.assert_allclose(fixes.speed_m_s, rows["gps_speed_m_s"], rtol=0, atol=0.5001e-3)
    np.testing.assert_allclose(ubx.fixes.v_e_m_s, rows["gps_v_e_m_s"], rtol=0, atol=0.5001e-3)
    # The default receiver: 1.5 m an axis, 2.5 m up, 0.1 m/s.
    assert (ubx.fixes.horizontal_acc_m[0], ubx.fixes.vertical_acc_m[0]) == (2.121, 2.5)
    assert ubx.fixes.speed_acc_m_s[0] == 0.1
    out = capsys.readouterr().out
    assert f"{len(rows)}" in out
    assert "12:00:01.000" in out
    assert "fixes.ubx" in out
    assert max(map(len, out.splitlines())) <= 80


def test_export_of_a_flight_whose_suite_file_is_gone_takes_what_the_recording_kept(tmp_path: Path, monkeypatch) -> None:
    """As a flight is flown again; the accuracies are the root sums of squares of wander and noise of its receiver."""
    monkeypatch.chdir(tmp_path)
    suite = Path("mine.toml")
    suite.write_text('summary = "mine"\ngyro = "itg3200"\naccelerometer = "bma180"\ngps = "ls20031"\n')
    fly = ["fly", "hand_launch", "--sensors", "mine.toml", "--no-rerun", "--duration", "2", "--out", "flights"]
    assert run(fly) in (0, 1)
    suite.unlink()
    assert run(["export", f"flights/{FLIGHT}", "--ubx", "fixes.ubx"]) == 0
    fixes = gps_messages.read_ubx("fixes.ubx").fixes
    # Two axes of 2.1 and 0.3 m, 3.2 and 0.5 m, 0.1 and 0.05 m/s.
    assert (fixes.horizontal_acc_m[0], fixes.vertical_acc_m[0], fixes.speed_acc_m_s[0]) == (3.0, 3.239, 0.112)


def test_export_json_tells_what_was_written(here: Path, capfd) -> None:
    """The newest flight where none is named, one format alone, JSON alone on standard output; the start as asked."""
    assert run(["export", "--ubx", "a.ubx", "--start", "2024-02-29T23:59:58", "--json", "-"]) == 0
    data = json.loads(capfd.readouterr().out)
    assert data["files"] == [{"format": "UBX", "file": "a.ubx", "bytes": (here / "a.ubx").stat().st_size}]
    assert (data["start_utc"], data["first_t_s"]) == ("2024-02-29T23:59:58+00:00", 1.0)
    reading = gps_messages.read_ubx("a.ubx")
    assert len(reading.fixes) == data["fixes"]
    assert reading.start.isoformat() == "2024-02-29T23:59:59+00:00"


def test_export_twice_replaces_with_the_same_bytes(here: Path) -> None:
    """The same flight is the same file, also from its Parquet file."""
    assert run(["export", "--nmea", "a.nmea"]) == 0
    first = (here / "a.nmea").read_bytes()
    assert run(["export", f"flights/{FLIGHT}/flight.parquet", "--nmea", "a.nmea"]) == 0
    assert (here / "a.nmea").read_bytes() == first


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["export"], "name --nmea FILE, --ubx FILE, --csv FILE or several"),
        (["export", "--nmea", "a", "--ubx", "./a"], "use separate files"),
        (["export", "nowhere", "--nmea", "a"], "no recording at"),
        (["export", "--nmea", "a", "--start", "monday"], "--start 'monday'"),
        (["export", "--nmea", "a", "--start", "1950-01-01"], "6 January 1980"),
        (["export", "--nmea", "no/such/folder/a"], "there is no folder"),
        (["export", "--ubx", "flights"], "it is a folder"),
    ],
)
def test_export_refusals_are_one_line_and_write_nothing(arguments, message: str, here: Path, capsys) -> None:
    """What cannot be done is told before anything is written."""
    assert run(arguments) == 2
    err = capsys.readouterr().err
    assert message in err
    assert err.count("\n") == 1
    assert [p.name for p in here.iterdir()] == ["flights"]


def test_export_without_the_package_writes_nothing(here: Path, capsys, monkeypatch) -> None:
    """One line says what to install, also where only the second of two formats lacks its package."""
    monkeypatch.setitem(sys.modules, "pyubx2", None)
    assert run(["export", "--nmea", "a.nmea", "--ubx", "a.ubx"]) == 2
    assert capsys.readouterr().err == 'wingslevel: pyubx2 is not installed: pip install "wingslevel[logs]"\n'
    assert [p.name for p in here.iterdir()] == ["flights"]


def test_export_of_a_flight_without_a_fix_is_refused(here: Path, capsys) -> None:
    """A receiver that found nothing sends nothing."""
    run(["fly", "hand_launch", "--no-rerun", "--duration", "1", "--set", "gps.first_fix_s=100", "--out", "none"])
    capsys.readouterr()
    assert run(["export", f"none/{FLIGHT}", "--nmea", "a"]) == 2
    assert "no GPS fix arrived" in capsys.readouterr().err
