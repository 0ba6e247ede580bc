"""The verdict as JUnit XML for Jenkins, GitLab and others: suites, cases, failures, errors, times.

A suite is a scenario flown with an estimator.  A flight has a case for each check; a flight that ended in an error
(flight code raised, the simulation blew up, it took too long, its process died) has one case with one error.  The first
case of a flight carries its time, so that the times of the cases add up to that of the suite.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal
from xml.etree import ElementTree

from scenarios.harness.checks import Row
from scenarios.harness.verdict import FlightVerdict, PooledVerdict, Verdict
from sim.outside.wording import printable


@dataclass(frozen=True, slots=True)
class _Case:
    """One case; `kind` and `type` are those of its failure or error, if any."""

    name: str
    time_s: float = 0.0
    kind: Literal["", "failure", "error", "skipped"] = ""
    type: str = ""
    message: str = ""


def junit(verdict: Verdict) -> str:
    """`verdict` as the text of an XML file."""
    root, everything = ElementTree.Element("testsuites", name="wingslevel"), []
    for pool in verdict.pooled:
        flights = verdict.flights_of(pool)
        cases = [*(case for v in flights for case in _of_flight(v)), *_of_pool(pool, sum(v.broken for v in flights))]
        name = printable(f"{pool.scenario}.{pool.estimator}")
        sums = _sums(cases) | {"skipped": str(_count(cases, "skipped"))}
        suite = ElementTree.SubElement(root, "testsuite", {"name": name, **sums})
        for case in cases:
            _write(suite, name, case)
        everything += cases
    if verdict.missing:
        case = _Case("all flights are finished", kind="error", type="interrupted", message=verdict.missing_text)
        _write(ElementTree.SubElement(root, "testsuite", {"name": "incomplete", **_sums([case])}), "incomplete", case)
        everything.append(case)
    root.attrib.update(_sums(everything))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _of_flight(v: FlightVerdict) -> Iterator[_Case]:
    which, wall_s = f"[seed {v.seed} flight {v.flight}]", v.wall_s or 0.0
    if v.broken:
        yield _Case(f"flown {which}", wall_s, "error", str(v.outcome), printable(v.ending))
        return
    for i, row in enumerate(v.rows):
        yield _of_row(row, which, wall_s if i == 0 else 0.0, v.message)


def _of_pool(pool: PooledVerdict, n_broken: int) -> Iterator[_Case]:
    """The pooled checks; if a flight ended in an error, those that fail are skipped: the error is reported already."""
    for row in pool.rows:
        case = _of_row(row, "[pooled]")
        if case.kind and n_broken:
            yield _Case(case.name, kind="skipped", message=f"{n_broken} of {pool.n_flights} flights ended in an error")
        else:
            yield case


def _of_row(row: Row, which: str, time_s: float = 0.0, message: str = "") -> _Case:
    name = f"{printable(row.name)} {which}"
    if row.passed:
        return _Case(name, time_s)
    text = "; ".join(part for part in (row.sentence, message) if part)
    return _Case(name, time_s, "failure", "check", printable(text))


def _write(suite: ElementTree.Element, classname: str, case: _Case) -> None:
    about = {"classname": classname, "name": case.name, "time": f"{case.time_s:.3f}"}
    element = ElementTree.SubElement(suite, "testcase", about)
    if case.kind == "skipped":
        ElementTree.SubElement(element, "skipped", message=case.message)
    elif case.kind:
        ElementTree.SubElement(element, case.kind, message=case.message, type=case.type)


def _count(cases: list[_Case], kind: str) -> int:
    return sum(case.kind == kind for case in cases)


def _sums(cases: list[_Case]) -> dict[str, str]:
    return {
        "tests": str(len(cases)),
        "failures": str(_count(cases, "failure")),
        "errors": str(_count(cases, "error")),
        "time": f"{sum(case.time_s for case in cases):.3f}",
    }
