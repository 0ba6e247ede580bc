"""Pages and measurements of the command, as functions: aircraft, sensors, bench, claims, agree."""

import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, overload

from wingslevel._conditions import Estimator, plain, seeds_of
from wingslevel._crew import crew, named, objects, quietly
from wingslevel._errors import Interrupted, WingslevelError
from wingslevel._html import mark, number, page, table, text
from wingslevel._names import listed
from wingslevel._progress import Progress, progress_of

AnyPath = str | os.PathLike[str]


class Report:
    """Numbers by name, nested as in the JSON of the command: ``report["cruise"]["airspeed_m_s"]``."""

    def __init__(
        self,
        title: str,
        data: Mapping[str, Any],
        passed: bool | None = None,
        draw: Callable[[Path], None] | None = None,
    ) -> None:
        self._title, self._data, self._passed, self._draw = title, dict(data), passed, draw

    @property
    def passed(self) -> bool:
        """Whether the limits were kept; True for a report that judges nothing."""
        return self._passed is not False

    def to_json(self) -> dict[str, Any]:
        """All of it, as ``--json`` of the command writes it."""
        return json.loads(json.dumps(self._data))  # type: ignore[no-any-return]

    def picture(self, path: AnyPath) -> Path:
        """Draw it into a file, as PNG, SVG or PDF by the ending of its name.

        Raises
        ------
        WingslevelError     a report that has no picture, another ending, a file that cannot be written
        """
        if self._draw is None:
            raise WingslevelError(f"{self._title}: it has no picture")
        file = Path(path)
        if file.suffix.lower() not in (".png", ".svg", ".pdf"):
            raise WingslevelError(f"{file}: a picture ends with .png, .svg or .pdf")
        with quietly() as lost:
            self._draw(file)
        if lost:
            raise WingslevelError(lost[0])
        return file

    def __getitem__(self, name: str) -> Any:
        return self._data[name]

    def keys(self) -> Sequence[str]:
        """Names of its parts."""
        return list(self._data)

    def __repr__(self) -> str:
        word = "" if self._passed is None else ": passed" if self._passed else ": FAILED"
        return f"<Report {self._title}{word}>"

    def _repr_html_(self) -> str:
        title = f"<b>{text(self._title)}</b>"
        title += "" if self._passed is None else f" &middot; {mark(self._passed)}"
        return page(title, "", table(("", ""), list(_rows(self._data))))


def _rows(data: Mapping[str, Any], start: str = "") -> Any:
    """Names and values, as cells."""
    for name, value in data.items():
        if isinstance(value, Mapping):
            yield from _rows(value, f"{start}{name}.")
        elif isinstance(value, list):
            yield text(start + name), f"{len(value)} entries" if len(value) > 4 else text(value)
        else:
            number_like = isinstance(value, int | float) and not isinstance(value, bool)
            yield text(start + name), number(value) if number_like else text("–" if value is None else value)  # noqa: RUF001


@overload
def aircraft() -> dict[str, str]: ...
@overload
def aircraft(name: str, overrides: Mapping[str, Any] = ...) -> Report: ...
def aircraft(name: str | None = None, overrides: Mapping[str, Any] = MappingProxyType({})) -> dict[str, str] | Report:
    """Names of the aircraft with a line about each; or the performance page of one.

    overrides : differences from the drawing: ``{"airframe.mass_factor": 1.1}``

    Raises
    ------
    WingslevelError     no aircraft of that name, no such difference, or an aeroplane that cannot fly with it
    """
    if name is None:
        return listed("aircraft")
    from scenarios.harness.commands.aircraft import make

    with quietly():
        book = make(name, overrides)

    def draw(path: Path) -> None:
        from scenarios.harness.commands import aircraft_picture

        aircraft_picture.draw(book, path)

    return Report(f"aircraft {book.name}", book.to_json(), draw=draw)


@overload
def sensors() -> dict[str, str]: ...
@overload
def sensors(name: AnyPath, *, progress: Progress = False) -> Report: ...
def sensors(name: AnyPath | None = None, *, progress: Progress = False) -> dict[str, str] | Report:
    """Names of the sensor suites with a line about each; or the page of a suite or a part: data sheet, errors measured.

    name : of a suite or a part, or a ``.toml`` file of your own

    Raises
    ------
    WingslevelError     nothing of that name
    """
    if name is None:
        return listed("suites")
    from scenarios.harness.commands import sensor_names
    from scenarios.harness.commands import sensors as command
    from sim.sensors import trial

    with quietly(), progress_of(progress, "lying still", "axis-hours") as advance:
        about = sensor_names.subject(os.fspath(name))
        trial.check_rates(about.devices, os.fspath(name))
        made = command.make(about, lambda done, total: advance(done, total))

    def draw(path: Path) -> None:
        from scenarios.harness.commands import sensors_picture

        sensors_picture.draw(made, path)

    return Report(f"sensors {about.name}", made.to_json(), draw=draw)


def bench(
    estimator: Estimator = "premerlani", *, seconds: float = 30.0, repeats: int = 20, progress: Progress = False
) -> Report:
    """Measure the speed of the closed loop against bare JSBSim, and of the estimator alone.

    seconds : simulated time of each repeat, 2 to 3600      repeats : pairs of closed loop and bare JSBSim, 3 to 1000

    Raises
    ------
    WingslevelError     an estimator that cannot be found, or that fails
    """
    from scenarios.harness import lent
    from scenarios.harness.commands import bench as command
    from scenarios.harness.timing import NotTimed

    if not (2.0 <= seconds <= 3600.0 and 3 <= repeats <= 1000):
        raise WingslevelError(f"seconds = {seconds!r}, repeats = {repeats!r}: must be 2 to 3600 s, and 3 to 1000")
    found = named([estimator])
    (name,) = found
    with quietly(), lent.lend(objects(found)), progress_of(progress, "measuring", "pairs") as advance:
        try:
            speed = command.measure(name, float(seconds), int(repeats), advance)
        except NotTimed as problem:
            raise WingslevelError(str(problem)) from problem
    return Report(f"bench {name}", speed.to_json(), speed.passed)


def claims(
    names: str | Sequence[str] = (),
    *,
    seeds: Any = None,
    workers: int | None = None,
    timeout: float | None = 600.0,
    progress: Progress = False,
) -> Report:
    """Test what the papers claim: those of `names` (patterns as ``"offset*"``), or all, which takes minutes.

    seeds : as for `check`; None is those of each claim     workers, timeout, progress : as for `check`

    Raises
    ------
    WingslevelError     no claim of that name
    Interrupted         Ctrl-C; its `result` is that of the claims that were tested
    """
    from scenarios.harness.claims.run import matching, measure

    with quietly(), progress_of(progress, "measuring", "claims") as advance:
        wanted = matching([names] if isinstance(names, str) else list(names))
        numbers = None if seeds is None else seeds_of(seeds)
        limit_s = None if timeout is None else float(plain(timeout))
        found = measure(wanted, numbers, crew(workers, {}), advance, limit_s=limit_s)
    report = Report(f"claims: {len(wanted)}", found.to_json(), found.exit_code == 0)
    if not found.whole:
        raise Interrupted(report)
    return report


def agree(
    first: AnyPath, second: AnyPath, *, tolerance: float = 0.05, report_only: str | Sequence[str] = "faults,motor_dead*"
) -> Report:
    """Compare what ``check --json`` wrote on two machines: same flights, same outcomes, values within a tolerance.

    tolerance : relative, 0 to 10
    report_only : scenarios, or patterns, whose values are not judged; ``()`` is none

    Raises
    ------
    WingslevelError     a file that cannot be read, or that holds no verdict
    """
    from scenarios.harness.commands import agree as command

    if not 0.0 <= tolerance <= 10.0:
        raise WingslevelError(f"tolerance = {tolerance!r}: must be 0 to 10")
    reported = report_only.split(",") if isinstance(report_only, str) else list(report_only)
    with quietly():
        found = command.compare(command.read(Path(first)), command.read(Path(second)), float(tolerance), reported)
    return Report("agreement of two verdicts", found.to_json(), found.exit_code == 0)
