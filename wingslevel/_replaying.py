"""`replay`: estimators over a recorded log."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, SupportsIndex

from wingslevel._conditions import Estimator, Number, listed, number_of, params_of, path_of, plain
from wingslevel._crew import named, objects, quietly
from wingslevel._errors import WingslevelError
from wingslevel._flight import Flight
from wingslevel._html import number, page, table, text
from wingslevel._tables import require_pandas

if TYPE_CHECKING:
    import pandas as pd

    from scenarios.harness.commands.replay import Replays

_SCORES = ("inclination_rms_deg", "inclination_p95_deg", "inclination_max_deg", "heading_rms_deg", "rotation_rms_deg")


class Replay:
    """A log, and what each estimator made of it: ``result["premerlani"]`` is a `Flight`."""

    def __init__(self, done: "Replays", notes: Sequence[str] = ()) -> None:
        self._done, self._notes = done, notes
        self._flights = {name: Flight(flight) for name, flight in done.flights.items()}

    @property
    def passed(self) -> bool:
        """Whether no estimator failed, and something was judged where the log holds an attitude."""
        return self._done.exit_code == 0

    @property
    def estimators(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(replayed.estimator for replayed in self._done.replays)

    @property
    def scores(self) -> Mapping[str, Mapping[str, Any]]:
        """Differences from the attitude of the log by the name of the estimator; None for what was not judged."""
        return {replayed.estimator: replayed.to_json() for replayed in self._done.replays}

    @property
    def flights(self) -> tuple[Flight, ...]:
        """Each replay as a flight, with the attitude of the log where the truth would be."""
        return tuple(self._flights.values())

    @property
    def sensors(self) -> tuple[str, ...]:
        """The sensors in the log."""
        return self._done.log.sensors

    @property
    def repairs(self) -> tuple[str, ...]:
        """What was repaired in the log, a line each."""
        return self._done.log.repairs

    @property
    def notes(self) -> tuple[str, ...]:
        """What else is worth saying."""
        return (*self._done.log.notes, *self._done.notes, *self._notes)

    @property
    def not_judged(self) -> str:
        """Why nothing was judged; empty if something was."""
        return self._done.not_judged

    def to_json(self) -> dict[str, Any]:
        """As ``replay --json`` writes it."""
        return self._done.to_json()

    def to_pandas(self) -> "pd.DataFrame":
        """A row for each estimator, with its scores as columns; requires pandas."""
        require_pandas()
        import pandas as pd

        lines = [
            {"estimator": name, **{key: value for key, value in score.items() if key not in ("known", "refused")}}
            for name, score in self.scores.items()
        ]
        return pd.DataFrame(lines)

    def __getitem__(self, estimator: str) -> Flight:
        return self._flights[estimator]

    def __len__(self) -> int:
        return len(self._done.replays)

    def __repr__(self) -> str:
        nothing = f"; nothing judged: {self.not_judged}" if self.not_judged else ""
        return f"<Replay of {self._done.log.name}: {', '.join(self.estimators)}{nothing}>"

    def _repr_html_(self) -> str:
        log = self._done.log
        headings = ("estimator", "inclination<br>RMS, deg", "p95", "max", "heading<br>RMS, deg", "rotation<br>RMS, deg",
                    "")  # fmt: skip
        rows = [
            (text(r.estimator), *(number(r.scores[name]) for name in _SCORES), text(r.failure))
            for r in self._done.replays
        ]
        against = f"against {log.reference.name}, {self._done.judged_s:.1f} s judged" if log.reference else ""
        below = "<br>".join(text(line) for line in (against, self._done.not_judged, *log.repairs) if line)
        return page(f"<b>{text(log.name)}</b>", below, table(headings, rows, right=(1, 2, 3, 4, 5)))


def replay(
    log: str | os.PathLike[str],
    estimators: Estimator | Sequence[Estimator] = "premerlani",
    *,
    params: Mapping[str, Any] | None = None,
    reference: str | os.PathLike[str] | None = None,
    columns: str | os.PathLike[str] | None = None,
    imu: SupportsIndex | None = None,
    withhold: str | Sequence[str] = (),
    calibration: Number | None = None,
    airborne: Number = 5.0,
    settle: Number = 10.0,
    folder: str | os.PathLike[str] | None = None,
    rerun: bool = False,
) -> Replay:
    """Run estimators over a recorded log and score them against the attitude that it holds.

    Parameters
    ----------
    log             a recording of ours, .csv, .mat, .bin (ArduPilot), .ulg (PX4), or reference vectors
    estimators      one or several, each as for `fly`
    params          parameters of all that have them, or, as ``"premerlani.gps_latency_s"``, of one
    reference       file of attitudes to score against, where the log holds none
    columns         column map of a text log: a .toml file, or ``"umn_ultrastick"``
    imu             inertial unit of a .bin or .ulg that has several, from 0
    withhold        properties of the instruments that no estimator is given; ``"all"`` for all of them
    calibration     seconds at the start, averaged for the power-up if at rest; 0 is none, None is 2
    airborne        ground speed in m/s above which it flies, and is judged
    settle          seconds ignored after it first flew
    folder          where each replay is recorded, in a folder of its own; None records nothing
    rerun           write recordings for the Rerun viewer there, too

    Raises
    ------
    WingslevelError     one line: log, reference, map, estimator, parameter or folder
    """
    from scenarios.harness import lent
    from scenarios.harness.commands.replay import replay_log
    from scenarios.harness.replay import Window

    if isinstance(estimators, list | tuple) and not estimators:
        raise WingslevelError("estimators holds none: name at least one")
    path, properties = Path(path_of("log", log)), listed("withhold", withhold)
    found = named(estimators if isinstance(estimators, list | tuple) else [estimators])  # type: ignore[list-item]
    with quietly() as notes, lent.lend(objects(found)):
        calibration_s = None if calibration is None else number_of("calibration", calibration)
        window = Window(number_of("airborne", airborne), number_of("settle", settle), calibration_s)
        done = replay_log(
            path,
            list(found),
            None if folder is None else Path(path_of("folder", folder)),
            reference=None if reference is None else Path(path_of("reference", reference)),
            columns=None if columns is None else path_of("columns", columns),
            imu=plain(imu),
            params=params_of(params),
            withheld=properties.split(",") if isinstance(properties, str) else properties,
            window=window,
            rerun=rerun,
        )
    return Replay(done, notes)
