"""While kernels are compiled: one line says so in every command, and Ctrl-C ends it cleanly."""

import importlib
import io
import os
import pty
import signal
import sys
import threading

import pytest

import estimator.compiler.jit
from estimator.compiler import compiling, kernel_cache
from scenarios.harness.cli import console
from scenarios.harness.cli.app import app, run
from sim.outside import signals

LINE = "compiling kernels that are not cached yet: up to half a minute\n"


@pytest.fixture(autouse=True)
def _no_word_of_compiling():
    """Here it is said."""


@pytest.fixture(autouse=True)
def _ctrl_c():
    """SIGINT as at a terminal: under nohup it is ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def kernels(tmp_path, monkeypatch):
    """Makes a kernel that calls another, both new to the cache; or, the second time, known to it."""
    monkeypatch.setattr(kernel_cache, "base", lambda: tmp_path / "cache")
    monkeypatch.syspath_prepend(tmp_path)
    source = tmp_path / "two.py"
    source.write_text("def inner(x):\n    return x + 1.0\n\n\ndef outer(x):\n    return 2.0 * inner(x)\n")

    def make():
        monkeypatch.delitem(sys.modules, "two", raising=False)
        module = importlib.import_module("two")  # a real one: the compiler looks its kernels up by its name
        module.inner = estimator.compiler.jit.kernel(module.inner)
        return estimator.compiler.jit.kernel(module.outer)

    return make


@pytest.fixture
def command(kernels, monkeypatch):
    """A command of the real command line that calls the kernel."""
    monkeypatch.setattr(app, "registered_commands", [*app.registered_commands])
    app.command("compute")(lambda: sys.stdout.write(f"{kernels()(2.0)}\n") and None)
    return ["compute"]


def test_line_is_told_before_the_first_kernel_of_any_command_and_not_from_the_cache(command, capfd):
    """Once however many kernels there are; nothing else where standard error is no terminal."""
    assert run(command) == 0
    assert capfd.readouterr() == ("6.0\n", LINE)
    assert run(command) == 0
    assert capfd.readouterr() == ("6.0\n", "")


def test_count_is_shown_on_a_terminal_and_wiped_away(kernels, monkeypatch):
    """What stays on the screen is the one line."""
    leader, follower = pty.openpty()
    with open(follower, "w") as terminal, open(leader, "rb", buffering=0) as screen:
        monkeypatch.setattr(sys, "stderr", terminal)
        monkeypatch.setenv("TERM", "xterm")
        with console.compiling_told():
            kernels()(2.0)
        terminal.flush()
        shown = screen.read(10_000).decode()
    assert shown.count("compiling kernels") == 1
    assert "kernels compiled: 0, 0 s" in shown
    assert "kernels compiled: 1" in shown
    assert shown.endswith("\r\x1b[K")


def test_line_and_count_go_through_the_bar_where_there_is_one(kernels, monkeypatch):
    """The bar says what is going on while it is, and its own word again afterwards."""
    monkeypatch.setattr(console, "err", lambda: _terminal(screen))
    screen = io.StringIO()
    said = []
    with console.compiling_told(), console.progress("flying", "s"):
        make, (bar,) = kernels(), console._bars
        update = bar.update
        monkeypatch.setattr(bar, "update", lambda task, **fields: (said.append(fields), update(task, **fields)))
        make(2.0)
    descriptions = [fields["description"] for fields in said]
    assert descriptions[0] == "flying (kernels compiled: 0, 0 s)"
    assert descriptions[-1] == "flying"
    assert screen.getvalue().count("compiling kernels") == 1


def _terminal(screen):
    from rich.console import Console

    return Console(file=screen, force_terminal=True, width=100)


def test_line_closed_standard_error_does_not_stop_the_compiler(kernels, monkeypatch):
    """Nobody reads it: the kernel is compiled all the same."""
    closed = io.StringIO()
    closed.close()
    monkeypatch.setattr(sys, "stderr", closed)
    with console.compiling_told():
        assert kernels()(2.0) == 6.0


def test_worker_without_a_listener_says_nothing(kernels, capfd):
    """A process that nobody has told to say anything compiles in silence."""
    assert kernels()(2.0) == 6.0
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("at", ["outer", "inner"])
def test_interrupt_while_compiling_is_raised_at_the_next_step_and_not_lost(kernels, capfd, at, number):
    """Wherever the compiler is when the signal comes; the next call of the kernel compiles again."""
    sent = []

    def interrupt(progress):
        if progress.name == at and not sent:
            sent.append(progress)
            os.kill(os.getpid(), number)
            assert compiling.busy()

    kernel = kernels()
    before = compiling.on_compile(interrupt)
    try:
        with pytest.raises(signals.Interrupted), signals.listening():
            kernel(2.0)
    finally:
        compiling.on_compile(before)
    assert not compiling.busy()
    assert kernel(2.0) == 6.0
    assert capfd.readouterr() == ("", "")


def test_interrupt_in_a_command_that_compiles_is_one_line(command, capfd):
    """Exit code 130, and no word of the compiler's."""
    busy = []

    def interrupt():
        while not busy and threading.main_thread().is_alive():
            if compiling._state.compiled > before:
                busy.append(True)
                os.kill(os.getpid(), signal.SIGINT)

    before = compiling._state.compiled
    thread = threading.Thread(target=interrupt)
    thread.start()
    code = run(command)
    thread.join()
    assert code == 130
    assert capfd.readouterr() == ("", f"{LINE}wingslevel: interrupted\n")


def test_busy_another_thread_does_not_hold_back_the_main_one(kernels):
    """Only the thread that compiles is inside the compiler."""
    seen = []
    before = compiling.on_compile(lambda _: seen.append((compiling.busy(), threading.current_thread().name)))
    try:
        thread = threading.Thread(target=kernels(), args=(2.0,), name="other")
        thread.start()
        thread.join()
    finally:
        compiling.on_compile(before)
    assert set(seen) == {(True, "other")}
    assert not compiling.busy()
