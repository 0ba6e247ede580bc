"""A flight, as the public functions return it: its numbers, its verdict, its data, its picture."""

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sim.log import Event, Outcome
from sim.log import Flight as Recorded
from wingslevel._errors import WingslevelError, one_line

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa  # type: ignore[import-untyped]
    from matplotlib.figure import Figure

    from scenarios.harness.checks import Row
    from scenarios.harness.verdict import FlightVerdict

Array = NDArray[np.float64]


class Flight:
    """One flight: flown by `fly`, read by `load`, or a recorded log with its estimate, by `replay`.

    Every array has one row per tick of the inertial sensors, N in all.  Times `t_s` and those of `events` count from
    power-up, as in the recording; `release_s` is when the flight proper begins.
    """

    def __init__(self, recorded: Recorded, judged: "FlightVerdict | None" = None) -> None:
        self._recorded = recorded
        self._judged = judged

    # What was flown

    @property
    def scenario(self) -> str:
        """Name of the scenario; of a replay, "replay of" and the name of the log."""
        return str(self.manifest.get("scenario", ""))

    @property
    def estimator(self) -> str:
        """Name of the estimator; of a class, ``module:Class``."""
        return str(self.manifest.get("estimator") or self.config.get("estimator", ""))

    @property
    def seed(self) -> int | None:
        """The seed; None of a replay."""
        seed = self.config.get("seed")
        return None if seed is None else int(seed)

    @property
    def config(self) -> Mapping[str, Any]:
        """The configuration with all that was drawn by chance as plain numbers; empty of a replay."""
        return dict(self.manifest.get("config") or {})

    @property
    def manifest(self) -> Mapping[str, Any]:
        """What the recording says beside the data: configuration, versions, what was known of the instruments."""
        return self._recorded.manifest

    # How it went

    @property
    def outcome(self) -> Outcome:
        """How it ended: "completed", "ground_contact", "left_box", "diverged", "estimator_failed" and so on."""
        return self._recorded.outcome

    @property
    def message(self) -> str:
        """One line on the end, empty where it was as planned."""
        return self._recorded.message

    @property
    def events(self) -> tuple[Event, ...]:
        """What happened, in order of time; each with `t_s`, `text` and `level` ("info", "warn", "error")."""
        return self._recorded.events

    @property
    def verdict(self) -> "FlightVerdict":
        """The checks of the scenario: ``verdict.rows`` with name, unit, measured, limit and passed.

        Raises
        ------
        WingslevelError     a replay, which is scored and not judged; a recording without a verdict
        """
        if self._judged is None:
            raise WingslevelError(f"{self.scenario or 'this recording'} holds no verdict: see metrics")
        return self._judged

    @property
    def judged(self) -> bool:
        """Whether there is a `verdict`."""
        return self._judged is not None

    @property
    def passed(self) -> bool:
        """Whether every check passed, and no code failed; of a replay, whether the estimator did not fail."""
        return self._judged.passed if self._judged is not None else self.outcome == Outcome.COMPLETED

    @cached_property
    def metrics(self) -> Mapping[str, float | None]:
        """Numbers by name, each name with its unit, as ``metrics`` in the JSON of the command; of a replay its scores.

        None for what could not be measured.
        """
        if self._judged is not None:
            return dict(self._judged.metrics)
        scores = self.manifest.get("scores")
        if scores is not None:
            return {name: value for name, value in scores.items() if value is None or isinstance(value, float)}
        from scenarios.harness.verdict import metrics_of

        return metrics_of(self._recorded)

    @property
    def known(self) -> Mapping[str, Any]:
        """What the estimator was given of the instruments, or learnt: each with `value` and `source`."""
        from estimator.instruments import Known

        entries = self.manifest.get("known_to_estimator") or self.manifest.get("known") or {}
        return {name: Known.from_json(entry) for name, entry in entries.items()}

    # Its data

    def __len__(self) -> int:
        return len(self._recorded.log)

    @property
    def t_s(self) -> Array:
        """Shape (N,), seconds since power-up, at the end of each tick."""
        return np.asarray(self.truth["t_s"])

    @property
    def dt_s(self) -> float:
        """Length of a tick."""
        return self._recorded.dt_s

    @property
    def release_s(self) -> float:
        """When it left the hand, or whatever came before; judged times count from here."""
        return self._recorded.release_s

    @property
    def truth(self) -> NDArray[Any]:
        """Structured array, shape (N,): attitude ``truth["R_eb"]``, position, wind, see docs/recording.md."""
        return self._recorded.log.truth

    @property
    def measured(self) -> NDArray[Any]:
        """Structured array, shape (N,): what the sensors reported."""
        return self._recorded.log.measured

    @property
    def flown(self) -> NDArray[Any]:
        """Structured array, shape (N,): what the estimator believed and the autopilot commanded."""
        return self._recorded.log.flown

    @property
    def heading_reference(self) -> str:
        """What the heading of the estimator converges to, and is judged against: "course" or "nose"."""
        return self._recorded.heading_reference

    @property
    def inclination_error_deg(self) -> Array:
        """Shape (N,): angle between the estimated and the true vertical; NaN where it is not judged."""
        return self._errors[0]

    @property
    def heading_error_deg(self) -> Array:
        """Shape (N,), 0..180: against the true `heading_reference`; NaN where it is not judged."""
        return self._errors[1]

    @cached_property
    def _errors(self) -> tuple[Array, Array]:
        from scenarios.harness.metrics import heading_error_deg, inclination_error_deg

        series = inclination_error_deg(self._recorded), heading_error_deg()(self._recorded)
        inclination, heading = (np.where(one.judged, one.value, np.nan) for one in series)
        return inclination, heading

    def to_arrow(self) -> "pa.Table":
        """The columns of the recording and what people plot: Euler angles in degrees, errors, names of modes.

        Each field says in its metadata what it means.  Docs: docs/api.md.
        """
        from wingslevel._tables import to_arrow

        return to_arrow(self)

    def to_pandas(self) -> "pd.DataFrame":
        """The same as `to_arrow`, as a DataFrame; requires pandas (``pip install "wingslevel[pandas]"``)."""
        from wingslevel._tables import to_pandas

        return to_pandas(self.to_arrow())

    # What to do with it

    def plot(self) -> "Figure":
        """A figure of Matplotlib: attitude, errors and events over time, the way over the ground, the verdict."""
        from wingslevel._plot import plot

        return plot(self)

    def save(self, folder: str | Path, *, rerun: bool = True) -> Path:
        """Record it in `folder`, made where it is missing: ``flight.parquet``, ``manifest.json``, ``flight.rrd``.

        rerun : False leaves out the recording for the Rerun viewer

        Raises
        ------
        WingslevelError     the folder cannot be written
        """
        from scenarios.harness.commands import view
        from sim import recording

        with one_line():
            made = recording.save(self._recorded, folder)
            if rerun:
                view.write_rerun(self._recorded, made)
        return made

    def view(self, *, web: bool = False) -> None:
        """Show it in the Rerun viewer: a window, or with `web` the browser.  Returns at once."""
        from wingslevel._pages import view_flight

        view_flight(self._recorded, web=web)

    def export(self, *, nmea: str | Path | None = None, ubx: str | Path | None = None, csv: str | Path | None = None,
               start: str | None = None) -> list[Path]:  # fmt: skip
        """Write its GPS fixes as NMEA sentences or UBX messages, all of it as a text log; see `export`."""
        from wingslevel._pages import export_flight

        return export_flight(self._recorded, nmea=nmea, ubx=ubx, csv=csv, start=start)

    def to_json(self) -> dict[str, Any]:
        """The verdict as the command writes it; of a replay, its scores."""
        if self._judged is None:
            return {"scenario": self.scenario, "estimator": self.estimator, "metrics": dict(self.metrics)}
        from scenarios.harness.verdict import Verdict

        (flight,) = Verdict((self._judged,), ()).to_json()["flights"]
        return dict(flight)

    def __repr__(self) -> str:
        from wingslevel._html import flight_line

        return f"<{flight_line(self)}>"

    def _repr_html_(self) -> str:
        from wingslevel._html import flight_html

        return flight_html(self)


def rows_of(recorded: Recorded) -> "tuple[Row, ...] | None":
    """The lines of the verdict that a recording holds; None where it holds none."""
    from scenarios.harness.checks import Row

    entries = recorded.manifest.get("verdict")
    if not entries:
        return None
    return tuple(map(Row.from_json, entries))
