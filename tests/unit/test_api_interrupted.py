"""The public API while it runs: Ctrl-C, bars, threads."""

import io
import os
import signal
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wingslevel as wl
from estimator.compiler import compiling
from wingslevel import _progress


class Pressed:
    """Ctrl-C is pressed in its third second."""

    def update(self, m: wl.Measurements) -> wl.AttitudeEstimate:
        """Always the same."""
        if abs(m.imu.t_s - 3.0) < 1e-6:
            os.kill(os.getpid(), signal.SIGINT)
        return wl.AttitudeEstimate(np.eye(3))


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_gives_the_flight_up_to_there() -> None:
    """It ends the script, as Ctrl-C does, and can be caught with what was flown."""
    with pytest.raises(KeyboardInterrupt) as pressed:
        wl.fly("crosswind", estimator=Pressed, duration=20)
    assert isinstance(pressed.value, wl.Interrupted)
    flight = pressed.value.result
    assert (flight.outcome, flight.passed) == ("interrupted", False)
    assert 100 < len(flight) < 200


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_gives_the_flights_that_were_finished() -> None:
    """Those before the one that was interrupted."""
    flown: list[int] = []

    def second() -> Any:
        flown.append(1)
        return Pressed() if len(flown) > 2 else Level()  # the first is made to look at what it is

    with pytest.raises(wl.Interrupted) as pressed:
        wl.check("crosswind", estimator=second, seeds="0-3", duration=5, workers=1)
    result = pressed.value.result
    assert (len(result.flights), result.missing, result.passed) == (1, 3, False)
    assert "3 missing" in repr(result)
    with pytest.raises(wl.Interrupted) as pressed:
        wl.compare("crosswind", ["gyro_only", Pressed], seeds="0", duration=5, workers=1)
    assert len(pressed.value.result.flights) == 1


class Level:
    """Believes that it flies level, to the north."""

    def update(self, m: wl.Measurements) -> wl.AttitudeEstimate:
        """Always the same."""
        return wl.AttitudeEstimate(np.eye(3))


class Screen(io.StringIO):
    """A terminal."""

    def isatty(self) -> bool:
        """It is one."""
        return True


@pytest.mark.parametrize("wanted", [True, False])
def test_bar_appears_on_a_terminal_if_wanted(monkeypatch: pytest.MonkeyPatch, wanted: bool) -> None:
    """On standard error, once its patience is over."""
    screen = Screen()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr(_progress, "PATIENCE_S", 0.0)
    monkeypatch.setenv("TERM", "xterm")
    wl.fly("crosswind", duration=3, progress=wanted)
    assert ("flying crosswind" in screen.getvalue()) == wanted


def test_bar_is_not_written_to_a_file(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nobody watches, there is none."""
    monkeypatch.setattr(_progress, "PATIENCE_S", 0.0)
    wl.check("crosswind", seeds=0, duration=1, workers=1, progress=True)
    assert capfd.readouterr() == ("", "")


def test_trouble_of_the_kernel_cache_is_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    """And no line on standard error."""
    told: list[Any] = []
    monkeypatch.setattr(compiling, "on_trouble", told.append)
    from wingslevel._crew import quietly

    with pytest.warns(wl.WingslevelWarning, match="kernel cache: it is full"), quietly():
        told[0]("it is full")
    assert told[-1] is None


def test_fly_in_a_thread_is_the_same_flight() -> None:
    """Signals are for the main thread alone; flights are not."""
    flown: list[wl.Flight] = []
    thread = threading.Thread(target=lambda: flown.append(wl.fly("crosswind", duration=2, seed=5)))
    thread.start()
    thread.join()
    assert flown[0].flown.tobytes() == wl.fly("crosswind", duration=2, seed=5).flown.tobytes()


def test_check_comes_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A ledger named by a relative path is where the script runs."""
    monkeypatch.chdir(tmp_path)
    wl.check("crosswind", seeds=0, duration=1, workers=1, ledger="kept")
    assert len(list((tmp_path / "kept").iterdir())) == 1
