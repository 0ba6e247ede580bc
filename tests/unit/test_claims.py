"""Claims: the verdict rule, the registry, the page, and the command."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from scenarios.harness.claims import registry as claim_registry
from scenarios.harness.claims import run as claim_run
from scenarios.harness.claims.claim import Claim, Finding, Paper, Verdict, deciding, line
from scenarios.harness.claims.page import page
from scenarios.harness.claims.registry import SECTIONS, claims, matching
from scenarios.harness.claims.run import Findings, Found, Task
from scenarios.harness.cli import console
from scenarios.harness.cli.app import run

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "claims.md"
COMPUTED = [name for name, claim in claims().items() if not claim.seeds]
HOLDS, FAILS = line("holds", "deg", 1.0, "<=", 2.0), line("fails", "deg", 3.0, "<=", 2.0)


def draw(figure):
    """A picture of nothing much."""
    figure.subplots().plot([0.0, 1.0])


def finding(stands=(HOLDS,), under=(), told="It is so.", seeds=0):
    """A finding with these lines."""
    return Finding(
        stands=stands, told=told, seeds=seeds, draw=draw, condition="if it rains" if under else "", under=under
    )


def claim(name="so", measure=lambda seeds: finding(), expected=Verdict.CONFIRMED, **changes):
    """A claim that stands in no paper."""
    fields = {"title": "It is so", "paper": Paper.THEORY, "place": "GPS, somewhere", "says": "So it is.", "seeds": 2}
    return Claim(name=name, measure=measure, expected=expected, **{**fields, **changes})


@pytest.fixture
def only(monkeypatch, in_process, tmp_path):
    """Have these claims alone, in an empty working directory, in this process."""
    monkeypatch.chdir(tmp_path)

    def have(*these):
        by_name = {one.name: one for one in these}
        monkeypatch.setattr(claim_registry, "claims", lambda: by_name)
        monkeypatch.setattr(claim_run, "claims", lambda: by_name)
        return tmp_path

    return have


@pytest.mark.parametrize(
    ("stands", "under", "verdict"),
    [
        ((HOLDS,), (), Verdict.CONFIRMED),
        ((HOLDS,), (FAILS,), Verdict.CONFIRMED),
        ((HOLDS, FAILS), (HOLDS,), Verdict.WITH_CONDITION),
        ((FAILS,), (HOLDS, FAILS), Verdict.REFUTED),
        ((HOLDS, FAILS), (), Verdict.REFUTED),
    ],
)
def test_verdict_follows_from_the_lines_alone(stands, under, verdict):
    """As it stands, else under its condition, else not at all."""
    assert finding(stands, under).verdict == verdict


@pytest.mark.parametrize("nothing", [np.nan, np.inf, -np.inf])
def test_line_not_measured_does_not_hold(nothing):
    """What could not be measured confirms nothing, whichever way the limit lies."""
    assert not line("x", "", nothing, "<=", 1.0).passed
    assert not line("x", "", nothing, ">=", 1.0).passed


def test_finding_without_lines_or_with_half_a_condition_is_refused():
    """A verdict rests on something, and a condition is told with its lines."""
    with pytest.raises(ValueError, match="no lines"):
        finding(stands=())
    with pytest.raises(ValueError, match="give it with its lines"):
        Finding(stands=(HOLDS,), told="", seeds=0, draw=draw, condition="if it rains")


def test_deciding_line_is_the_first_that_fails_else_the_closest():
    """What a reader wants to see first."""
    close = line("close", "", 1.9, "<=", 2.0)
    assert deciding(finding((HOLDS, close))) == close
    assert deciding(finding((close, FAILS, HOLDS))) == FAILS


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


def test_claims_called_alike_are_refused(monkeypatch):
    """A name is a picture's file and an anchor of the page."""
    from scenarios.claims import feedback, matrix

    monkeypatch.setattr(feedback, "CLAIMS", (matrix.CLAIMS[0],))
    with pytest.raises(ValueError, match="two claims are called 'renormalisation'"):
        claims.__wrapped__()


def test_seeds_are_those_told_else_as_many_as_each_claim_wants(only):
    """A claim that leaves nothing to chance is given none to fly."""
    given = {}

    def noting(name):
        return lambda seeds: given.update({name: tuple(seeds)}) or finding()

    these = [claim("flown", noting("flown")), claim("computed", noting("computed"), seeds=0)]
    only(*these)
    claim_run.measure(these, None, 1, lambda done, total: None)
    assert given == {"flown": (0, 1), "computed": ()}
    claim_run.measure(these, [7], 1, lambda done, total: None)
    assert given == {"flown": (7,), "computed": ()}


def test_page_has_summary_lines_condition_and_pictures(only):
    """Everything of a finding is on the page, and the summary links to it."""
    only(claim("so", title="It is so", expected=Verdict.WITH_CONDITION))
    text = page([Found("so", finding((FAILS,), (HOLDS,), "It is, if wet.", 3).undrawn())], "images/claims")
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
    assert err == ("wingslevel: claim so: confirmed, where refuted was expected\n" if code else "")


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
    told = json.loads((folder / "found.json").read_text())
    assert [(one["claim"], one["verdict"]) for one in told["claims"]] == [("broken", None), ("so", "confirmed")]
    assert told["passed"] is False
    assert sorted(path.name for path in folder.iterdir()) == ["found.json"]


def test_command_tells_all_of_a_claim_that_is_named_and_writes_what_is_asked(only, capsys):
    """JSON, page and picture of one claim, in the places that were named."""
    folder = only(claim("so"), claim("other"))
    arguments = ["claims", "so", "--workers", "1", "--json", "-", "--markdown", "page.md", "--pictures", "drawn/here"]
    assert run(arguments) == 0
    out, err = capsys.readouterr()
    for part in ("It is so (so)", "says   So it is.", "found  It is so.", "holds", "confirmed, nothing left to chance"):
        assert part in err
    (told,) = json.loads(out)["claims"]
    assert told["claim"] == "so"
    assert told["stands"] == [
        {"name": "holds", "unit": "deg", "measured": 1.0, "sense": "<=", "limit": 2.0, "passed": True}
    ]
    assert "![It is so](drawn/here/so.png)" in (folder / "page.md").read_text(encoding="utf-8")
    assert (folder / "drawn" / "here" / "so.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in folder.iterdir()) == ["drawn", "page.md"]


def test_command_writes_nothing_unless_told(only):
    """By default it tells."""
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
    ("arguments", "told"),
    [
        (["nothing"], "unknown claim 'nothing'"),
        (["--seeds", "many"], "seeds = 'many'"),
        (["--markdown", "no/where.md"], "there is no folder"),
        (["--pictures", "file/here"], "is no folder that can be written to"),
    ],
)
def test_command_refuses_before_anything_is_measured(only, capsys, arguments, told):
    """Usage is one line and exit code 2."""
    (only(claim("so", lambda seeds: pytest.fail("measured"))) / "file").write_text("")
    assert run(["claims", *arguments]) == 2
    (message,) = capsys.readouterr().err.splitlines()
    assert told in message


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
    for row in (*found.finding.stands, *found.finding.under):
        # Three digits are written; another processor may round the last one otherwise.
        assert float(lines[row.name]) == pytest.approx(
            row.measured, rel=0.06 if abs(row.measured) < 1e-3 else 0.01, abs=1e-12
        )
