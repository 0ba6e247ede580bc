"""Claims: the decorator, the verdict rule, the registry, the pictures, the page, and the command."""

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest

from scenarios.harness.claims import claim as claim_rules
from scenarios.harness.claims import run as claim_run
from scenarios.harness.claims.claim import Claim, Finding, Paper, Verdict, line
from scenarios.harness.claims.page import page
from scenarios.harness.claims.picture import BLUE, RED, Panel, png
from scenarios.harness.claims.run import SECTIONS, Findings, Found, Task, claims, matching
from scenarios.harness.cli import console
from scenarios.harness.cli import values as completion
from scenarios.harness.cli.app import run

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "claims.md"
COMPUTED = [name for name, claim in claims().items() if not claim.seeds]
HOLDS, FAILS = line("holds", "deg", 1.0, "<=", 2.0), line("fails", "deg", 3.0, "<=", 2.0)


def panel():
    """A panel with one straight line."""
    made = Panel("Title", "deg")
    made.curve([0.0, 1.0], [0.0, 1.0], BLUE)
    return made


def finding(lines=(HOLDS,), conditional_lines=(), summary="It is so."):
    """A finding with these lines."""
    condition = "if it rains" if conditional_lines else ""
    return Finding(lines, summary, [panel()], condition, conditional_lines)


def claim(name="so", function=lambda seeds: finding(), expected=Verdict.CONFIRMED, **changes):
    """A claim that is in no paper."""
    fields = {"title": "It is so", "paper": Paper.THEORY, "place": "GPS, somewhere", "says": "So it is.", "seeds": 2}
    return Claim(name=name, function=function, expected=expected, **{**fields, **changes})


@pytest.fixture
def only(monkeypatch, in_process, tmp_path):
    """Have these claims alone, in an empty working directory, in this process."""
    monkeypatch.chdir(tmp_path)

    def have(*these):
        by_name = {one.name: one for one in these}
        monkeypatch.setattr(claim_run, "claims", lambda: by_name)
        return tmp_path

    return have


@pytest.mark.parametrize(
    ("lines", "conditional_lines", "verdict"),
    [
        ((HOLDS,), (), Verdict.CONFIRMED),
        ((HOLDS,), (FAILS,), Verdict.CONFIRMED),
        ((HOLDS, FAILS), (HOLDS,), Verdict.WITH_CONDITION),
        ((FAILS,), (HOLDS, FAILS), Verdict.REFUTED),
        ((HOLDS, FAILS), (), Verdict.REFUTED),
    ],
)
def test_verdict_follows_from_the_lines_alone(lines, conditional_lines, verdict):
    """All lines, else all lines under the condition, else refuted."""
    assert finding(lines, conditional_lines).verdict == verdict


@pytest.mark.parametrize("nothing", [np.nan, np.inf, -np.inf])
def test_line_not_measured_does_not_hold(nothing):
    """What could not be measured confirms nothing, whichever way the limit lies."""
    assert not line("x", "", nothing, "<=", 1.0).passed
    assert not line("x", "", nothing, ">=", 1.0).passed


def test_finding_without_lines_or_with_half_a_condition_is_refused():
    """A verdict needs lines, and a condition needs lines of its own."""
    with pytest.raises(ValueError, match=r"Finding\.lines: empty"):
        finding(lines=())
    with pytest.raises(ValueError, match="needs conditional_lines"):
        Finding((HOLDS,), "", condition="if it rains")
    with pytest.raises(ValueError, match="needs conditional_lines"):
        Finding((HOLDS,), "", conditional_lines=(HOLDS,))


def test_decorated_function_is_a_claim_of_its_name_and_docstring():
    """The first line is the title without its full stop, the rest is the claim on one line."""

    @claim_rules.claim(Paper.STARLINO, "Part 4", expected=Verdict.REFUTED, seeds=3)
    def grass_is_red(seeds):
        """Grass is red.

        Grass is red, whatever
        the season.
        """
        return finding(summary=f"{len(seeds)} meadows.")

    made = grass_is_red
    assert (made.name, made.title, made.says) == ("grass_is_red", "Grass is red", "Grass is red, whatever the season.")
    assert (made.paper, made.place, made.expected, made.seeds) == (Paper.STARLINO, "Part 4", Verdict.REFUTED, 3)
    assert made.measure((0, 5)).summary == "2 meadows."


def test_claim_without_seeds_is_measured_without_them():
    """What is deterministic takes no seeds, whatever seeds are asked for."""

    @claim_rules.claim(Paper.THEORY, "GPS")
    def snow_is_white():
        """Snow is white.

        Snow is white.
        """
        return finding()

    assert snow_is_white.seeds == 0
    assert snow_is_white.measure((1, 2)).verdict == Verdict.CONFIRMED


def test_decorator_refuses_a_docstring_without_the_claim_and_a_function_with_other_arguments():
    """The mistakes of somebody who adds a claim are named where they are made."""

    def short(seeds):
        """Only a title."""

    def deaf():
        """Title.

        The claim.
        """

    with pytest.raises(ValueError, match="claim short: the docstring must be a title, an empty line and the claim"):
        claim_rules.claim(Paper.THEORY, "GPS", seeds=2)(short)
    with pytest.raises(ValueError, match=r"claim deaf: takes 0 arguments; with seeds=2 it must take 1"):
        claim_rules.claim(Paper.THEORY, "GPS", seeds=2)(deaf)


def test_deciding_line_is_the_first_that_fails_else_the_closest():
    """What a reader wants to see first."""
    close = line("close", "", 1.9, "<=", 2.0)
    assert finding((HOLDS, close)).deciding_line == close
    assert finding((close, FAILS, HOLDS)).deciding_line == FAILS


def test_registry_orders_claims_by_paper_and_section():
    """A reader follows the papers; within the theory its sections, wherever the claims are written."""
    papers = [one.paper for one in claims().values()]
    assert papers == sorted(papers, key=list(Paper).index)
    places = [one.place.replace("isation", "ization") for one in claims().values() if one.paper == Paper.THEORY]
    known = [[i for i, s in enumerate(SECTIONS) if place.startswith(s)] for place in places]
    numbers = [found[0] if found else len(SECTIONS) for found in known]
    assert numbers == sorted(numbers)
    assert len(set(numbers)) > 3


def test_matching_takes_names_and_patterns_and_refuses_what_nothing_is_called():
    """Each claim once, in the order of the page."""
    assert matching([]) == list(claims().values())
    assert [one.name for one in matching(["second_*", "second_order"])] == ["second_order"]
    with pytest.raises(ValueError, match="unknown claim 'second_oder': did you mean second_order"):
        matching(["second_oder"])


def test_completion_reads_the_names_of_all_claims_from_the_source():
    """Importing them takes seconds, so the names are found by the decorator."""
    assert completion.claims("") == sorted(claims())


def test_claims_called_alike_are_refused(monkeypatch):
    """A name is a picture's file and an anchor of the page."""
    from scenarios.claims import feedback, matrix

    another = dataclasses.replace(matrix.renormalisation, title="Another")
    monkeypatch.setattr(feedback, "another", another, raising=False)
    with pytest.raises(ValueError, match="two claims are named 'renormalisation'"):
        claims.__wrapped__()


def test_claim_imported_by_another_module_counts_once(monkeypatch):
    """A module of claims may use a claim of another."""
    from scenarios.claims import feedback, matrix

    monkeypatch.setattr(feedback, "borrowed", matrix.renormalisation, raising=False)
    assert list(claims.__wrapped__()) == list(claims())


def test_seeds_are_those_given_else_as_many_as_each_claim_wants(only):
    """A claim that leaves nothing to chance is given none to fly."""
    given = {}

    def noting(name):
        return lambda seeds=(): given.update({name: tuple(seeds)}) or finding()

    these = [claim("flown", noting("flown")), claim("computed", noting("computed"), seeds=0)]
    only(*these)
    claim_run.measure(these, None, 1, lambda done, total: None)
    assert given == {"flown": (0, 1), "computed": ()}
    findings = claim_run.measure(these, [7], 1, lambda done, total: None)
    assert given == {"flown": (7,), "computed": ()}
    assert [found.seeds for found in findings.found] == [1, 0]


def test_page_has_summary_lines_condition_and_pictures(only):
    """Everything of a finding is on the page, and the summary links to it."""
    only(claim("so", title="It is so", expected=Verdict.WITH_CONDITION))
    text = page([Found("so", finding((FAILS,), (HOLDS,), "It is, if wet.").without_picture(), 3)], "images/claims")
    for part in (
        "1 claims: 0 confirmed, 1 confirmed with a condition, 0 refuted",
        "| 🟡 | [It is so](#so) | fails | 3.00 deg | ≤ 2 deg |",
        '<a id="so"></a>',
        "> So it is.",
        "*GPS, somewhere*",
        "**Confirmed with a condition**, over 3 seeds. It is, if wet.",
        "| fails | 3.00 deg | ≤ 2 deg | **no** |",
        "| *if it rains:* | | | |\n| holds | 1.00 deg | ≤ 2 deg | yes |",
        "![It is so](images/claims/so.png)",
    ):
        assert part in text


@pytest.mark.parametrize(("expected", "code"), [(Verdict.CONFIRMED, 0), (Verdict.REFUTED, 1)])
def test_command_answers_with_one_where_a_verdict_differs(only, capsys, expected, code):
    """The command is a regression test: one line says which claim came out differently."""
    only(claim("so", expected=expected))
    assert run(["claims", "--workers", "1"]) == code
    out, err = capsys.readouterr()
    assert "so   confirmed   holds: 1.00 deg, limit <= 2 deg" in out
    assert err == ("wingslevel: claim so: confirmed, expected refuted\n" if code else "")


def test_command_goes_on_after_a_claim_that_raises(only, capsys):
    """One line names it; the others are measured, and half a page is not written."""

    def broken(seeds):
        raise ZeroDivisionError("nothing\nthere")

    folder = only(claim("broken", broken), claim("so"))
    assert run(["claims", "--workers", "1", "--markdown", "claims.md", "--json", "found.json"]) == 3
    out, err = capsys.readouterr()
    assert err == "wingslevel: claim broken: ZeroDivisionError: nothing there\n"
    assert "not measured" in out
    assert "1 confirmed, 0 confirmed with a condition, 0 refuted" in out
    report = json.loads((folder / "found.json").read_text())
    assert [(one["claim"], one["verdict"]) for one in report["claims"]] == [("broken", None), ("so", "confirmed")]
    assert report["passed"] is False
    assert sorted(path.name for path in folder.iterdir()) == ["found.json"]


def test_command_prints_all_of_a_claim_that_is_named_and_writes_what_is_wanted(only, capsys):
    """JSON, page and picture of one claim, in the places that were named."""
    folder = only(claim("so", finding, seeds=0), claim("other"))
    arguments = ["claims", "so", "--workers", "1", "--json", "-", "--markdown", "page.md", "--pictures", "drawn/here"]
    assert run(arguments) == 0
    out, err = capsys.readouterr()
    for part in ("It is so (so)", "claim    So it is.", "result   It is so.", "holds", "confirmed, deterministic"):
        assert part in err
    (report,) = json.loads(out)["claims"]
    assert (report["claim"], report["summary"], report["seeds"]) == ("so", "It is so.", 0)
    assert (report["condition"], report["conditional_lines"]) == ("", [])
    assert report["lines"] == [
        {"name": "holds", "unit": "deg", "measured": 1.0, "sense": "<=", "limit": 2.0, "passed": True}
    ]
    assert "![It is so](drawn/here/so.png)" in (folder / "page.md").read_text(encoding="utf-8")
    assert (folder / "drawn" / "here" / "so.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in folder.iterdir()) == ["drawn", "page.md"]


def test_command_writes_nothing_by_default(only):
    """By default it prints."""
    folder = only(claim("so"))
    assert run(["claims", "--workers", "1"]) == 0
    assert not list(folder.iterdir())


def test_command_lists_without_measuring(only, capsys):
    """What there is, at once."""
    only(claim("so", lambda seeds: pytest.fail("measured")))
    assert run(["claims", "--list", "--json", "-"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out) == {"Premerlani & Bizard 2009": {"so": "It is so"}}
    assert "It is so" in err


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["nothing"], "unknown claim 'nothing'"),
        (["--seeds", "many"], "seeds = 'many'"),
        (["--markdown", "no/where.md"], "there is no folder"),
        (["--pictures", "file/here"], "is not a writable folder"),
    ],
)
def test_command_refuses_before_anything_is_measured(only, capsys, arguments, problem):
    """Usage is one line and exit code 2."""
    (only(claim("so", lambda seeds: pytest.fail("measured"))) / "file").write_text("")
    assert run(["claims", *arguments]) == 2
    (message,) = capsys.readouterr().err.splitlines()
    assert problem in message


def test_findings_that_were_interrupted_say_so():
    """Ctrl-C leaves claims out, which is not passing."""
    half = Findings((), 1)
    assert half.exit_code == console.INTERRUPTED
    assert half.to_json() == {"passed": False, "claims": [], "interrupted": True}


def test_page_and_pictures_are_the_same_on_any_number_of_workers(tmp_path, capsys):
    """Byte by byte, so that a change of the page is a change of what was found."""
    written = []
    for workers in ("1", "2"):
        folder = tmp_path / workers
        folder.mkdir()
        arguments = [
            "claims",
            "second_order",
            "half_each",
            "--workers",
            workers,
            "--markdown",
            str(folder / "claims.md"),
        ]
        assert run(arguments) == 0
        written.append({p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()})
    assert len(written[0]) == 3
    assert written[0] == written[1]


def drawn(made):
    """The axes of a panel, drawn with matplotlib."""
    from matplotlib.figure import Figure

    ax = Figure().subplots()
    made.draw(ax)
    return ax


def test_picture_is_a_png_of_one_size_and_the_same_bytes_each_time():
    """Whatever the number of panels; and a recorded panel can be drawn again."""
    panels = [panel(), panel()]
    first = png(panels)
    assert first == png(panels)
    assert first[:8] == b"\x89PNG\r\n\x1a\n"
    assert png([panel()])[16:24] == first[16:24]  # width and height


def test_panel_draws_curves_marks_ticks_and_a_legend_of_what_has_a_label():
    """What is recorded comes out on the axes, with its labels."""
    made = Panel("Title", "deg", "weight", log="x", xticks=(0.1, 1, 10), ylim=(0.0, None), legend="upper left")
    made.curves([0.1, 1.0, 10.0], {"one": [1.0, 2.0, 3.0], "two": [3.0, 2.0, 1.0]}, (BLUE, RED), "o-")
    made.traces([([0.1, 10.0], [0.5, 0.5]), ([0.1, 10.0], [0.6, 0.6])], RED, "several")
    made.cloud(1.0, [1.0, 1.5], BLUE)
    made.level(2.5, text="limit")
    made.upright(1.0)
    made.shade(0.2, 0.4, "grey")
    made.between([0.1, 1.0], [0.0, 0.0], [1.0, 1.0], RED)
    ax = drawn(made)
    assert (ax.get_title(loc="left"), ax.get_xlabel(), ax.get_ylabel()) == ("Title", "weight", "deg")
    assert ax.get_xscale() == "log"
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["0.1", "1", "10"]
    assert ax.get_ylim()[0] == 0.0
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["one", "two", "several"]
    assert [list(one.get_ydata()) for one in ax.get_lines()][:2] == [[1.0, 2.0, 3.0], [3.0, 2.0, 1.0]]
    assert len(ax.get_lines()) == 7
    assert {text.get_text() for text in ax.texts} == {"limit", "grey"}


def test_panel_draws_bars_in_groups_with_their_values():
    """Groups stand side by side above their name, each bar with its value."""
    made = Panel("Title", "deg")
    made.bars(["left", "right"], {"one": ([1.0, 2.0], BLUE), "two": ([3.0, 4.0], RED)})
    ax = drawn(made)
    assert [bar.get_height() for bar in ax.patches] == [1.0, 2.0, 3.0, 4.0]
    middles = [bar.get_x() + 0.5 * bar.get_width() for bar in ax.patches]
    assert middles == pytest.approx([-0.195, 0.805, 0.195, 1.195])
    assert [text.get_text() for text in ax.texts] == ["1.0", "2.0", "3.0", "4.0"]
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["left", "right"]
    assert ax.get_xlabel() == ""


def test_panel_without_labels_has_no_legend():
    """Nor one that is told to have none."""
    assert drawn(panel()).get_legend() is None
    silent = Panel("Title", "deg", legend="")
    silent.curve([0.0], [0.0], BLUE, "named")
    assert drawn(silent).get_legend() is None


def _section(name):
    """What the page in the repository says of a claim."""
    return PAGE.read_text(encoding="utf-8").split(f'<a id="{name}"></a>')[1].split('<a id="')[0]


def test_page_in_the_repository_has_every_claim_and_its_picture():
    """Somebody who adds a claim writes the page anew: wingslevel claims --markdown docs/claims.md"""
    text = PAGE.read_text(encoding="utf-8")
    assert re.findall(r'<a id="(\w+)"></a>', text) == list(claims())
    pictures = {path.stem for path in (PAGE.parent / "images" / "claims").glob("*.png")}
    assert pictures == set(claims())
    for name, one in claims().items():
        section = _section(name)
        assert f"### {one.title}\n" in section
        assert f"> {one.says}\n" in section
        assert f"**{str(one.expected).capitalize()}**" in section


@pytest.mark.parametrize("name", COMPUTED)
def test_page_in_the_repository_says_what_is_computed_now(name):
    """Of every claim that needs no flight: verdict, each measured value, and a picture that can be drawn."""
    found = Task(name, (), drawn=True).fly()
    assert found.problem == ""
    assert found.as_expected
    assert len(found.picture) > 10_000  # an empty one is a tenth of that
    lines = dict(re.findall(r"^\| ([^*|]+) \| (\S+)[^|]* \| [≤≥]", _section(name), re.MULTILINE))
    for row in (*found.finding.lines, *found.finding.conditional_lines):
        # Three digits are written; another processor may round the last one otherwise.
        assert float(lines[row.name]) == pytest.approx(
            row.measured, rel=0.06 if abs(row.measured) < 1e-3 else 0.01, abs=1e-12
        )
