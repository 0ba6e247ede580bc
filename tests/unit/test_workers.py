"""Tasks over several processes: one that dies, hangs or raises costs itself alone."""

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from scenarios.harness.gate.workers import fly_each
from sim.log import Outcome


@dataclass(frozen=True)
class Square:
    """Squares a number; what befalls the process at `trouble` is decided by `what`."""

    number: int
    trouble: int
    what: str
    folder: str

    def fly(self) -> tuple[int, str]:
        """The square, or what befalls the process."""
        if self.number == self.trouble:
            befall(self.what, Path(self.folder))
        return self.number**2, ""

    def lost(self, outcome: Outcome, message: str) -> tuple[int, str]:
        """What stands in its place."""
        return -1, f"{outcome}: {message}"


def befall(what: str, folder: Path) -> None:
    """What flight code may do to the process that runs it."""
    if what.startswith("exits"):
        os._exit(int(what.split()[1]))
    if what == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if what == "killed once" and not (folder / "before").exists():
        (folder / "before").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    while what == "hangs":
        pass
    while what == "hangs, deaf":
        signal.signal(signal.SIGALRM, signal.SIG_IGN)
    if what == "leaves later":
        threading.Timer(0.3, os._exit, (0,)).start()
    if what == "SystemExit":
        raise SystemExit(0)
    if what == "KeyboardInterrupt":
        raise KeyboardInterrupt


def squares(tmp_path: Path, what: str, *, workers: int = 2, n: int = 5, limit_s: float = 60.0) -> dict:
    """The squares of the first numbers, with trouble at 2."""
    tasks = [Square(i, 2, what, str(tmp_path)) for i in range(n)]
    return fly_each(tasks, workers, lambda _done, _total: None, limit_s=limit_s)


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize(
    ("what", "says"),
    [
        ("exits 0", "worker_died: the process that flew it ended by itself (exit code 0)"),
        ("exits 3", "worker_died: the process that flew it ended by itself (exit code 3)"),
        ("killed", "worker_died: the process that flew it was killed by signal 9 (Killed)"),
        ("SystemExit", "diverged: SystemExit: 0"),
        ("KeyboardInterrupt", "diverged: KeyboardInterrupt: no message"),
    ],
)
def test_task_that_ends_its_process_costs_itself_alone(tmp_path: Path, what: str, says: str, workers: int) -> None:
    """All others come back, whatever the exit code was."""
    done = squares(tmp_path, what, workers=workers)
    assert {i: result for i, result in done.items() if i != 2} == {i: (i * i, "") for i in (0, 1, 3, 4)}
    assert done[2] == (-1, says)


def test_task_whose_process_is_killed_once_is_flown_once_more(tmp_path: Path) -> None:
    """The system that runs out of memory may pick anyone's process: the second time it goes well."""
    assert squares(tmp_path, "killed once")[2] == (4, "")


@pytest.mark.parametrize(
    ("what", "says"),
    [
        ("hangs", "timed_out: took longer than 1 s"),
        ("hangs, deaf", "timed_out: took longer than 1 s and did not answer"),
    ],
)
def test_task_that_hangs_is_ended_at_its_limit_and_the_others_go_on(tmp_path: Path, what: str, says: str) -> None:
    """One that answers signals is interrupted, one that does not is killed; neither is tried again."""
    done = squares(tmp_path, what, limit_s=1.0)
    assert done[2] == (-1, says)
    assert [done[i][0] for i in (0, 1, 3, 4)] == [0, 1, 9, 16]


def test_process_that_ends_while_it_waits_costs_no_task(tmp_path: Path) -> None:
    """What one task left behind in a thread is not the next one's fault: it is flown in a new process."""
    tasks = [Square(2, 2, "leaves later", ""), Square(3, 0, "", "")]
    done = fly_each(tasks, 1, lambda _done, _total: None, keep=lambda _i, _result: time.sleep(1.0))
    assert done == {0: (4, ""), 1: (9, "")}


def test_results_are_handed_on_as_they_come(tmp_path: Path) -> None:
    """Each is kept before the next is waited for, so that nothing finished can be lost."""
    kept: list[int] = []
    tasks = [Square(i, -1, "", str(tmp_path)) for i in range(4)]
    done = fly_each(tasks, 2, lambda n, _total: None, keep=lambda i, _result: kept.append(i))
    assert sorted(kept) == sorted(done) == [0, 1, 2, 3]


def test_workers_end_when_the_process_that_began_them_is_killed(tmp_path: Path) -> None:
    """Also one that hangs in a loop that answers nothing."""
    tasks = f"""
        import os
        from pathlib import Path

        class Hang:
            def fly(self):
                Path({str(tmp_path)!r}, str(os.getpid())).touch()
                while True:
                    pass
            def lost(self, outcome, message):
                return None
    """
    program = """
        from hanging import Hang
        from scenarios.harness.gate.workers import fly_each

        if __name__ == "__main__":
            fly_each([Hang(), Hang()], 2, lambda done, total: None)
    """
    (tmp_path / "hanging.py").write_text(textwrap.dedent(tasks), encoding="utf-8")
    script = tmp_path / "parent.py"
    script.write_text(textwrap.dedent(program), encoding="utf-8")
    search = os.pathsep.join([str(Path(__file__).resolve().parents[2]), str(tmp_path)])
    parent = subprocess.Popen([sys.executable, script], env={**os.environ, "PYTHONPATH": search})
    pids = waited_for(lambda: [int(path.name) for path in tmp_path.iterdir() if path.name.isdigit()], 2)
    assert len(pids) == 2
    parent.kill()
    parent.wait()
    assert waited_for(lambda: [pid for pid in pids if not alive(pid)], 2) == pids


def alive(pid: int) -> bool:
    """Whether a process is there, and is no mere entry that nobody has asked for."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in ("Z", "X")
    except (FileNotFoundError, ProcessLookupError):
        return False


def waited_for(look, n: int) -> list:
    """What `look` finds, once it is `n` things, or after a while."""
    for _ in range(600):
        found = look()
        if len(found) >= n:
            break
        time.sleep(0.05)
    return found
