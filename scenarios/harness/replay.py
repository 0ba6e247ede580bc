"""Estimators over a recorded log: run, scored against the attitude in the log, recorded like a flight.

Each estimator gets all rows in order.  If the aeroplane was at rest in the first seconds, it powers up with the mean
inertial sample of these; otherwise, and always when compared with the output of firmware, it powers up as in the air.

Judged are rows with a reference while airborne (GPS ground speed above a limit, see `flying`; all rows of a log without
GPS, or with a limit of 0), after a settling time.  Against firmware every row counts: two runs of one algorithm agree
from the first sample.
"""

import copy
import math
import operator
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.blocks.screening import AT_REST_G, AT_REST_RAD_S
from estimator.instruments import PROPERTIES, Instruments, Known, to_json
from estimator.interface import G_M_S2, Array, AttitudeEstimator, ImuSample, Measurements
from estimator.rotation import heading_error_rad, inclination_error_rad, rotation_error_rad
from scenarios.harness.cli import console
from scenarios.harness.config import literal
from scenarios.harness.equipping import Equipped, equipped, heading_reference_of, learnt
from scenarios.harness.logs.recorded import RecordedLog
from scenarios.harness.logs.validity import INTERVALS, LONGEST_S, latest
from scenarios.harness.metrics import STEEPEST_R_ZX, highest, p95, rms
from scenarios.harness.plugins import Maker, PluginError, short_name
from sim.events import events_of
from sim.flight_code import FlightCodeFailed, blaming, estimate_of, record_estimates
from sim.log import Event, Flight, Log, Outcome, Phase
from sim.loop import power_up
from sim.oracle import Oracle
from sim.outside.blame import Refused, shown
from sim.outside.wording import printable

CALIBRATION_S = 2.0
STILL_M_S, STILL_M_S2 = 2.0, 0.7  # at rest: ground speed, and standard deviation of the specific force, at most
BLOCK = 5000  # rows between updates of the progress bar
_UNKNOWN = (  # columns of the truth that no log holds
    "omega_b_rad_s", "imu_omega_b_rad_s", "imu_force_b_m_s2", "wind_e_m_s", "gyro_bias_b_rad_s", "force_bias_b_m_s2",
    "alpha_rad", "beta_rad",
)  # fmt: skip
SCORES = (
    "inclination_rms_deg", "inclination_p95_deg", "inclination_max_deg", "heading_rms_deg",
    "rotation_rms_deg", "rotation_max_deg",
)  # fmt: skip
_NO_SCORES = dict.fromkeys(SCORES, math.nan)
MOST_REFUSED = 100  # kinds of rejected samples that an estimator may report
SHARE_S, REPEATS = 0.3, 7  # the least time of several runs counts, within this total


@dataclass(frozen=True, slots=True)
class Window:
    """Which rows are judged, and how an estimator powers up.

    airborne_m_s : ground speed above which the aeroplane is airborne      settle_s : ignored after it first is
    calibration_s : averaged at the start for the power-up, if at rest; None means 2 s, or 0 against firmware
    """

    airborne_m_s: float = 5.0
    settle_s: float = 10.0
    calibration_s: float | None = None

    def __post_init__(self) -> None:
        for name, unit in (("airborne_m_s", "m/s"), ("settle_s", "s"), ("calibration_s", "s")):
            value = getattr(self, name)
            if value is not None and not 0.0 <= value < math.inf:
                raise ValueError(f"{name} = {value:g} {unit}: must be zero or more")


@dataclass(frozen=True, slots=True)
class Replayed:
    """One estimator over a log.

    log : reference, measurements and estimates      first : the first row that it was given
    ns_per_update : NaN if it failed                 failure : one line, empty if it did not fail
    rejected : ticks in which it rejected a sample, None if it does not say
    known : what it knew about the instruments, or learnt      refused : rejected samples, by instrument
    """

    estimator: str
    heading_reference: str
    log: Log
    first: int
    ns_per_update: float
    rejected: int | None
    scores: Mapping[str, float]
    failure: str = ""
    known: Mapping[str, Known] = field(default_factory=dict)
    refused: Mapping[str, int] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """The numbers, named with their units; None for those that could not be measured."""
        numbers = {**self.scores, "ns_per_update": self.ns_per_update}
        return {
            **{name: value if math.isfinite(value) else None for name, value in numbers.items()},
            "rejected": self.rejected,
            "refused": dict(self.refused),
            "heading_reference": self.heading_reference,
            "known": to_json(self.known),
            **({"failure": self.failure} if self.failure else {}),
        }


def make(spec: str | Maker, params: Mapping[str, Any], instruments: Instruments | None = None) -> Equipped:
    """The estimator `spec`, with what is known about the instruments and with the parameters `params`.

    Raises
    ------
    ValueError      one line: no such estimator or parameter; the oracle, since no log holds the truth it needs
    """
    made = equipped(spec, instruments, {name: literal(value) for name, value in params.items()})
    if issubclass(type(made.code), Oracle):
        raise ValueError("the oracle reads the truth from a simulator: it cannot be replayed over a log")
    return made


def replay(
    log: RecordedLog,
    spec: str | Maker,
    params: Mapping[str, Any] | None = None,
    window: Window | None = None,
    withheld: Sequence[str] = (),
    advance: console.Advance = lambda _done, _total: None,
) -> Replayed:
    """Run the estimator `spec` over `log` and score it.

    params : by name; they take precedence over what the log says about its instruments (`RecordedLog.known`)
    withheld : properties of the instruments to hide from it, whatever the log says; if these are all, the calibration
        before the log is hidden too

    Raises
    ------
    ValueError      one line: no such estimator or parameter, or a calibration longer than the log
    """
    window = window or Window()
    estimator, known = make(spec, params or {}, known_to(log, withheld))
    reference = heading_reference_of(estimator)
    n = _calibration(log, window)
    on_ground = at_rest(log.rows[:n]) if n else None
    first = n if on_ground is not None else 0
    if n and on_ground is None and not _all_of(withheld):
        on_ground = log.on_ground
    flown = Log.empty(len(log.rows))
    _truth_of(log, flown.truth)
    flown.measured[:] = log.rows
    reports: dict[str, Any] = {"known": known, "rejected": None}
    failure, ns_per_update = "", math.nan
    try:
        ns_per_update = _run(estimator, on_ground, log.rows, first, flown.flown, advance)
    except FlightCodeFailed as failed:
        failure = str(failed)
    try:
        reports = _reports(estimator, known, float(log.rows["t_s"][-1]))
    except (FlightCodeFailed, PluginError) as failed:
        failure = failure or str(failed)
    judged = judged_rows(log, window, first)
    scores, spent = (_NO_SCORES, math.nan) if failure else (score(flown.flown["R_eb"], log, judged), ns_per_update)
    return Replayed(short_name(spec), reference, flown, first, spent, scores=scores, failure=failure, **reports)


def gone(spec: str | Maker, failure: str) -> Replayed:
    """The result for an estimator that ended the process: no rows, and the failure."""
    return Replayed(short_name(spec), "course", Log.empty(0), 0, math.nan, None, _NO_SCORES, failure)


def known_to(log: RecordedLog, withheld: Sequence[str] = ()) -> Instruments:
    """What an estimator is given about the instruments of `log`; if all is withheld, no calibration either."""
    unknown = _all_of(withheld)  # then also hide what was measured before the log
    of_log = {name: entry for name, entry in log.known.items() if not (unknown and name.startswith("calibration."))}
    return Instruments(of_log, withheld=withheld)


def _all_of(withheld: Sequence[str]) -> bool:
    return set(withheld) >= set(PROPERTIES)


def _reports(estimator: object, known: Mapping[str, Known], t_s: float) -> dict[str, Any]:
    """Fields of `Replayed` that `estimator` reports; FlightCodeFailed or PluginError if they are invalid."""
    now_known = learnt(estimator, known)
    with blaming(Outcome.ESTIMATOR_FAILED, estimator, t_s):
        rejected = getattr(estimator, "rejected", None)
        refused = getattr(estimator, "refused", {})
        if not isinstance(refused, Mapping) or len(refused) > MOST_REFUSED:
            raise Refused(f"refused is {shown(refused)}; it must be numbers of samples by instrument")
        counts = {printable(str(name)): _count(f"refused[{shown(name)}]", n) for name, n in refused.items()}
        n_rejected = None if rejected is None else _count("rejected", rejected)
        return {"known": now_known, "rejected": n_rejected, "refused": counts}


def _count(name: str, value: object) -> int:
    try:
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        number = -1
    if not 0 <= number < 2**63:
        raise Refused(f"{name} is {shown(value)}; it must be a number of samples")
    return int(number)


def at_rest(rows: NDArray[Any]) -> ImuSample | None:
    """Mean inertial sample of `rows` if the aeroplane was at rest or held still; otherwise None.

    The limits are those of the estimators for a mean sample at rest; the GPS must not contradict it.
    """
    gyro, force = rows["gyro_b_rad_s"].mean(axis=0), rows["force_b_m_s2"].mean(axis=0)
    still = float(np.abs(gyro).max()) < AT_REST_RAD_S
    still &= abs(float(np.linalg.norm(force)) / G_M_S2 - 1.0) < AT_REST_G
    still &= float(rows["force_b_m_s2"].std(axis=0).max()) < STILL_M_S2
    fixed = rows["gps_valid"] > 0
    still &= float(rows["gps_speed_m_s"][fixed].max(initial=0.0)) < STILL_M_S
    return ImuSample(float(rows["t_s"][-1]), float(rows["dt_s"].sum()), gyro, force) if still else None


def judged_rows(log: RecordedLog, window: Window, first: int = 0) -> NDArray[np.bool_]:
    """Rows that are judged, shape (N,); see the module."""
    return _judged(log, window, first)[0]


def why_none(log: RecordedLog, window: Window, first: int = 0) -> str:
    """Why no row is judged, in one line; empty if some are."""
    judged, why = _judged(log, window, first)
    return "" if judged.any() else why


def _judged(log: RecordedLog, window: Window, first: int) -> tuple[NDArray[np.bool_], str]:
    """Rows that are judged, shape (N,), and the reason if there are none."""
    rows, reference = log.rows, log.reference
    if reference is None:
        return np.zeros(len(rows), np.bool_), "the log holds no attitude to score against: --reference FILE"
    judged = reference.known
    if not judged.any():
        return judged, _why_unknown(log, reference.name)
    if reference.kind == "firmware":
        return judged, ""
    if "gps" in log.sensors and window.airborne_m_s > 0.0:
        judged &= flying(rows, window.airborne_m_s)
        if not judged.any():
            slow = f"ground speed never above {window.airborne_m_s:g} m/s while there is a reference"
            fastest = float(rows["gps_speed_m_s"][rows["gps_new"] > 0].max(initial=0.0))
            return judged, f"{slow} (fastest fix: {fastest:.1f} m/s); --airborne 0 judges all rows"
    judged &= np.arange(len(rows)) >= first
    if judged.any():
        judged &= rows["t_s"] > rows["t_s"][np.argmax(judged)] + window.settle_s
    return judged, f"nothing is left after {window.settle_s:g} s to settle; choose a shorter --settle"


def _why_unknown(log: RecordedLog, name: str) -> str:
    """Why a reference has no attitude in any row."""
    if log.reference is not None and log.reference.why_none:
        return log.reference.why_none
    entry = log.ledger.get("reference")
    if entry is None or entry.used or not entry.left_out:
        return f"{name} has no attitude at the times of the log; do both use one clock?"
    reasons = ", ".join(f"{n} {reason}" for reason, n in entry.left_out.items())
    return f"{name}: no attitude can be used: {reasons}"


def flying(rows: NDArray[Any], airborne_m_s: float) -> NDArray[np.bool_]:
    """Rows in which the aeroplane is airborne, by the ground speed of the fixes around them, shape (N,).

    A fix counts until the next one, while it is fresh.  In a longer gap of the GPS the aeroplane is taken to fly if it
    flew both before and after.
    """
    fixes = np.flatnonzero(rows["gps_new"])
    if not len(fixes):
        return np.zeros(len(rows), np.bool_)
    t_s, fast = rows["t_s"], rows["gps_speed_m_s"][fixes] > airborne_m_s
    interval_s = float(np.median(np.diff(t_s[fixes]))) if len(fixes) > 1 else 0.0
    fresh_s = max(LONGEST_S, INTERVALS * interval_s)
    last = np.searchsorted(fixes, np.arange(len(rows)), side="right") - 1
    before, after = np.maximum(last, 0), np.minimum(last + 1, len(fixes) - 1)
    fresh = t_s - t_s[fixes[before]] <= fresh_s
    resumes = (last + 1 < len(fixes)) & fast[after]
    return np.asarray((last >= 0) & fast[before] & (fresh | resumes))


def score(R_eb: Array, log: RecordedLog, judged: NDArray[np.bool_]) -> dict[str, float]:
    """Differences from the reference over the rows `judged`, degrees; NaN where there are none.

    The heading is compared with the reference's nose, where its nose is not near the vertical.
    """
    if log.reference is None:
        return _NO_SCORES
    ours, theirs = R_eb[judged], log.reference.R_eb[judged]
    inclination = np.degrees(inclination_error_rad(ours, theirs))
    rotation = np.degrees(rotation_error_rad(ours, theirs))
    heading = np.degrees(heading_error_rad(ours, theirs))[np.abs(theirs[:, 2, 0]) < STEEPEST_R_ZX]
    values = rms(inclination), p95(inclination), highest(inclination), rms(heading), rms(rotation), highest(rotation)
    return dict(zip(SCORES, values, strict=True))


def as_flight(log: RecordedLog, replayed: Replayed, window: Window) -> Flight:
    """The replay as a flight for the recorder and the viewer, with the reference in place of the truth."""
    t_s = log.rows["t_s"]
    start_s = float(t_s[0] - log.rows["dt_s"][0])
    outcome = Outcome.ESTIMATOR_FAILED if replayed.failure else Outcome.COMPLETED
    reference = log.reference.name if log.reference else "none: the log has no attitude"
    events = events_of(replayed.log, outcome, replayed.failure)
    events += tuple(Event(start_s, line, "warn") for line in log.repairs)
    manifest: dict[str, Any] = {
        "scenario": f"replay of {log.name}",
        "estimator": replayed.estimator,
        "reference": reference,
        "sensors_in_log": log.sensors,
        "repairs": log.repairs,
        "ledger": log.ledger.to_json(),
        "known": to_json(Instruments(log.known)),
        "scores": replayed.to_json(),
        "settle_s": window.settle_s,
        "airborne_m_s": window.airborne_m_s,
    }
    if log.place is not None:
        manifest["launch_latitude_deg"], manifest["launch_longitude_deg"] = log.place
    return Flight(
        replayed.log,
        float(np.median(log.rows["dt_s"])),
        start_s,
        outcome,
        "nose",  # a reference has a nose; its course would be that of the same GPS
        replayed.failure,
        tuple(sorted(events, key=lambda event: event.t_s)),
        manifest,
    )


def _calibration(log: RecordedLog, window: Window) -> int:
    """How many rows the calibration takes."""
    seconds = window.calibration_s
    if seconds is None:
        firmware = log.reference is not None and log.reference.kind == "firmware"
        seconds = 0.0 if firmware else CALIBRATION_S
    rows = log.rows
    n = int(np.searchsorted(rows["t_s"], rows["t_s"][0] - rows["dt_s"][0] + seconds + 1e-6, side="right"))
    if seconds > 0.0 and n >= len(rows):
        if window.calibration_s is None:
            return 0
        raise ValueError(f"calibration_s = {seconds:g} s: the log is {rows['t_s'][-1] - rows['t_s'][0]:.1f} s long")
    return n if seconds > 0.0 else 0


def _run(
    estimator: AttitudeEstimator,
    on_ground: ImuSample | None,
    rows: NDArray[Any],
    first: int,
    flown: NDArray[Any],
    advance: console.Advance,
) -> float:
    """Fill `flown` from row `first` on; returns nanoseconds per update.

    The estimator gets copies, so that nothing it writes into them is judged or seen by another one.  A rejected
    estimate leaves its row empty.
    """
    total, began_s = len(rows), float(rows["t_s"][first])
    writeable, rows = rows.flags.writeable, rows.copy()
    rows.flags.writeable = writeable  # kernels are compiled for it
    with blaming(Outcome.ESTIMATOR_FAILED, estimator, began_s):
        replay = getattr(estimator, "replay", None)
    power_up(estimator, copy.deepcopy(on_ground))
    if replay is None:
        began = time.perf_counter()
        for k in range(first, total):
            try:
                estimate_of(estimator, Measurements(rows, k), flown, k)
            except FlightCodeFailed:
                flown[k] = Log.empty(1).flown[0]
                raise
            if k % BLOCK == 0:
                advance(k, total)
        return 1e9 * (time.perf_counter() - began) / (total - first)
    with blaming(Outcome.ESTIMATOR_FAILED, estimator, began_s):
        replay(rows[first : first + 1])  # compiles, if necessary
    spent, least = 0.0, math.inf
    for i in range(REPEATS):
        power_up(estimator, copy.deepcopy(on_ground))
        with blaming(Outcome.ESTIMATOR_FAILED, estimator, began_s):
            began = time.perf_counter()
            estimates = replay(rows[first:])
            took = time.perf_counter() - began
        spent, least = spent + took, min(least, took)
        advance(i + 1, REPEATS)
        if spent > SHARE_S:
            break
    with blaming(Outcome.ESTIMATOR_FAILED, estimator, began_s):
        good, fault = record_estimates(flown[first:], estimates)
    if fault:
        flown[first + good] = Log.empty(1).flown[0]
        raise FlightCodeFailed(Outcome.ESTIMATOR_FAILED, estimator, float(rows["t_s"][first + good]), fault)
    return 1e9 * least / (total - first)


def _truth_of(log: RecordedLog, truth: NDArray[Any]) -> None:
    """Fill the table of the truth from the log: the reference attitude, and the track by GPS."""
    rows = log.rows
    truth["t_s"] = rows["t_s"]
    truth["phase"] = Phase.FLYING
    for name in _UNKNOWN:
        truth[name] = np.nan
    truth["airspeed_m_s"] = np.where(rows["air_new"] > 0, rows["equivalent_airspeed_m_s"], np.nan)
    truth["R_eb"] = np.eye(3)
    if log.reference is not None:
        known = log.reference.known
        if known.any():  # the last known attitude; before the first, the first
            last = latest(known)
            truth["R_eb"] = log.reference.R_eb[np.where(last < 0, np.argmax(known), last)]
    fixes = np.flatnonzero(rows["gps_new"])
    for table, measured in (("p_e_m", "gps_p_e_m"), ("v_e_m_s", "gps_v_e_m_s")):
        for i in range(3 if len(fixes) else 0):
            truth[table][:, i] = np.interp(rows["t_s"], rows["t_s"][fixes], rows[measured][fixes, i])
