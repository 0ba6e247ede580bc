"""The result of a check as text, the same in every report."""

import json
import math

import pytest

from sim.outside.wording import json_text
from sim.recording import plain
from sim.rows import Row, figures, limit_figures, markdown_cells, markdown_table


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.02193, "0.0219"), (9.996, "10.0"), (772.4, "772"), (-1.0, "-1.00"), (0.0, "0"), (5.8e-7, "5.8e-07"),
     (123456.0, "1.2e+05"), (math.nan, "not measured"), (math.inf, "not measured")],
)  # fmt: skip
def test_figures_have_three_digits(value, text):
    """Angles, heights and parts in a million alike."""
    assert figures(value) == text


@pytest.mark.parametrize(("limit", "text"), [(4.0, "4"), (0.85, "0.85"), (1060.0 / 360.0, "2.944"), (-20.0, "-20")])
def test_limit_figures_are_as_they_were_set(limit, text):
    """No trailing zeros."""
    assert limit_figures(limit) == text


@pytest.mark.parametrize(
    ("row", "value", "limit"),
    [
        (Row("tilt", "deg", 2.0401, "<=", 4.0, True), "2.04 deg", "<= 4 deg"),
        (Row("survived", "", 1.0, ">=", 1.0, True), "1", ">= 1"),
        (Row("power", "", 0.04361, "<=", 0.1, True), "0.0436", "<= 0.1"),
        (Row("flights that pass", "flights", 10, ">=", 10, True), "10 flights", ">= 10 flights"),
        (Row("tilt", "deg", math.nan, "<=", 4.0, False), "not measured", "<= 4 deg"),
        (Row("tilt", "deg", 1.0, "<=", 4.0, False, "3 of 4 samples"), "1.00 deg (3 of 4 samples)", "<= 4 deg"),
    ],
)
def test_value_and_limit_are_written_with_their_unit(row, value, limit):
    """Counts without decimals, a missing value in words, the note beside it."""
    assert (row.value_text, row.limit_text, row.sentence) == (value, limit, f"{value}, limit {limit}")


def test_markdown_of_any_text_is_one_cell_each():
    """Names, units and notes are anyone's: bars, markup and line breaks do nothing."""
    row = Row("a|b *c*", "<m>", 1.0, "<=", 2.0, False, "x\ny|z")
    assert markdown_cells(row) == (r"a\|b \*c\*", r"1.00 &lt;m&gt; (x y\|z)", "≤ 2 &lt;m&gt;")
    assert markdown_table([row, Row("d", "s", 3.0, ">=", 2.0, True)])[2:] == [
        r"| a\|b \*c\* | 1.00 &lt;m&gt; (x y\|z) | ≤ 2 &lt;m&gt; | **FAIL** |",
        "| d | 3.00 s | ≥ 2 s | pass |",
    ]


@pytest.mark.parametrize("measured", [2.5, math.nan])
def test_row_of_json_is_the_row_that_was_written(measured):
    """As a report writes it, and as a recording does, in which NaN is null."""
    row = Row("tilt", "deg", measured, ">=", 4.0, False, "3 of 4 samples")
    for entry in (row.to_json(), plain(row), {**plain(row), "unknown": 1}):
        again = Row.from_json(json.loads(json_text(entry)))
        assert repr(again) == repr(row)  # NaN is not equal to itself
