"""Every command of the page on what can go wrong is understood, and its flight begins: three seconds of each."""

import re
from pathlib import Path

import pytest

from scenarios.harness.cli.app import run

PAGE = Path(__file__).resolve().parents[2] / "docs" / "going_wrong.md"
COMMANDS = re.findall(r"`wingslevel (fly [^`]*)`", PAGE.read_text(encoding="utf-8"))


def test_page_has_a_command_for_each_row_of_its_tables():
    rows = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    assert len(COMMANDS) > 20
    assert len(COMMANDS) == len(rows) - sum(line.startswith("| what") for line in rows)


@pytest.mark.parametrize("command", COMMANDS)
def test_command_of_the_page_flies(command, tmp_path, monkeypatch, capsys):
    """Exit code 0 or 1: the flight was judged; what is misspelt or impossible is 2, what breaks is 3."""
    monkeypatch.chdir(tmp_path)
    assert run([*command.split(), "--set", "duration_s=3", "--no-rerun"]) in (0, 1), capsys.readouterr().err
