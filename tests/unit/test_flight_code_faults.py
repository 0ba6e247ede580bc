"""Whatever flight code raises, and wherever: one line with its place, the right exit code, and the recording kept."""

import re
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from scenarios.harness import plugins
from scenarios.harness.cli.app import run
from scenarios.harness.equipping import load_estimator
from sim import recording
from sim.log import Outcome
from sim.outside import entry_points
from sim.outside.signals import TimedOut, limited

# What is raised: what it needs at the head of the file, the statement, and the line that tells of it.
RAISED = {
    "error": ("", "1 / 0", r"ZeroDivisionError: division by zero"),
    "exit": ("", "raise SystemExit(0)", r"SystemExit: 0"),
    "ctrl_c": ("", "raise KeyboardInterrupt", r"KeyboardInterrupt: no message"),
    "closing": ("", "raise GeneratorExit", r"GeneratorExit: no message"),
    "stop": ("", "raise StopIteration", r"StopIteration: no message"),
    "cancelled": ("import asyncio", "raise asyncio.CancelledError", r"CancelledError: no message"),
    "memory": ("", "raise MemoryError", r"MemoryError: no message"),
    "endless": ("def deep(): return deep()", "deep()", r"RecursionError: maximum recursion depth exceeded.*"),
    "base": ("class Own(BaseException): pass", "raise Own('two\\nlines \\x1b[31m')", r"Own: two lines \\x1b\[31m"),
    "group": ("", "raise BaseExceptionGroup('two', [SystemExit(), ValueError()])", r"BaseExceptionGroup: two .*"),
    "ours": ("from sim.outside.signals import Interrupted", "raise Interrupted", r"Interrupted: no message"),
    "late": ("from sim.outside.signals import TimedOut", "raise TimedOut", r"TimedOut: no message"),
    "syntax": ("", "exec('x =')", r"SyntaxError: invalid syntax \(<string>, line 1\)"),
    "silent": (
        "class Silent(Exception):\n    def __str__(self): raise SystemExit\n    __repr__ = __str__",
        "raise Silent",
        r"Silent: no message \(its __str__ raises SystemExit\)",
    ),
    "odd": (
        "class Odd(type):\n"
        "    @property\n    def __name__(cls): raise RuntimeError\n"
        "    @property\n    def __module__(cls): raise RuntimeError\n"
        "class Strange(Exception, metaclass=Odd):\n"
        "    @property\n    def __class__(self): raise RuntimeError",
        "raise Strange",
        r"Strange: no message.*",
    ),
}
FLY = ("fly", "bench_rest", "--set", "duration_s=0.1", "--no-rerun", "--estimator", "own.py:Mine")
COMMANDS = {
    "fly": FLY,
    "check": ("check", "bench_rest", "--set", "duration_s=0.1", "--seeds", "0", "--workers", "1", "--estimator",
              "own.py:Mine"),
    "compare": ("compare", "bench_rest", "--set", "duration_s=0.1", "--seeds", "0", "--workers", "1", "--estimators",
                "gyro_only,own.py:Mine"),
    "replay": ("replay", "log.csv", "--estimator", "gyro_only,own.py:Mine", "--no-rerun"),
    "bench": ("bench", "--estimator", "own.py:Mine", "--seconds", "2", "--repeats", "3"),
}  # fmt: skip


@pytest.fixture
def here(tmp_path: Path, monkeypatch) -> Path:
    """An empty working directory with a log of six seconds at rest."""
    monkeypatch.chdir(tmp_path)
    rows = "\n".join(f"{0.02 * k:.2f},0.01,0,0,0,0,-9.8" for k in range(300))
    (tmp_path / "log.csv").write_text(f"t,gx,gy,gz,ax,ay,az\n{rows}\n")
    return tmp_path


def own(where: str, raised: str) -> str:
    """An estimator that raises in that place; the statement is the only one in its line."""
    setup, statement, _ = RAISED[raised]
    lines = ["import numpy as np", "from estimator.interface import AttitudeEstimate", setup]
    if where == "import":
        lines.append(statement)
    lines.append("class Mine:")
    methods = {"__init__": "self", "reset": "self, on_ground", "replay": "self, rows", "update": "self, m"}
    for name, arguments in methods.items():
        if name != "replay" or where == "replay":
            body = statement if name == where else "pass"
            lines += [f"    def {name}({arguments}):", f"        {body}"]
    lines.append("        return AttitudeEstimate(np.eye(3))")  # of update(), the last
    if where in ("params", "heading_reference", "learnt", "uses", "rejected", "refused"):
        lines += ["    @property", f"    def {where}(self):", f"        {statement}"]
    return "\n".join(lines) + "\n"


def place(where: str, raised: str) -> str:
    """The end of the line: file, number of the line, function."""
    source = own(where, raised).splitlines()
    if raised == "endless":
        return rf"\(own\.py, line {1 + source.index('def deep(): return deep()')}, in deep\)"
    statement = RAISED[raised][1]
    number = 1 + [line.strip() for line in source].index(statement)
    return rf"\(own\.py, line {number}\)" if where == "import" else rf"\(own\.py, line {number}, in {where}\)"


def check_refused(capfd) -> str:
    """Exactly one line on standard error, nothing else anywhere; that line."""
    stdout, stderr = capfd.readouterr()
    (line,) = [line for line in stderr.splitlines() if not line.startswith("compiling kernels")]
    assert line.startswith("wingslevel: ")
    assert not stdout
    return line


BEFORE = [(raised, "import", "fly") for raised in RAISED]
BEFORE += [(raised, "__init__", "fly") for raised in ("error", "exit", "ctrl_c", "stop", "silent", "odd", "late")]
BEFORE += [(raised, where, command) for command in COMMANDS for where in ("import", "__init__") for raised in ("exit",)]
BEFORE += [("exit", where, command) for command in COMMANDS for where in ("params", "heading_reference")]
BEFORE += [("ctrl_c", "uses", "compare")]


@pytest.mark.parametrize(("raised", "where", "command"), BEFORE)
def test_flight_code_that_raises_before_the_flight_is_one_line_and_exit_code_2(
    here: Path, capfd, raised: str, where: str, command: str
) -> None:
    """Import, constructor and what is asked of it before: refused with file and line, nothing written."""
    (here / "own.py").write_text(own(where, raised))
    assert run(list(COMMANDS[command])) == 2
    assert re.search(rf": {RAISED[raised][2]} {place(where, raised)}$", check_refused(capfd))
    assert not (here / "flights").exists()


IN_FLIGHT = [(raised, "update", "fly") for raised in RAISED]
IN_FLIGHT += [(raised, "reset", "fly") for raised in ("error", "exit", "ctrl_c", "stop", "silent", "odd", "late")]
IN_FLIGHT += [(raised, "learnt", "fly") for raised in ("error", "exit", "stop")]
IN_FLIGHT += [
    ("exit", where, command) for command in ("check", "compare", "replay") for where in ("reset", "update", "learnt")
]
IN_FLIGHT += [(raised, "replay", "replay") for raised in RAISED]
IN_FLIGHT += [("stop", where, "replay") for where in ("reset", "rejected", "refused")]
IN_FLIGHT += [("ctrl_c", "replay", "compare")]


@pytest.mark.parametrize(("raised", "where", "command"), IN_FLIGHT)
def test_flight_code_that_raises_in_flight_is_told_and_exit_code_1(
    here: Path, capfd, raised: str, where: str, command: str
) -> None:
    """A failure is a result: the line, the exit code, and everything that was recorded, of others too."""
    (here / "own.py").write_text(own(where, raised))
    assert run(list(COMMANDS[command])) == 1
    stdout, stderr = capfd.readouterr()
    assert "Traceback" not in stdout + stderr
    assert "wingslevel: " not in stderr
    assert len(re.findall(rf": {RAISED[raised][2]} {place(where, raised)}", stdout)) >= 1
    recordings = [recording.load(path.parent) for path in here.glob("flights/*/manifest.json")]
    failed = [flight for flight in recordings if flight.outcome == Outcome.ESTIMATOR_FAILED]
    assert len(failed) == (command in ("fly", "replay"))
    assert len(recordings) == {"fly": 1, "replay": 2}.get(command, 0)
    for flight in failed:
        assert re.search(place(where, raised), flight.message)
        assert str(here) not in flight.message


@pytest.mark.parametrize("where", ["reset", "update", "replay"])
def test_bench_of_an_estimator_that_fails_is_one_line_and_exit_code_1(here: Path, capfd, where: str) -> None:
    """It was flown, and failed; a report tells that too."""
    (here / "own.py").write_text(own(where, "exit"))
    assert run([*COMMANDS["bench"], "--json", "bench.json"]) == 1
    assert re.search(rf"Mine at 0.0\d s: SystemExit: 0 {place(where, 'exit')}$", check_refused(capfd))
    assert '"passed": false' in (here / "bench.json").read_text()


@pytest.mark.parametrize("raised", ["error", "ctrl_c", "stop"])
@pytest.mark.parametrize("where", ["reset", "update"])
def test_autopilot_that_raises_in_flight_is_told_and_exit_code_1(here: Path, capfd, raised: str, where: str) -> None:
    """The other half of flight code."""
    arguments = {"reset": "self", "update": "self, estimate, m, setpoint"}
    lines = [f"    def {name}({of_it}):\n        {RAISED[raised][1] if name == where else 'pass'}" for name, of_it in
             arguments.items()]  # fmt: skip
    (here / "pilot.py").write_text("class Pilot:\n" + "\n".join(lines) + "\n")
    assert run([*FLY[:-2], "--autopilot", "pilot.py:Pilot"]) == 1
    (manifest,) = here.glob("flights/*/manifest.json")
    flight = recording.load(manifest.parent)
    assert flight.outcome == Outcome.AUTOPILOT_FAILED
    number = 3 if where == "reset" else 5
    assert flight.message.endswith(f"(pilot.py, line {number}, in {where})")


def test_syntax_error_names_its_own_file_and_line(here: Path, capfd) -> None:
    """Also where it is in a file that the file imports."""
    (here / "own.py").write_text("\nimport broken_helper_of_own\n")
    (here / "broken_helper_of_own.py").write_text("\n\nx = = 1\n")
    assert run(list(FLY)) == 2
    assert check_refused(capfd).endswith("SyntaxError: invalid syntax (broken_helper_of_own.py, line 3)")


def test_place_is_the_innermost_line_of_the_users_own_code(here: Path, capfd) -> None:
    """NumPy raised, called by a helper, called by the constructor: the helper's line."""
    (here / "own.py").write_text(
        "import numpy as np\n"
        "def helper():\n"
        "    return np.linalg.inv(np.zeros((3, 3)))\n"
        "class Mine:\n"
        "    def __init__(self): helper()\n"
        "    def update(self, m): pass\n"
    )
    assert run(list(FLY)) == 2
    assert check_refused(capfd).endswith("LinAlgError: Singular matrix (own.py, line 3, in helper)")


def test_numba_error_is_told_by_its_first_line(here: Path, capfd) -> None:
    """The rest is a page long."""
    (here / "own.py").write_text(
        "import numba\n"
        "@numba.njit\n"
        "def kernel(x): return x + no_such_name\n"
        "class Mine:\n"
        "    def __init__(self): kernel(1.0)\n"
        "    def update(self, m): pass\n"
    )
    assert run(list(FLY)) == 2
    line = check_refused(capfd)
    assert re.search(
        r"TypingError: Failed in nopython mode pipeline \(step: nopython frontend\) \(own.py, line 5", line
    )


@pytest.mark.parametrize("by_environment", [False, True])
def test_traceback_is_shown_where_it_is_asked_for(here: Path, capfd, monkeypatch, by_environment: bool) -> None:
    """Before the command, or by the environment, as worker processes are told; the line comes besides."""
    (here / "own.py").write_text(own("__init__", "error"))
    if by_environment:
        monkeypatch.setenv("WINGSLEVEL_TRACEBACK", "1")
    assert run([*([] if by_environment else ["--traceback"]), *FLY]) == 2
    _, stderr = capfd.readouterr()
    assert "Traceback (most recent call last):" in stderr
    assert '/own.py", line ' in stderr
    assert stderr.splitlines()[-1].startswith("wingslevel: estimator 'own.py:Mine': ZeroDivisionError")
    if not by_environment:
        assert run(list(FLY)) == 2
        assert "Traceback" not in capfd.readouterr().err


def test_traceback_of_an_exception_that_cannot_be_printed_is_shown_as_far_as_it_goes(here: Path, capfd) -> None:
    """The switch makes nothing worse."""
    (here / "own.py").write_text(own("update", "silent"))
    assert run(["--traceback", *FLY]) == 1
    assert "own.py" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("command", "says"),
    [
        (("replay", "log.csv", "--estimator", ","), "--estimator ',': an empty name"),
        (("replay", "log.csv", "--estimator", ""), "--estimator: the text is empty"),
        (("compare", "bench_rest", "--estimators", " , "), "--estimators ' , ': an empty name"),
        (("replay", "log.csv", "--withhold", ","), "--withhold ',': an empty name"),
    ],
)
def test_list_that_names_nothing_is_refused(here: Path, capfd, command, says) -> None:
    """It is not the same as leaving the option out."""
    assert run(list(command)) == 2
    assert says in check_refused(capfd)


@pytest.mark.parametrize("statement", ["signal.raise_signal(signal.SIGINT)", "swallowed()"])
@pytest.mark.parametrize("where", ["import", "__init__"])
def test_ctrl_c_while_flight_code_is_loaded_ends_the_command(
    here: Path, ctrl_c, capfd, where: str, statement: str
) -> None:
    """A real one, even one that the code swallows: not the code's fault."""
    head = (
        "import signal\n"
        "def swallowed():\n"
        "    try: signal.raise_signal(signal.SIGINT)\n"
        "    except BaseException: raise ValueError('nothing')\n"
    )
    (here / "own.py").write_text(
        f"{head}{statement if where == 'import' else ''}\n"
        f"class Mine:\n    def __init__(self): {statement}\n    def update(self, m): pass\n"
    )
    assert run(list(FLY)) == 130
    assert capfd.readouterr().err == "wingslevel: interrupted\n"


def test_time_limit_while_flight_code_is_made_passes_through(here: Path) -> None:
    """It is the flight's, and no fault that the code could be blamed for."""
    (here / "own.py").write_text(
        "class Mine:\n    def __init__(self):\n        while True: pass\n    def update(self, m): pass"
    )
    with pytest.raises(TimedOut), limited(0.1):
        load_estimator("own.py:Mine")


@pytest.mark.parametrize("raised", ["exit", "ctrl_c", "stop", "silent"])
@pytest.mark.parametrize("place_of", ["site-packages", "."])
def test_entry_point_that_raises_is_refused_with_the_line_of_its_package(
    here: Path, monkeypatch, raised: str, place_of: str
) -> None:
    """Installed code is not the user's, but for the package that offers the estimator."""
    folder = here / place_of / f"offered_{raised}"
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text(own("import", raised))
    monkeypatch.syspath_prepend(str(folder.parent))
    point = EntryPoint("theirs", f"offered_{raised}:Mine", "wingslevel.estimators")
    monkeypatch.setattr(entry_points, "entry_points", lambda group: [point] if group == point.group else [])
    number = 1 + own("import", raised).splitlines().index(RAISED[raised][1])
    line = rf"estimator 'theirs' of an installed package: .* \(__init__\.py, line {number}\)$"
    with pytest.raises(plugins.PluginError, match=line):
        load_estimator("theirs")


def test_module_that_raises_is_refused_with_its_line(here: Path) -> None:
    """Named as ``package.module:Class``."""
    (here / "package_of_own").mkdir()
    (here / "package_of_own" / "__init__.py").touch()
    (here / "package_of_own" / "inner.py").write_text(own("__init__", "exit"))
    with pytest.raises(plugins.PluginError, match=r"SystemExit: 0 \(inner\.py, line 6, in __init__\)$"):
        load_estimator("package_of_own.inner:Mine")
