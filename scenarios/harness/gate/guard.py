"""The process around a command: whatever happens to the one that runs flight code, a verdict or an error comes out.

Flight code can end its process (``os._exit``, a crash in C), hang it without answering signals, or write to its
standard output.  So a command runs in a child, and the parent, which runs no flight code, decides the exit code:

- the child says when it is done, and with which exit code; one that ends without a word never counts as passed;
- what is watched (`watched`) and ends the child, or takes too long, is recorded in `lost`, and the command is run once
  more: it finds it there, leaves it out, and reports it;
- JSON for standard output passes through the parent (`publish`): the child has no hand on it;
- Ctrl-C, SIGTERM and SIGHUP are passed on; when the parent is killed, the child is too.

Where the system cannot fork, and when a command is called from Python, it runs unguarded.

This module is imported before anything heavy, and must stay so.
"""

import contextlib
import json
import os
import secrets
import select
import signal
import sys
import time
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any, NamedTuple

from sim.outside.processes import end_with_parent
from sim.outside.signals import ENDING, listening, on_extended
from sim.outside.wording import described, printable

FAILED, USAGE, BROKEN, INTERRUPTED = 1, 2, 3, 130  # exit codes
_COMPLETE = "_WINGSLEVEL_COMPLETE"  # set by a shell that wants half a line completed: nothing is flown
GRACE_S = 5.0  # time for a process to end by itself
_LOOK_S = 0.2

UNPREPARED = "before anything was flown or written; does flight code or a scenario file end it?"


class Lost(NamedTuple):
    """Something watched that ended its process, or was killed with it.

    timed_out : whether its time was up; else its process is gone       message : one line
    """

    timed_out: bool
    message: str


class _Child(NamedTuple):
    """What the command's process knows of its parent."""

    channel: int
    token: str  # frames without it are not ours: flight code may write to any descriptor


class _Heard:
    """What the parent knows of a child."""

    done: int | None = None
    stage: str = UNPREPARED
    code: int = USAGE
    watched: str = ""
    deadline_s: float | None = None
    timed_out = False
    unwritten = ""  # why what was published could not be written


lost: dict[str, Lost] = {}
_child: _Child | None = None


def main() -> None:
    """Entry point of the console script."""

    def command() -> int:
        from scenarios.harness.cli.app import run

        return run(sys.argv[1:])

    sys.exit(guarded(command))


def guarded(command: Callable[[], int]) -> int:
    """Run `command` in a process of its own; its exit code, or one that never passes if it ended unexpectedly."""
    if not hasattr(os, "fork") or _COMPLETE in os.environ:
        return command()
    while True:
        heard, ended = _run(command)
        if heard.unwritten:
            sys.stderr.write(f"wingslevel: cannot write the JSON to standard output: {heard.unwritten}\n")
            return max(heard.done or 0, USAGE)
        if heard.done is not None:
            return heard.done
        if heard.watched and heard.watched not in lost:
            lost[heard.watched] = Lost(heard.timed_out, ended)
            continue
        sys.stderr.write(f"wingslevel: the process {ended} {printable(heard.stage)}\n")
        return heard.code


@contextlib.contextmanager
def watched(what: str, limit_s: float | None = None) -> Iterator[None]:
    """If the process ends inside the block, or stays in it for longer than `limit_s`, only `what` is lost."""
    _send(watched=what, limit_s=limit_s)

    def extend(seconds: float) -> None:
        _send(watched=what, limit_s=seconds + GRACE_S)

    on_extended(extend)
    try:
        yield
    finally:
        on_extended(None)
        _send(watched="", limit_s=None)


def stage(when: str, code: int) -> None:
    """From here on, a process that ends unexpectedly did so `when`, and the exit code is `code`."""
    _send(stage=when, code=code)


def guarding() -> bool:
    """Whether a parent holds standard output."""
    return _child is not None


def publish(text: str) -> bool:
    """Have the parent write `text` to standard output; False if unguarded."""
    return _send(out=text)


def _send(**frame: Any) -> bool:
    if _child is None:
        return False
    data = f"\n{json.dumps({'token': _child.token, **frame})}\n".encode()
    try:
        while data:
            data = data[os.write(_child.channel, data) :]
    except OSError:  # flight code has closed the channel: the parent hears nothing, so nothing passes
        return False
    return True


def _run(command: Callable[[], int]) -> tuple[_Heard, str]:
    """One life of the command: what was heard of it, and how its process ended."""
    read, write = os.pipe()
    token = secrets.token_hex(8)
    signals = [number for number in ENDING if signal.getsignal(number) is not signal.SIG_IGN]
    signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    sys.stdout.flush()
    parent, pid = os.getpid(), os.fork()
    if pid == 0:
        end_with_parent(parent)
        os.close(read)
        _live(command, _Child(write, token), signals)
    os.close(write)

    def pass_on(number: int, _frame: FrameType | None) -> None:
        os.kill(pid, signal.SIGINT if number == signal.SIGINT else signal.SIGTERM)

    before = {number: signal.signal(number, pass_on) for number in signals}
    signal.pthread_sigmask(signal.SIG_UNBLOCK, signals)
    try:
        heard = _Heard()
        status = _listen(pid, read, token, heard)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        os.close(read)
    if heard.timed_out:
        return heard, "gave no answer within the time limit and was stopped"
    return heard, _how(status)


def _live(command: Callable[[], int], child: _Child, signals: list[signal.Signals]) -> None:
    """The child's life; does not return."""
    global _child
    _child = child
    code: int | None = None
    try:
        for number in signals:
            signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)
        with listening():
            signal.pthread_sigmask(signal.SIG_UNBLOCK, signals)
            try:
                code = command()
            finally:  # a signal that comes now is too late: it must not end this process before its code is sent
                signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    except KeyboardInterrupt:  # before `run` had begun, or after it had ended
        if code is None:
            code = INTERRUPTED
            sys.stderr.write("wingslevel: interrupted\n")
    except BaseException as error:  # `run` answers for all that can be foreseen
        sys.stderr.write(f"wingslevel: internal error: {described(error)}\n")
    finally:
        for number in signals:  # for other threads, which have a mask of their own
            signal.signal(number, signal.SIG_IGN)
        code = BROKEN if code is None else code
        _flush()
        _send(done=code)
        os._exit(code)  # without atexit: flight code may have left functions or threads there


def _flush() -> None:
    """Flush standard output and error; a closed pipe is not an error."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()


def _listen(pid: int, read: int, token: str, heard: _Heard) -> int:
    """Take in the frames of the child until it ends; its wait status."""
    buffer, open_, end_s = b"", True, None
    while True:
        ready = select.select([read] if open_ else [], [], [], _LOOK_S)[0]
        if ready:
            data = os.read(read, 1 << 16)
            open_ = bool(data)
            *lines, buffer = (buffer + data).split(b"\n")
            for line in lines:
                _take(line, token, heard)
        now_s = time.monotonic()
        if end_s is None and (heard.done is not None or not open_):  # it has no more to say
            end_s = now_s + GRACE_S
        heard.timed_out |= heard.deadline_s is not None and now_s > heard.deadline_s
        if heard.timed_out or (end_s is not None and now_s > end_s):
            os.kill(pid, signal.SIGKILL)
        if not open_:
            time.sleep(_LOOK_S / 10.0)
        gone, status = os.waitpid(pid, os.WNOHANG)
        if gone:
            if open_ and select.select([read], [], [], 0.0)[0]:
                for line in (buffer + os.read(read, 1 << 20)).split(b"\n"):
                    _take(line, token, heard)
            return status


def _take(line: bytes, token: str, heard: _Heard) -> None:
    try:
        frame = json.loads(line)
        if frame["token"] != token:
            return
    except (ValueError, TypeError, KeyError):
        return
    if "out" in frame:
        _write(frame["out"], heard)
    if "stage" in frame:
        heard.stage, heard.code = frame["stage"], frame["code"]
    if "watched" in frame:
        heard.watched, limit_s = frame["watched"], frame["limit_s"]
        heard.deadline_s = None if limit_s is None else time.monotonic() + limit_s
    heard.done = frame.get("done", heard.done)


def _write(text: str, heard: _Heard) -> None:
    """Write `text` to standard output; a closed pipe is not an error."""
    data = text.encode("utf-8", "backslashreplace")
    try:
        while data:
            data = data[os.write(1, data) :]
    except BrokenPipeError:
        return
    except OSError as error:
        heard.unwritten = error.strerror or type(error).__name__


def _how(status: int) -> str:
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        return f"was killed by signal {number} ({signal.strsignal(number)})"
    return f"ended by itself (exit code {os.WEXITSTATUS(status)})"
