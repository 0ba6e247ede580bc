"""The books of a log: whatever is in a file, read is used and left out, and used is what the estimators are given."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from estimator.interface import MEASURED_DTYPE
from scenarios.harness import logs
from scenarios.harness.logs import checks
from scenarios.harness.logs.checks import Source
from scenarios.harness.logs.column_map import ColumnMap
from scenarios.harness.logs.quantities import FIELD, INERTIAL, QUANTITIES, Meaning
from scenarios.harness.logs.recorded import LogError, RecordedLog, Reference
from scenarios.harness.logs.tabular import recorded

N = 60
STREAMS = {"gps": "gps_new", "magnetometer": "mag_new"}
MANY = settings(
    max_examples=settings.default.max_examples * 3 // 2, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def agree(log):
    """Every stream's sums, and what they say is used against the rows."""
    for stream, entry in log.ledger.items():
        assert entry.agrees, (stream, entry)
        assert min((entry.read, entry.used, *entry.left_out.values())) >= 0, (stream, entry)
    assert log.ledger["imu"].used == len(log.rows)
    for stream, new in STREAMS.items():
        assert log.rows[new].sum() == (log.ledger[stream].used if stream in log.ledger else 0), stream


@st.composite
def tables(draw):
    """A sane inertial unit at rest, in which cells are lost, zeroed, repeated and shifted, with any other columns."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    t_s = 0.02 * np.arange(1, N + 1)
    table = {"time": t_s, **{name: 0.01 * rng.standard_normal(N) for name in INERTIAL}}
    table["force.z"] = table["force.z"] - 9.81
    others = draw(st.sets(st.sampled_from(sorted(set(QUANTITIES) - {"time", "interval", *INERTIAL}))))
    for name in others:
        kind = draw(st.sampled_from(["flag", "held", "sparse", "every", "zero"]))
        values = np.round(rng.normal(1.0, 3.0, N), 1)
        if kind == "flag":
            values = (rng.random(N) < 0.3).astype(np.float64)
        elif kind == "held":
            values = values[np.arange(N) // 7 * 7]
        elif kind == "sparse":
            values = np.where(rng.random(N) < 0.3, values, np.nan)
        elif kind == "zero":
            values = np.zeros(N)
        table[name] = values
    lost = draw(st.sampled_from([0.0, 0.05, 0.2]))
    for name in table:
        table[name] = np.where(
            rng.random(N) < (0.2 * lost if name in ("time", *INERTIAL) else lost), np.nan, table[name]
        )
    if draw(st.booleans()):
        for name in INERTIAL:
            table[name][:3] = 0.0
    if draw(st.booleans()):
        table["time"][10] = table["time"][9]
    if draw(st.booleans()):
        table["time"][[20, 21]] = table["time"][[21, 20]]
    return table


@MANY
@given(table=tables())
def test_books_of_any_table_agree(table, tmp_path):
    """Whatever columns there are, and whatever is lost in them."""
    meanings = ColumnMap({name: Meaning(name) for name in table})
    try:
        log = recorded(table, meanings, Source(tmp_path / "log.csv"))
    except LogError:
        return  # what cannot be believed has no books
    agree(log)


@MANY
@given(table=tables(), split=st.booleans(), seed=st.integers(0, 1000))
def test_books_of_any_matrices_agree(table, split, seed, tmp_path):
    """GPS and magnetometer with clocks of their own, at other rates, before and after the inertial unit."""
    rng = np.random.default_rng(seed)
    other = {name: v for name, v in table.items() if name.startswith("gps.") or (split and name in FIELD)}
    if not other:
        return
    rest = {name: v for name, v in table.items() if name not in other}
    keep = np.sort(rng.choice(N, N // 2, replace=False))
    clock = np.sort(rng.uniform(-2.0, 3.0, len(keep)))
    columns = {f"imu.{n}": v for n, v in rest.items()} | {f"gps.{n}": v[keep] for n, v in other.items()}
    columns["gps.clock"] = clock
    meanings = {f"imu.{n}": Meaning(n) for n in rest} | {f"gps.{n}": Meaning(n) for n in other}
    meanings["gps.clock"] = Meaning("time")
    try:
        log = recorded(columns, ColumnMap(meanings), Source(tmp_path / "log.mat"), lambda name: name.partition(".")[0])
    except LogError:
        return
    agree(log)


@MANY
@given(seed=st.integers(0, 2**32 - 1))
def test_books_of_any_rows_agree(seed, tmp_path):
    """Rows as our recordings and reference vectors give them, with rows lost and arrivals broken."""
    rng = np.random.default_rng(seed)
    rows = np.zeros(N, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"] = 0.02 * np.arange(1, N + 1), 0.02
    rows["force_b_m_s2"] = [0.0, 0.0, -9.81] + 0.01 * rng.standard_normal((N, 3))
    rows["gyro_b_rad_s"] = 0.01 * rng.standard_normal((N, 3))
    for name in ("gps_new", "mag_new", "air_new"):
        rows[name] = rng.random(N) < 0.4
    rows["gyro_b_rad_s"][rng.random(N) < 0.1, 1] = np.nan
    rows["gps_v_e_m_s"][rng.random(N) < 0.1, 0] = np.nan
    rows["equivalent_airspeed_m_s"][rng.random(N) < 0.3] = np.nan
    rows["baro_height_m"][rng.random(N) < 0.3] = np.nan
    rows["t_s"][[30, 31]] = rows["t_s"][[31, 30]]
    reference = Reference(np.where(rng.random((N, 1, 1)) < 0.2, np.nan, np.eye(3)), "truth", "t")
    log = checks.mended(RecordedLog(rows, "log", ("gyro",), reference), tmp_path / "log.parquet")
    agree(log)
    assert log.ledger["reference"].used == log.reference.known.sum()


def test_books_of_a_text_log_say_why(held, tmp_path):
    """A lost cell, a repeated line, a line that was cut off, zeros before the start: a reason each."""
    lines = held.lines(held.columns())
    lines[41] = ",".join("" if j == 2 else cell for j, cell in enumerate(lines[41].split(",")))
    lines.insert(101, lines[100])
    zeros = [f"{-0.02 * k:g},0,0,0,0,0,0,1,-2,0,0,0" for k in (2, 1, 0)]
    (tmp_path / "log.csv").write_text("\n".join([lines[0], *zeros, *lines[1:-1], lines[-1][:12]]))
    log = logs.read(tmp_path / "log.csv")
    entry = log.ledger["imu"]
    assert (entry.read, entry.used) == (held.n + 4, held.n - 2)
    assert entry.left_out == {
        "without a number": 1, "repeated time": 1, "zeros before the first reading": 3,
        "a last line that was cut off": 1,
    }  # fmt: skip
    agree(log)


@pytest.mark.parametrize("fix", [2.0, 3.0])
def test_books_of_reference_vectors_count_fixes_of_two_dimensions(tmp_path, fix):
    """Half of the reports have the status `fix`."""
    from scenarios.harness.logs import reference

    n = 100
    table = {name: np.zeros(n) for name in reference.INPUT}
    table |= {"t": 0.02 * np.arange(1, n + 1), "dt": np.full(n, 0.02), "az": np.full(n, -9.81)}
    table["gps_new"][::10], table["gps_fix"][:] = 1, 3.0
    table["gps_fix"][50:] = fix
    text = [",".join(table), *(",".join(map(repr, map(float, row))) for row in zip(*table.values(), strict=True))]
    (tmp_path / "B_in.csv").write_text("\n".join(text) + "\n")
    log = logs.read(tmp_path / "B_in.csv")
    entry = log.ledger["gps"]
    assert entry.read == 10
    assert entry.left_out == ({"no fix of three dimensions": 5} if fix < 3.0 else {})
    assert log.rows["gps_valid"][60:].any() == (fix >= 3.0)
    agree(log)
