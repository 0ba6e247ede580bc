"""The documents and the help are in plain English: phrases that read like a translation do not come back."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from scenarios.harness.cli.app import app

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", *(f"docs/{p.name}" for p in (ROOT / "docs").glob("*.md")))
INSTEAD = {  # a phrase -> what to write instead
    r"\bone's own\b": "your own",
    r"\bnobody\b": "name what does not happen: 'unknown', 'cannot be commanded'",
    r"\bwhoever\b": "name who",
    r"\b(is|are|was|were) told (of|not|what)\b": "receives, is given, is reported",
    r"nothing is needed but": "requires",
    r"(is|are) answered with": "gets",
    r"\bgo(es)? by the\b": "is relative to, depends on",
    r"\bcopes\b": "say what it does",
    r"plumb line": "gravity",
    r"calls? itself": "reports",
    r"(is|are) done without": "is ignored",
    r"(is|are) silent\b": "does not specify",
    r"what has proved": "validation",
    r"which goes before which": "precedence",
    r"\bthe business of\b": "is handled by",
    r"\bwhat there is\b": "list it",
    r"that can be true or false": "testable",
}


def in_paragraphs(text: str) -> str:
    """`text` without code and quotations, and without line breaks inside a paragraph."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.M | re.S)
    lines = (line for line in text.splitlines() if not line.startswith(">"))  # claims quote the papers
    return re.sub(r"(?<=\S)\n(?=\S)", " ", "\n".join(lines))


def help_texts() -> Iterator[tuple[str, str]]:
    """Name and text of the help of every command and option."""
    commands: dict[str, Any] = vars(typer.main.get_command(app))["commands"]
    for name, command in commands.items():
        yield name, command.help or ""
        for parameter in command.params:
            yield f"{name} {parameter.name}", getattr(parameter, "help", None) or ""


@pytest.mark.parametrize("document", DOCUMENTS)
def test_document_has_no_translated_phrases(document: str) -> None:
    """Each hit is shown with its surroundings and what to write instead."""
    text = in_paragraphs((ROOT / document).read_text(encoding="utf-8"))
    hits = [
        f"...{text[max(0, found.start() - 40) : found.end() + 20]}...: write '{better}'"
        for phrase, better in INSTEAD.items()
        for found in re.finditer(phrase, text, re.I)
    ]
    assert not hits, "\n".join(hits)


def test_help_has_no_translated_phrases() -> None:
    """The same for the help, and every command and option has some."""
    for name, text in help_texts():
        assert text, f"{name} has no help"
        assert not [phrase for phrase in INSTEAD if re.search(phrase, text, re.I)], f"{name}: {text}"


@pytest.mark.parametrize(
    ("text", "clean"),
    [("a sensor of one's\nown", False), ("```text\nnobody\n```\n", True), ("> Whoever flies\n", True)],
)
def test_phrases_are_found_across_lines_but_not_in_code_and_quotations(text: str, clean: bool) -> None:
    """The search itself: a phrase broken by a line end counts; a transcript and a quoted paper do not."""
    paragraphs = in_paragraphs(text)
    assert clean == (not any(re.search(phrase, paragraphs, re.I) for phrase in INSTEAD))
