"""What the documents show works: every command is run, the estimator is flown, the tables say what is checked."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from estimator import ESTIMATORS
from estimator.instruments import PROPERTIES, Instruments, Known
from scenarios.harness import plugins
from scenarios.harness.cli.app import run
from scenarios.harness.commands.comparison import LETTERS
from scenarios.harness.registry import find

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
DOCUMENTS = (
    "README.md", "CONTRIBUTING.md", "docs/autopilot.md", "docs/claims.md", "docs/instruments.md", "docs/recording.md",
    "docs/replay.md", "docs/reports.md", "docs/gate.md",
)  # fmt: skip

# Commands that are shown and not run here, each with the reason.
NOT_RUN = {
    r"git clone .*": "needs the network",
    r"make (fly|venv|lint|test)": "installs from the network; make test is what runs this",
    r"wingslevel view": "opens a window; refused without a display, see test_view_command_of_the_readme",
    r"wingslevel export .*": "needs a flight, see test_export_commands_of_the_documents",
    r"wingslevel fly hand_launch --live": "opens a window",
    r"wingslevel claims": "minutes of flights; the next line of the README measures one",
    r"wingslevel claims --markdown docs/claims.md": "the same; tests/unit/test_claims.py compares the page",
    r"wingslevel replay .*": "needs a log of one's own; tests/unit/test_cli_replay.py writes some",
    r"wingslevel check --seeds 0-9 .*": "fifty flights, which tests/closed_loop flies; its options are run below",
    r"wingslevel check --json verdict.json .*": "the same",
    r"wingslevel agree .*": "needs the verdicts of two machines; tests/unit/test_agreement.py writes some",
}  # fmt: skip


def blocks(language: str, document: str = "README.md") -> list[str]:
    """Contents of the fenced blocks of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", (ROOT / document).read_text(encoding="utf-8"), re.M | re.S)


def commands() -> list[str]:
    """Every line of every shell block of the documents, each once."""
    lines = [line for document in DOCUMENTS for block in blocks("bash", document) for line in block.splitlines()]
    return list(dict.fromkeys(part.strip() for line in lines for part in line.split("&& cd")[:1] if part.strip()))


RUN = [command for command in commands() if not any(re.fullmatch(pattern, command) for pattern in NOT_RUN)]


@pytest.fixture
def here(tmp_path: Path, monkeypatch) -> Path:
    """A working directory with the estimator, the scenario and the autopilot that the documents show, as files."""
    monkeypatch.chdir(tmp_path)
    shown = (*blocks("python"), *blocks("python", "docs/autopilot.md"))
    for name, source in zip(("my_filter.py", "my_route.py", "my_autopilot.py"), shown, strict=True):
        (tmp_path / name).write_text(source, encoding="utf-8")
    return tmp_path


def test_readme_exceptions_are_all_needed() -> None:
    """A reason for not running a command goes when the command goes, and most commands are run."""
    for pattern in NOT_RUN:
        assert any(re.fullmatch(pattern, command) for command in commands()), pattern
    assert len(RUN) >= 8


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("command", RUN)
def test_readme_command_runs(command: str) -> None:
    """A command of the documents is understood and does its work: the flight may fail a check, nothing else."""
    program, *arguments = shlex.split(command)
    assert program == "wingslevel"
    assert run(arguments) in (0, 1)


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
    run(["fly", "hand_launch", "--duration", "20", "--no-rerun"])  # long enough for a replay to judge
    for command in (c for c in commands() if c.startswith("wingslevel export")):
        assert run(shlex.split(command)[1:]) == 0
    assert {"fixes.nmea", "fixes.ubx", "flight.csv", "flight.toml"} <= {path.name for path in here.iterdir()}
    (replay,) = (c for c in commands() if c.startswith("wingslevel replay flight.csv --columns flight.toml"))
    assert run([*shlex.split(replay)[1:], "--no-rerun"]) == 0


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


def test_readme_options_of_the_gate_exist(here: Path) -> None:
    """The command that gates a build writes the three reports that it names."""
    command = next(c for c in commands() if c.startswith("wingslevel check --seeds 0-9"))
    arguments = ["0" if word == "0-9" else word for word in shlex.split(command)[1:]]
    assert run([*arguments, "hand_launch", "--workers", "1"]) in (0, 1)
    assert {"verdict.xml", "verdict.md", "verdict.json"} <= {path.name for path in here.iterdir()}


def test_estimators_page_has_a_row_for_each_with_what_it_uses() -> None:
    """One row for every registered estimator and no other; its letters are those of the class."""
    page = (ROOT / "docs" / "estimators.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+)` \| ([GAPMV]+) \| ", page, re.M))
    assert rows.keys() == ESTIMATORS.keys()
    for name in ESTIMATORS:
        uses = plugins.load_estimator(name).uses  # type: ignore[attr-defined]
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
    mine = plugins.equipped(shown["Mine"], record).code
    assert (mine.latency_s, mine.has_airspeed) == (0.2, True)


def test_documents_link_to_files_that_exist() -> None:
    """Relative links, and paths in backquotes that look like files of ours."""
    for document in DOCUMENTS:
        text, folder = (ROOT / document).read_text(encoding="utf-8"), (ROOT / document).parent
        links = [folder / link for link in re.findall(r"\]\((?!http)([^)#]+)\)", text)]
        paths = [ROOT / path for path in re.findall(r"`((?:estimator|autopilot|sim|scenarios|tests)/[\w./]*)`", text)]
        missing = [str(path) for path in (*links, *paths) if not path.exists()]
        assert not missing, f"{document}: {missing}"


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("index", range(len(blocks("python", "docs/recording.md"))))
def test_recording_examples_read_a_flight(index: int, capsys) -> None:
    """The examples of the page about recordings run as they stand, on the flight that they name."""
    run(["fly", "hand_launch", "--no-rerun"])
    capsys.readouterr()
    done = subprocess.run(
        [sys.executable, "-c", blocks("python", "docs/recording.md")[index]],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONWARNINGS": "error"},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
