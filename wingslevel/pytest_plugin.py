"""The pytest plugin: flights as tests, one test for each seed.  Docs: docs/pytest.md.

    @pytest.mark.flight("crosswind", estimator=MyFilter, seeds=range(3))
    def test_crosswind(flown, within):
        within(flown, inclination_rms_deg=4.0)

pytest imports this module in every run: it imports nothing heavy until a test flies.
"""

import inspect
import math
import os
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import pytest

if TYPE_CHECKING:
    from wingslevel import Flight

_NUMBERS = ("inclination_rms_deg", "heading_rms_deg")  # of every flight, for reports
_MARKER = (
    "flight(scenario, estimator=None, seeds=0, params=None, **options): fly a scenario, one test for each seed; the "
    "options are those of wingslevel.fly. Fixtures: flown, within."
)


class _Task(NamedTuple):
    """One flight to be flown: the arguments of `wingslevel.fly`."""

    scenario: Any
    seed: int
    options: Mapping[str, Any]


class _Unusable(NamedTuple):
    """What is wrong with a mark."""

    problem: str


class _Flown(NamedTuple):
    """A flight that was flown, and what keeps its recording."""

    flight: "Flight"
    again: str
    keep: Callable[[], str]


_flown = pytest.StashKey[_Flown]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--wl-seeds`` and ``--wl-out``, and ini values of the same names."""
    group = parser.getgroup("wingslevel", "flights (wingslevel)")
    group.addoption("--wl-seeds", metavar="LIST", help="seeds to fly, 0-9 or 0,2,5-7, instead of those of the tests")
    group.addoption("--wl-out", metavar="DIR", help="folder for the recordings of all flights, not only failed ones")
    parser.addini("wl_seeds", "seeds to fly for tests that name none, 0-9 or 0,2,5-7")
    parser.addini("wl_out", "folder for the recordings of all flights, relative to the ini file")


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marker."""
    config.addinivalue_line("markers", _MARKER)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Make one test for each flight of the markers on a test, or of the closest marker on its class or module."""
    definition = metafunc.definition
    marks = [mark for mark in definition.own_markers if mark.name == "flight"] or [*definition.iter_markers("flight")][
        :1
    ]
    if not marks:
        return
    if "flown" not in metafunc.fixturenames:
        return  # see pytest_runtest_setup
    try:
        flights = [task for mark in reversed(marks) for task in _tasks(mark, metafunc.config, definition)]
    except (TypeError, ValueError) as problem:  # one error for this test; the other tests of its file run
        metafunc.parametrize("flown", [_Unusable(str(problem))], indirect=True, ids=["unusable"])
        return
    ids = [f"{_stem(task.scenario)}-seed{task.seed}" for task in flights]
    if len(set(ids)) < len(ids):
        ids = [f"{_stem(t.scenario)}-{_name(t.options.get('estimator'))}-seed{t.seed}" for t in flights]
    metafunc.parametrize("flown", flights, indirect=True, ids=ids)


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Fail a marked test that does not take its flight."""
    if item.get_closest_marker("flight") and "flown" not in getattr(item, "fixturenames", ("flown",)):
        pytest.fail("a test marked flight takes the argument flown", pytrace=False)


def _tasks(mark: pytest.Mark, config: pytest.Config, item: pytest.Item) -> list[_Task]:
    options = dict(mark.kwargs)
    arguments = [*mark.args, *([options.pop("scenario")] if "scenario" in options else [])]
    if len(arguments) != 1:
        raise ValueError("mark it with pytest.mark.flight(scenario, estimator=..., seeds=...)")
    named = options.pop("seeds", None)
    seeds = config.getoption("--wl-seeds") or (config.getini("wl_seeds") or 0 if named is None else named)
    places = {name: _beside(options[name], item.path.parent) for name in ("estimator",) if name in options}
    scenario = _beside(arguments[0], item.path.parent)
    return [_Task(scenario, seed, {**options, **places}) for seed in _seeds(seeds)]


def _seeds(seeds: Any) -> list[int]:
    """Seeds as numbers: of a text, ``0-9``, of one number, or of several."""
    if isinstance(seeds, str):
        from scenarios.harness.seeds import parse_seeds

        return parse_seeds(seeds)
    return list(dict.fromkeys(map(int, seeds))) if hasattr(seeds, "__iter__") else [int(seeds)]


def _beside(named: Any, folder: Path) -> Any:
    """A file that is not in the working directory, but beside the test, as a path; everything else as it is."""
    if not isinstance(named, str):
        return named
    file, colon, name = named.rpartition(":") if ":" in named else (named, "", "")
    if Path(file).suffix and not Path(file).exists() and (folder / file).exists():
        return f"{folder / file}{colon}{name}"
    return named


@pytest.fixture
def flown(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> "Flight":
    """The flight of this test, as `wingslevel.fly` returns it."""
    import wingslevel as wl

    task: _Task | _Unusable | None = getattr(request, "param", None)
    if task is None:
        pytest.fail("flown: mark the test with pytest.mark.flight(scenario, ...)", pytrace=False)
    if isinstance(task, _Unusable):
        pytest.fail(task.problem, pytrace=False)
    flight, problem = None, ""
    try:
        flight = wl.fly(task.scenario, seed=task.seed, **task.options)
    except (wl.WingslevelError, TypeError) as error:
        problem = str(error)
    if flight is None:  # out of the except block: pytest prints an exception that is being handled as well
        pytest.fail(f"cannot fly {_stem(task.scenario)}: {problem}", pytrace=False)
    name = f"{flight.scenario}-{_name(flight.estimator)}-seed{flight.seed}"
    kept: list[str] = []

    def keep(into: Path | None = None) -> str:
        if not kept:
            kept.append(str(_save(flight, into or tmp_path_factory.mktemp("flights"), name)))
            request.node.user_properties.append(("recording", kept[0]))
        return kept[0]

    # Not by record_property, which warns under --junitxml.
    request.node.user_properties.append(("flight", f"{flight.scenario}, {_name(flight.estimator)}, seed {flight.seed}"))
    request.node.user_properties.extend(
        (number, value) for number in _NUMBERS if (value := flight.metrics.get(number)) is not None
    )
    request.node.stash[_flown] = _Flown(flight, _again(task, request.node), keep)
    if out := _folder(request.config):
        keep(out)
    return flight


def _folder(config: pytest.Config) -> Path | None:
    """Where all recordings go, if they are kept."""
    if option := config.getoption("--wl-out"):
        return Path(config.invocation_params.dir) / option
    ini = config.getini("wl_out")
    return (config.inipath.parent if config.inipath else config.rootpath) / ini if ini else None


def _save(flight: "Flight", into: Path, name: str) -> Path:
    """Record `flight` in a new folder; two tests never share one, also in several processes."""
    from sim.outside.wording import file_name
    from sim.recording import new_folder

    with new_folder(into, file_name(name)) as draft:
        flight.save(draft.path, rerun=False)
    return draft.place


@pytest.fixture
def within(request: pytest.FixtureRequest) -> Callable[..., None]:
    """Demand metrics within limits: ``within(flown, inclination_rms_deg=4.0, height_min_m=(20.0, None))``.

    A number is the highest value allowed, a pair the lowest and the highest.  The names are those of `Flight.metrics`.
    A flight that ended early is never within.
    """

    def _within(flight: "Flight", **limits: float | tuple[float | None, float | None]) -> None:
        __tracebackhide__ = True
        if not limits:
            pytest.fail("within: name a metric and its limit, for instance inclination_rms_deg=4.0", pytrace=False)
        lines = [*_endings(flight), *filter(None, (_line(flight, *limit) for limit in limits.items()))]
        if lines:
            raise AssertionError("\n".join(["; ".join(lines), *_pointers(request.node)]))

    return _within


def _endings(flight: "Flight") -> Iterator[str]:
    if flight.outcome != "completed":
        yield f"outcome: {flight.outcome}" + (f" ({flight.message})" if flight.message else "")


def _line(flight: "Flight", name: str, limit: Any) -> str:
    """What is wrong with one metric; empty where it is within its limit."""
    if name not in flight.metrics:
        from sim.params import near_misses

        pytest.fail(f"within: unknown metric {name!r}: {near_misses(name, flight.metrics)}", pytrace=False)
    low, high = limit if isinstance(limit, tuple) else (None, limit)
    value = flight.metrics[name]
    if value is None:
        return f"{name}: not measured, limit {_limit(low, high)}"
    fits = (low is None or value >= low) and (high is None or value <= high)
    return "" if fits else f"{name}: measured {value:.2f}, limit {_limit(low, high)}"


def _limit(low: float | None, high: float | None) -> str:
    if low is None or high is None:
        return f"{high:.2f}" if low is None else f"at least {low:.2f}"
    return f"{low:.2f} to {high:.2f}"


def _pointers(item: pytest.Item) -> list[str]:
    """Lines that say how to fly it again, and where its recording is."""
    kept = item.stash.get(_flown, None)
    if kept is None:
        return []
    try:
        recording = kept.keep()
    except (OSError, ValueError) as problem:  # a full disk does not hide why the test failed
        recording = str(problem)
    return [f"fly it again: {kept.again}", f"recording: {recording}"]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[None]:
    """Keep the recording of a flight whose test fails, and say in the message what the verdict was."""
    kept = item.stash.get(_flown, None)
    failed = call.when == "call" and call.excinfo is not None and not call.excinfo.errisinstance(pytest.skip.Exception)
    pointers = _pointers(item) if kept is not None and failed else []
    report: Any = yield
    if kept is not None and pointers and report.failed:
        verdict = [_check_line(row) for row in kept.flight.verdict.rows if not row.passed]
        crash: Any = getattr(report.longrepr, "reprcrash", None)
        message = "" if crash is None else str(crash.message).removeprefix("AssertionError: ")
        if pointers[0] in message:  # of `within`
            crash.message, pointers = message, []
        elif crash is not None and verdict and call.excinfo is not None and call.excinfo.errisinstance(AssertionError):
            crash.message = "\n".join(["; ".join([*_endings(kept.flight), *verdict]), message])
        report.sections.append(("flight", "\n".join([repr(kept.flight), *verdict, *pointers])))
    return report


def _check_line(row: Any) -> str:
    measured = f"measured {row.measured:.2f}" if math.isfinite(row.measured) else "not measured"
    return f"{row.name}: {measured}, limit {'at least ' if row.sense == '>=' else ''}{row.limit:.2f} {row.unit}".strip()


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Print a table of what was flown: a line for each scenario and estimator."""
    groups: dict[str, list[tuple[bool, dict[str, Any]]]] = {}
    for outcome in ("passed", "failed", "xfailed", "xpassed"):
        for report in terminalreporter.stats.get(outcome, ()):
            properties = dict(report.user_properties)
            if report.when == "call" and "flight" in properties:
                pair = str(properties["flight"]).rpartition(", seed ")[0]
                groups.setdefault(pair, []).append((outcome != "failed", properties))
    if not groups:
        return
    terminalreporter.write_sep("=", "flights")
    rows: list[tuple[str, ...]] = [("", "passed", "inclination RMS", "heading RMS")]
    rows += [
        (name, f"{sum(ok for ok, _ in each)} of {len(each)}", *(_rms(each, number) for number in _NUMBERS))
        for name, each in sorted(groups.items())
    ]
    widths = [max(len(row[i]) for row in rows) for i in range(4)]
    for row in rows:
        cells = [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
        terminalreporter.write_line("  ".join(cells).rstrip())


def _rms(flights: Sequence[tuple[bool, Mapping[str, Any]]], number: str) -> str:
    """Root of the mean square over flights, and the worst."""
    values = [float(properties[number]) for _, properties in flights if number in properties]
    if not values:
        return "none"
    pooled = math.sqrt(sum(value**2 for value in values) / len(values))
    return f"{pooled:.2f} deg" + (f" (worst {max(values):.2f})" if len(values) > 1 else "")


def _stem(scenario: Any) -> str:
    return str(getattr(scenario, "name", None) or Path(scenario).stem)


def _name(estimator: Any) -> str:
    """Name of an estimator without its place."""
    return str(getattr(estimator, "__qualname__", None) or estimator).rpartition(":")[2].rpartition(".")[2] or "own"


def _again(task: _Task, item: pytest.Item) -> str:
    """A command that flies it again: with wingslevel, or where something has no name there, with pytest."""
    words = ["wingslevel", "fly", task.scenario, "--seed", str(task.seed)]
    for name, value in task.options.items():
        words += _option(name, value)
    if all(isinstance(word, str) for word in words):
        return shlex.join(words)
    return shlex.join(["pytest", item.nodeid])


def _option(name: str, value: Any) -> list[Any]:
    """An argument of `wingslevel.fly` as words of the command line; None for an estimator that has no name there."""
    if value is None:
        return []
    if name == "estimator":
        return ["--estimator", value if isinstance(value, str) else _place(value)]
    if name in ("params", "settings"):
        prefix = "estimator_params." if name == "params" else ""
        return [word for key, one in value.items() for word in ("--set", f"{prefix}{key}={one}")]
    if name == "timeout":
        return ["--flight-timeout", f"{value}"]
    flag = f"--{ {'faults': 'fault'}.get(name, name).replace('_', '-') }".replace(" ", "")
    if name in ("gust", "faults"):
        return [word for one in ([value] if isinstance(value, str) else value) for word in (flag, str(one))]
    if isinstance(value, list | tuple):
        return [flag, ("@" if name == "wind" else ",").join(map(str, value))]
    return [flag, str(value)]


def _place(maker: Any) -> str | None:
    """``file.py:Class`` of a class that has a name there, else None."""
    try:
        file, name = inspect.getsourcefile(maker), maker.__qualname__
    except (TypeError, AttributeError):
        return None
    return f"{os.path.relpath(file)}:{name}" if file and name.isidentifier() else None
