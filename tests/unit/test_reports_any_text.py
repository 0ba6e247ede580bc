"""Reports of flights whose names, checks, units and messages hold anything: nothing is lost, and nothing acts."""

import io
import json
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from xml.etree import ElementTree

import pytest

from scenarios.harness.checks import Row
from scenarios.harness.cli import console
from scenarios.harness.commands import check as gate
from scenarios.harness.commands import comparison
from scenarios.harness.verdict import FlightVerdict, PooledVerdict, Verdict
from sim.log import Outcome
from sim.outside.wording import brief, json_text, markdown, plotted, printable

TEXTS = {
    "surrogate": "a\ud800b", "file_name": "filter\udcff.py:F", "control": "\x00\x07\x08\x1b[31mred\x7f",
    "html": "<script>x</script> & <b>", "markdown": "a|b `c` *d* _e_ [f](g) # h ~i~ $j$ !k \\",
    "markup": "[bold]x[/] [/] [red]", "direction": "\u202eabc\u2066", "long": "y" * 10_000,
    "lines": "one\ntwo\r\nthree\u2028four", "emoji": "\U0001f600 e\u0301 \u0645\u0631\u062d\u0628\u0627",
    "not_unicode": "\ufffe\uffff\x85",
}  # fmt: skip
NAMES = pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)


def verdict_with(text: str, *, outcome: Outcome = Outcome.GROUND_CONTACT) -> Verdict:
    """A failed flight in which every text is `text`."""
    row = Row(text, text, 1234.5, "<=", 6.0, False, text)
    flight = FlightVerdict(text, text, 3, outcome, (row,), {text: 1.0}, text)
    return Verdict((flight,), (PooledVerdict(text, text, 1, (row,)),))


@contextmanager
def terminal() -> Iterator[io.TextIOWrapper]:
    """Standard output as one that knows nothing but ASCII."""
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii", write_through=True)
    with redirect_stdout(stream):
        console.be_tolerant()
        yield stream


def printed(stream: io.TextIOWrapper) -> str:
    """What went to it."""
    stream.flush()
    return stream.buffer.getvalue().decode("ascii")  # type: ignore[attr-defined]


@NAMES
def test_junit_of_any_text_is_xml_that_says_it(text: str) -> None:
    """It parses, keeps its counts, and holds no character that XML or a terminal would stumble over."""
    written = verdict_with(text).to_junit()
    written.encode("utf-8")
    root = ElementTree.fromstring(written)
    (suite,) = root.findall("testsuite")
    assert suite.get("failures") == str(len(suite.findall("testcase/failure"))) == "2"
    assert all(value.isprintable() for element in root.iter() for value in element.attrib.values())
    assert printable(text, 50)[:50] in suite.find("testcase").get("name")


@NAMES
def test_markdown_of_any_text_keeps_its_tables(text: str) -> None:
    """Every line of a table has four cells, no HTML is left, and the number is there."""
    written = verdict_with(text).to_markdown()
    written.encode("utf-8")
    table = [line for line in written.splitlines() if line.startswith("|")]
    bars = [line.replace("\\\\", "").replace("\\|", "").count("|") for line in table]
    assert bars == [5] * len(table)
    assert len(table) == 6
    assert "<script" not in written
    assert all(line.isprintable() for line in written.split("\n"))
    assert written.count("1234 ") == 2


@NAMES
def test_json_of_any_text_is_accepted_by_a_strict_reader(text: str) -> None:
    """It is Unicode without lone surrogates, and any other text comes back as it was."""
    written = verdict_with(text).to_json_text()
    data = json.loads(written.encode("utf-8"), parse_constant=pytest.fail)
    (flight,) = data["flights"]
    flight["message"].encode("utf-8")  # refuses a lone surrogate
    if "\\ud" not in repr(text):
        assert flight["message"] == text


@NAMES
def test_terminal_of_any_text_prints_it_and_obeys_none(text: str, monkeypatch) -> None:
    """No control character gets through to 60 columns of ASCII; the numbers do."""
    monkeypatch.setenv("COLUMNS", "60")
    with terminal() as stream:
        gate.print_report(verdict_with(text))
        console.out().print(console.table("t", ("", "n"), [[text, "5678"]], wrapping=(0,)))
    shown = printed(stream)
    assert all(c == "\n" or c.isprintable() for c in shown)
    assert "1234" in shown
    assert "5678" in shown
    assert "FAILED: 0 of 1 flights, 0 of 1 scenarios pooled passed" in shown


@pytest.mark.parametrize("columns", [1, 20, 40, 60, 80])
def test_tables_narrow_keep_names_and_numbers(columns: int, monkeypatch, capsys) -> None:
    """Name, numbers and units are whole on any terminal."""
    monkeypatch.setenv("COLUMNS", str(columns))
    name = "folder/my_filter_of_a_long_name.py:MyFilter"
    rows = [Row("inclination error RMS", "deg", 12345.678, "<=", 6.0, False, "3 of 4 samples")]
    console.out().print(console.verdict_table(f"crosswind, {name}", rows))
    headings = comparison._HEADINGS
    cells = [name, "GAP", " 1.23  4.5  6.7", "8.9 c", "0.55*", "9/10 5/7"]
    console.out().print(console.table("crosswind", headings, [cells], text=(0, 1), wrapping=(0,)))
    shown = " ".join(capsys.readouterr().out.split())
    assert shown.count(name) == 2
    for text in ("12346", "<= 6", "deg", "FAIL", "4 samples", "1.23 4.5 6.7", "8.9 c", "0.55*", "9/10 5/7", "GAP"):
        assert text in shown


def test_error_of_any_text_is_one_line(capsys) -> None:
    """Whatever an option held."""
    for text in TEXTS.values():
        console.error(f"no such thing: {text}")
    lines = capsys.readouterr().err.split("\n")
    assert len(lines) == len(TEXTS) + 1
    assert all(line.isprintable() and len(line) < 2100 for line in lines)


def test_json_text_numbers_that_are_none_become_null() -> None:
    """NaN and infinity are no JSON."""
    assert json.loads(json_text({"a": [float("nan"), float("inf"), 1.5], 2: (True, None)})) == {
        "a": [None, None, 1.5], "2": [True, None],
    }  # fmt: skip


def test_markdown_leaves_plain_names_as_they_are() -> None:
    """Underscores inside a name mark nothing."""
    assert markdown("hand_launch_gust, my filter (2.5 m/s)") == "hand_launch_gust, my filter (2.5 m/s)"
    assert markdown("<b>|_x_") == r"&lt;b&gt;\|\_x\_"


def test_plotted_dollars_are_no_mathematics() -> None:
    """Matplotlib would otherwise refuse half a formula, and lose the picture."""
    assert plotted(r"$\frac{1$") == r"\$\frac{1\$"


def test_brief_of_a_huge_value_is_short() -> None:
    """Thousands of digits or brackets are not repeated."""
    deep: list[object] = []
    for _ in range(100_000):
        deep = [deep]
    assert all(len(brief(value)) < 100 for value in ("9" * 5000, 10**4999, deep, "\x00" * 99))
