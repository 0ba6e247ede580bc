"""What the documents show works: every command and every code block is run, the tables are those of the code."""

import contextlib
import io
import json
import os
import re
import shlex
import subprocess
import sys
import sysconfig
import tomllib
from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import wingslevel as wl
from estimator import ESTIMATORS
from estimator.instruments import PROPERTIES, Instruments, Known
from scenarios.harness import equipping
from scenarios.harness.cli.app import run
from scenarios.harness.commands.compare import LETTERS
from scenarios.harness.registry import find

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
DOCUMENTS = ("README.md", "CONTRIBUTING.md", *(f"docs/{path.name}" for path in sorted((ROOT / "docs").glob("*.md"))))

# Commands that are shown and not run here, each with the reason.
NOT_RUN = {
    r"git clone .*": "needs the network",
    r"(pip install|python3 -m venv) .*": "needs the network; tests/packaging/test_wheel.py installs the wheel",
    r"make (fly|venv|lint|test)": "installs from the network; make test is what runs this",
    r"wingslevel view.*": "opens a window; without a display see test_view_command_of_the_readme",
    r"wingslevel fly hand_launch --live": "opens a window",
    r"wingslevel list scenarios --markdown .*": "writes into docs/; tests/unit/test_scenario_page.py runs it",
    r"wingslevel claims( --markdown docs/claims.md)?": "takes minutes; tests/unit/test_claims.py compares the page",
}
# Commands that are run elsewhere: tests/packaging/test_c_page.py runs these where there is a compiler.
ELSEWHERE = (r"(cc|c\+\+|rustc) .*", r"wingslevel fly crosswind --estimator \./mine(_cpp|_rust)?\.so.*")
# Commands that fly many scenarios or seeds: what is run instead, with the same options.
SHORTER = {
    r"(wingslevel check) --seeds 0-9 (.*)": r"\1 hand_launch --seeds 0 --workers 1 \2",
    r"(wingslevel check) (--json verdict.json)": r"\1 hand_launch --seeds 0 --workers 1 \2",
    r"(wingslevel check) (--estimator my_filter.py:\w+) (--junit .*)": r"\1 hand_launch --seeds 0 --workers 1 \2 \3",
}
# What a page takes for granted: commands that are run before it.
BEFORE = {
    "docs/replay.md": ["wingslevel fly hand_launch --no-rerun", "wingslevel export --csv flight.csv"],
    "docs/reports.md": [
        "wingslevel check hand_launch --seeds 0 --workers 1 --json linux/verdict.json",
        "wingslevel check hand_launch --seeds 0 --workers 1 --json mac/verdict.json",
    ],
    "docs/recording.md": ["wingslevel fly hand_launch --no-rerun"],
}  # fmt: skip


class Block(NamedTuple):
    """A fenced block of a document: its language, its text, and the file that it is, if any."""

    language: str
    text: str
    file: str


def blocks_of(document: str) -> list[Block]:
    """The fenced blocks of a document in order; ``<!-- file: NAME -->`` above one makes it a file."""
    text = (ROOT / document).read_text(encoding="utf-8")
    found = re.findall(r"^(?:<!-- file: (\S+) -->\n)?```(\w+)\n(.*?)^```", text, re.M | re.S)
    return [Block(language, body, file) for file, language, body in found]


def blocks(language: str, document: str = "README.md") -> list[str]:
    """Texts of the blocks of one language."""
    return [block.text for block in blocks_of(document) if block.language == language]


def commands_of(block: Block) -> list[str]:
    """The commands of a shell block, or of the steps of a workflow."""
    if block.language == "yaml":
        return re.findall(r"^- run: (.*)$", block.text, re.M)
    lines = block.text.splitlines() if block.language == "bash" else []
    parts = (line.split(" && ")[0].partition("  #")[0].strip() for line in lines)
    return [part for part in parts if part and not part.startswith("#")]


def every_command() -> list[str]:
    """All commands of all documents."""
    return [command for document in DOCUMENTS for block in blocks_of(document) for command in commands_of(block)]


def shown_files() -> dict[str, str]:
    """The files that the documents show, by name."""
    return {block.file: block.text for document in DOCUMENTS for block in blocks_of(document) if block.file}


def is_left_out(command: str) -> bool:
    """Whether a command is not run here."""
    return any(re.fullmatch(pattern, command) for pattern in (*NOT_RUN, *ELSEWHERE))


def is_shown_before(command: str, document: str) -> bool:
    """Whether an earlier document shows the same command, whose result no later command needs."""
    earlier = DOCUMENTS[: DOCUMENTS.index(document)]
    repeated = any(command in commands_of(block) for other in earlier for block in blocks_of(other))
    return repeated and not command.startswith("wingslevel export")


def execute(command: str) -> None:
    """Run a command as shown, or its shorter form: a flight may fail a check, nothing else."""
    for pattern, instead in SHORTER.items():
        command = re.sub(f"^{pattern}$", instead, command)
    if not any(
        point.name == "wingslevel" for point in entry_points(group="pytest11")
    ):  # not installed since it has one
        command = re.sub("^pytest ", "pytest -p wingslevel.pytest_plugin ", command)
    program, *arguments = shlex.split(os.path.expandvars(command))
    if program == "wingslevel":
        assert run(arguments) in (0, 1), command
        return
    path = os.pathsep.join((sysconfig.get_path("scripts"), os.environ["PATH"]))
    done = subprocess.run(
        command, shell=True, capture_output=True, text=True, check=False, env={**os.environ, "PATH": path}
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"


def in_python(text: str, document: str, namespace: dict[str, Any]) -> None:
    """Run a block of Python in the `namespace` of its page."""
    with contextlib.redirect_stdout(io.StringIO()):
        exec(compile(text, document, "exec"), namespace)


@pytest.fixture
def here(tmp_path: Path, monkeypatch) -> Path:
    """A working directory with the files that the documents show."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path / "summary.md"))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join((str(ROOT), os.environ.get("PYTHONPATH", ""))))
    for name, source in shown_files().items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(source, encoding="utf-8")
    return tmp_path


def test_getting_started_installs_what_its_steps_use() -> None:
    """The page's own command is enough for its last steps, which use pytest and pandas."""
    (install,) = [c for b in blocks_of("docs/getting_started.md") for c in commands_of(b) if c.startswith("pip ")]
    assert install == 'pip install ".[pandas]" pytest'
    assert "pandas" in tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]


def test_exceptions_are_all_needed() -> None:
    """An entry of the tables goes when its command goes, and most commands are run."""
    every = every_command()
    for pattern in (*NOT_RUN, *ELSEWHERE, *SHORTER):
        assert any(re.fullmatch(pattern, command) for command in every), pattern
    not_run = [command for command in every if any(re.fullmatch(pattern, command) for pattern in NOT_RUN)]
    assert len(not_run) < 0.25 * len(every)


@pytest.mark.parametrize("document", [d for d in DOCUMENTS if blocks_of(d)])
def test_blocks_of_a_document_run_in_order(document: str, here: Path) -> None:
    """Commands, Python and data of a page, from top to bottom, in a folder of their own."""
    for command in BEFORE.get(document, ()):
        for word in shlex.split(command):
            (here / word).parent.mkdir(parents=True, exist_ok=True)
        execute(command)
    namespace: dict[str, Any] = {"__name__": "__main__"}
    readers: dict[str, Callable[[str], Any]] = {"toml": tomllib.loads, "json": json.loads}
    for block in blocks_of(document):
        for command in commands_of(block):
            if not is_left_out(command) and not is_shown_before(command, document):
                execute(command)
        if block.language == "python" and not block.file:
            in_python(block.text, document, namespace)
        if block.language in readers:
            readers[block.language](block.text)


def test_view_command_of_the_readme_is_understood(here: Path, capsys, monkeypatch) -> None:
    """Without a display, `view` finds the newest flight and says what to do instead."""
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    run(["fly", "hand_launch", "--duration", "2", "--no-rerun"])
    if sys.platform == "linux":
        assert run(["view"]) == 2
        assert "--web" in capsys.readouterr().err
    assert (here / "flights" / "hand_launch-premerlani-seed0" / "flight.parquet").is_file()


def test_export_commands_of_the_documents_write_what_they_name(here: Path) -> None:
    """They take the newest flight, or the one that they name; a text log replays with its map."""
    run(["fly", "hand_launch", "--no-rerun"])
    for command in dict.fromkeys(c for c in every_command() if c.startswith("wingslevel export")):
        assert run(shlex.split(command)[1:]) == 0
    assert {"fixes.nmea", "fixes.ubx", "flight.csv", "flight.toml"} <= {path.name for path in here.iterdir()}


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("scenario", ["hand_launch", "crosswind", "turns_180", "return_to_launch"])
def test_readme_estimator_passes(scenario: str) -> None:
    """The estimator that the README shows is no toy: it passes these scenarios on the first seed."""
    assert run(["check", scenario, "--seeds", "0", "--workers", "1", "--estimator", "my_filter.py:MyFilter"]) == 0


def test_readme_verdict_shows_the_checks_and_limits_of_the_scenario() -> None:
    """The table in the README is that of the scenario: the same checks in the same order, with the same limits."""
    shown = re.search(r"<!-- verdict of: wingslevel fly hand_launch -->\n```text\n(.*?)```", README, re.S)
    assert shown
    rows = re.findall(r"^ (\S.*?) +[-\d.]+ +([<>]= -?[\d.]+)(?: +\S+)? +pass *$", shown[1], re.M)
    checks = find("hand_launch").checks
    limits = (check.limit if check.per_flight_limit is None else check.per_flight_limit for check in checks)
    assert rows == [(check.name, f"{check.sense} {limit:.4g}") for check, limit in zip(checks, limits, strict=True)]


@pytest.mark.usefixtures("here")
def test_readme_verdict_shows_what_the_estimator_is_given(capsys) -> None:
    """The lines about the instruments are those that the command prints."""
    run(["fly", "hand_launch", "--duration", "1", "--no-rerun"])
    printed = re.search(r"^known .*?(?=^recording)", capsys.readouterr().out, re.M | re.S)
    assert printed
    assert printed[0] in README
    assert printed[0] in (ROOT / "docs" / "instruments.md").read_text(encoding="utf-8")


def test_readme_command_of_the_gate_writes_its_reports(here: Path) -> None:
    """The command that gates a build writes the three reports that it names."""
    execute(next(c for c in every_command() if c.startswith("wingslevel check --seeds 0-9 --junit")))
    assert {"verdict.xml", "verdict.md", "verdict.json"} <= {path.name for path in here.iterdir()}


def test_estimators_page_has_a_row_for_each_with_what_it_uses() -> None:
    """One row for every registered estimator and no other; its letters are those of the class."""
    page = (ROOT / "docs" / "estimators.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+)` \| ([GAPMV]+) \| ", page, re.M))
    assert rows.keys() == ESTIMATORS.keys()
    for name in ESTIMATORS:
        uses = equipping.load_estimator(name).uses  # type: ignore[attr-defined]
        assert rows[name] == "".join(letter for what, letter in LETTERS.items() if what in uses), name


def test_instruments_page_has_a_row_for_each_property_with_what_is_assumed() -> None:
    """Name, meaning and assumption are those of the record."""
    page = (ROOT / "docs" / "instruments.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| (.*?) \| (\S*) ?\|$", page, re.M)
    assert rows == [(name, entry.meaning, _assumed(entry.assumed)) for name, entry in PROPERTIES.items()]


def _assumed(value: float | bool | None) -> str:
    """An assumption as the page has it."""
    if value is None:
        return ""
    return ("no", "yes")[value] if isinstance(value, bool) else f"{value:g}"


def test_instruments_page_shows_an_estimator_that_is_given_what_it_asks_for() -> None:
    """The class of the page, equipped with the sensors of apm2."""
    (source,) = blocks("python", "docs/instruments.md")
    shown: dict[str, Any] = {}
    exec(source, shown)
    shown["Mine"].update = lambda self, m: None
    record = Instruments({"gps_latency_s": Known(0.2, "data sheet"), "use_airspeed": Known(True, "data sheet")})
    mine = equipping.equipped(shown["Mine"], record).code
    assert (mine.latency_s, mine.has_airspeed) == (0.2, True)


def test_documents_link_to_files_that_exist() -> None:
    """Relative links, and paths in backquotes that look like files of ours."""
    for document in DOCUMENTS:
        text, folder = (ROOT / document).read_text(encoding="utf-8"), (ROOT / document).parent
        links = [folder / link for link in re.findall(r"\]\((?!http)([^)#]+)\)", text)]
        paths = [ROOT / path for path in re.findall(r"`((?:estimator|autopilot|sim|scenarios|tests)/[\w./]*)`", text)]
        missing = [str(path) for path in (*links, *paths) if not path.exists()]
        assert not missing, f"{document}: {missing}"


def test_api_page_names_every_public_name() -> None:
    """Its list is `wl.__all__`."""
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    listed = re.search(r"describe:\n\n(.*?)\.\n\n", page, re.S)
    assert listed
    assert re.findall(r"`(\w+)`", listed[1]) == [name for name in wl.__all__ if name != "__version__"]
