"""Reference attitudes in a separate file: a table, a MATLAB file, a recording or another log.

They are repaired like a log: units of time and angle, order, repeated times, rows without a number.  Their times must
be on the clock of the log; a different unit is found by comparing the two time spans.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimator.blocks.screening import LONGEST_GAP_S
from estimator.interface import Array
from scenarios.harness.logs import accounts, attitudes, checks
from scenarios.harness.logs.column_groups import Group
from scenarios.harness.logs.ledger import Ledger
from scenarios.harness.logs.recorded import Kind, LogError, NothingToScore, RecordedLog, Reference

_UNITS = ((1.0, "seconds"), (1e-3, "milliseconds"), (1e-6, "microseconds"), (1e-9, "nanoseconds"))


def of_table(
    path: Path, groups: list[Group], source: checks.Source, rows_s: Array, ledger: Ledger, repairs: list[str]
) -> Array:
    """The attitude in the columns of a file at the times `rows_s` of a log, shape (N, 3, 3), NaN where unknown.

    groups : columns by our names in our units

    Raises
    ------
    LogError      no time or attitude in it, or a clock that runs back; one line
    NothingToScore      no attitude at the times of the log
    """
    found = next((g for g in groups if attitudes.form_of(g.table) and g.has("time")), None)
    R_eb = attitudes.attitude(found.table) if found else None
    if found is None or R_eb is None:
        raise LogError(f"{path}: no time and attitude in it (roll pitch yaw, qw qx qy qz, or r00 to r22)")
    table = found.table
    read, why = attitudes.reasons(table, R_eb)
    t_s = table["time"]
    known = np.flatnonzero(np.isfinite(R_eb).all(axis=(1, 2)))
    if not len(known):
        line = f"{path}: no attitude in any of its {len(t_s)} rows"
        raise NothingToScore(line, int(read.sum()), accounts.NO_NUMBER)
    factor = _factor(t_s[known], rows_s, source, repairs)
    t_s = factor * t_s
    of_file = checks.Source(path, source.columns, lambda k: source.row(int(known[k])))
    mended: list[str] = []
    known = _in_order(t_s, known, source, mended)
    keep = known[checks.kept(t_s[known], {"attitude": np.ones(len(known))}, of_file, mended)]
    repairs += [f"{path.name}: {line}" for line in mended]
    first, last = float(t_s[keep[0]]), float(t_s[keep[-1]])
    if first > rows_s[-1] or last < rows_s[0]:
        raise _elsewhere(path, first, last, rows_s, int(read.sum()))
    elsewhere = np.ones(len(t_s), np.bool_)
    elsewhere[keep] = False
    outside = (t_s < rows_s[0] - LONGEST_GAP_S) | (t_s > rows_s[-1] + LONGEST_GAP_S)
    why += [
        (~np.isfinite(t_s), accounts.NO_TIME), (elsewhere, accounts.REPEATED), (outside, accounts.OUTSIDE),
    ]  # fmt: skip
    good = accounts.samples(ledger, "reference", read, why)
    ledger.use("reference", int(good.sum()))
    found_R_eb = attitudes.at_times(t_s[keep], R_eb[keep], rows_s)
    if not np.isfinite(found_R_eb).any():
        if len(keep) == 1:
            line = f"{path}: a single attitude, at {first:.10g} s, cannot be interpolated"
            raise NothingToScore(line, int(read.sum()), "alone")
        usual_s = float(np.median(np.diff(t_s[keep])))
        raise NothingToScore(
            f"{path}: its {len(keep)} attitudes are {usual_s:.3g} s apart; those at most {LONGEST_GAP_S:g} s apart are "
            "interpolated, and no row of the log lies between two of these",
            int(read.sum()),
            "too far apart",
        )
    return found_R_eb


def _elsewhere(path: Path, first_s: float, last_s: float, rows_s: Array, read: int) -> NothingToScore:
    """The reference is from another time or on another clock; the offset is not guessed."""
    return NothingToScore(
        f"{path}: its times, {first_s:.10g} to {last_s:.10g} s, do not overlap those of the log, {rows_s[0]:.10g} to "
        f"{rows_s[-1]:.10g} s: both must use one clock",
        read,
        accounts.OUTSIDE,
    )


def _in_order(t_s: Array, known: NDArray[np.intp], source: checks.Source, repairs: list[str]) -> NDArray[np.intp]:
    """`known` in order of time if no time occurs twice: two flights in one file would share some."""
    times = t_s[known]
    late = int(np.sum(np.diff(times) < 0.0))
    if not late or len(np.unique(times)) < len(times):
        return known
    repairs.append(f"{source.column('time')}: {late} out of order, sorted")
    return np.asarray(known[np.argsort(times, kind="stable")])


def _factor(t_s: Array, rows_s: Array, source: checks.Source, repairs: list[str]) -> float:
    """Factor to seconds: the first unit in which the spans overlap and the attitudes are close enough in time.

    A record that begins at zero overlaps in any unit; then the unit in which it can be interpolated counts.
    """
    t_s = t_s[np.isfinite(t_s)]
    if not len(t_s):
        raise source.refusal(None, "time", "no number in it")
    step_s, length_s = float(np.median(np.diff(np.sort(t_s)))) if len(t_s) > 1 else 0.0, float(rows_s[-1] - rows_s[0])
    found: list[tuple[float, str]] = []
    for factor, name in _UNITS:
        first, last = factor * float(t_s.min()), factor * float(t_s.max())
        if min(last, rows_s[-1]) <= max(first, rows_s[0]):
            continue
        # Times of another clock may overlap in a wrong unit, but then they are far too dense and too short.
        if factor == 1.0 or (factor * step_s > 1.0 / checks.FASTEST_HZ and last - first > 0.1 * length_s):
            found.append((factor, name))
    near = [unit for unit in found if unit[0] * step_s <= LONGEST_GAP_S]
    factor, name = next(iter(near or found), _UNITS[0])
    if factor != 1.0:
        repairs.append(f"{source.path.name}: {source.column('time')} in {name}, not seconds: converted")
    return factor


def of_log(path: Path, other: RecordedLog, rows_s: Array, ledger: Ledger) -> tuple[Array, Kind]:
    """The attitude of another log or recording at the times `rows_s`; LogError if it has none at these times."""
    if other.reference is None:
        raise LogError(f"{path}: no attitude in it")
    t_s, known = other.rows["t_s"], other.reference.known
    if not known.any():
        raise LogError(f"{path}: no attitude in it")
    t_s, R_eb = t_s[known], other.reference.R_eb[known]
    if t_s[0] > rows_s[-1] or t_s[-1] < rows_s[0]:
        raise _elsewhere(path, float(t_s[0]), float(t_s[-1]), rows_s, len(t_s))
    outside = (t_s < rows_s[0] - LONGEST_GAP_S) | (t_s > rows_s[-1] + LONGEST_GAP_S)
    good = accounts.samples(ledger, "reference", np.ones(len(t_s), np.bool_), [(outside, accounts.OUTSIDE)])
    ledger.use("reference", int(good.sum()))
    if np.array_equal(t_s, rows_s):  # the same rows: nothing to interpolate
        return R_eb, other.reference.kind
    return attitudes.at_times(t_s, R_eb, rows_s), other.reference.kind


def reference(R_eb: Array, kind: Kind, path: Path) -> Reference:
    """The attitude of a separate file, named after it."""
    return Reference(R_eb, "truth" if "_truth." in path.name else kind, path.name)
