"""A copy of the tree in which one job flips and tests; it stays, so that what was compiled in it stays compiled."""

import json
import math
import os
import resource
import shutil
import signal
import subprocess
import sys
import zlib
from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree

from flips import Flip

COPIED = (
    "estimator", "autopilot", "sim", "scenarios", "wingslevel",
    "tests", "docs", "pyproject.toml", "README.md", "Makefile",
)  # fmt: skip
PASSED, NONE_COLLECTED, OUT_OF_TIME = 0, 5, -1
BUSY = 10.0  # a busy machine may take so many seconds for one of computing


def _files(folder: Path) -> list[Path]:
    return [file for file in folder.rglob("*") if file.is_file() and "__pycache__" not in file.parts]


class Tree:
    """The copy in `folder` of the tree at `root`, brought up to date."""

    def __init__(self, root: Path, folder: Path) -> None:
        self.folder = folder
        for name in COPIED:
            self._follow(root / name, folder / name)
        self._file = folder / "known.json"
        self._running: subprocess.Popen[bytes] | None = None
        known = json.loads(self._file.read_text(encoding="utf-8")) if self._file.exists() else {}
        self._seconds: dict[str, float] = known.get("seconds", {})
        self._sound: dict[str, bool] = known.get("sound", {})

    def _follow(self, source: Path, target: Path) -> None:
        """Copy what has changed; a file that was not touched keeps its time, so that its kernels need no compiler."""
        wanted = {target: source} if source.is_file() else {target / f.relative_to(source): f for f in _files(source)}
        for copy, file in wanted.items():
            if not copy.exists() or copy.read_bytes() != file.read_bytes():
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(file, copy)
        if target.is_dir():
            for copy in _files(target):
                if copy not in wanted:
                    copy.unlink()

    def stop(self) -> None:
        """End the tests that run; what ran them finds that they failed."""
        if self._running is not None and self._running.poll() is None:
            _end(self._running)

    def put(self, flip: Flip) -> bytes:
        """Make the flip; what stood there before."""
        file = self.folder / flip.path
        before = file.read_bytes()
        file.write_bytes(flip.applied(before))
        return before

    def put_back(self, flip: Flip, before: bytes) -> None:
        """Undo it."""
        (self.folder / flip.path).write_bytes(before)

    def seconds(self) -> dict[str, float]:
        """How long each test file took when it last passed, as far as that is known."""
        return dict(self._seconds)

    def passes(self, test: str) -> bool:
        """Whether a test file passes without a flip; tried once for each version of the file."""
        version = f"{test} {zlib.crc32((self.folder / test).read_bytes())}"
        if version not in self._sound:
            self._sound[version] = self.run([test], 200.0)[0] == PASSED
            self._write()
        return self._sound[version]

    def run(self, tests: list[str], cpu_s: float) -> tuple[int, str]:
        """Exit code of pytest, stopped at the first failure, and the test that failed; `OUT_OF_TIME` as a code."""
        report, limit = self.folder / "junit.xml", math.ceil(cpu_s)
        command = [
            sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "--no-header", "--tb=no",
            f"--junitxml={report}", "-o", "junit_family=xunit1", *tests,
        ]  # fmt: skip
        environment = {
            **os.environ,
            "PYTHONPATH": str(self.folder),
            "PYTHONDONTWRITEBYTECODE": "1",  # a flip within the second of the last would not be noticed
            "XDG_CACHE_HOME": str(self.folder / "cache"),
            "HYPOTHESIS_PROFILE": "gate",
        }
        report.unlink(missing_ok=True)
        self._running = process = subprocess.Popen(
            command, cwd=self.folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL, start_new_session=True,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit, limit)),
        )  # fmt: skip
        try:
            said, _ = process.communicate(timeout=BUSY * cpu_s)
        except subprocess.TimeoutExpired:
            return OUT_OF_TIME, "out of time"
        finally:
            _end(process)
        if process.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
            return OUT_OF_TIME, "out of time"
        if process.returncode == PASSED:
            self._learn(report)
        lines = [line for line in said.decode(errors="replace").splitlines() if line.startswith(("FAILED", "ERROR"))]
        return process.returncode, lines[0].split()[1] if lines else ""

    def _learn(self, report: Path) -> None:
        """Note how long the files took."""
        took: dict[str, float] = {}
        for case in ElementTree.parse(report).getroot().iter("testcase"):
            took[case.get("file", "")] = took.get(case.get("file", ""), 0.0) + float(case.get("time", "0"))
        self._seconds |= {test: round(seconds, 1) for test, seconds in took.items()}
        self._write()

    def _write(self) -> None:
        self._file.write_text(json.dumps({"seconds": self._seconds, "sound": self._sound}, indent=0), encoding="utf-8")


def _end(process: "subprocess.Popen[bytes]") -> None:
    """End the tests and whatever they started."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
