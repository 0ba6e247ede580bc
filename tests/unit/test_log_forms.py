"""Forms of text files: whatever stands between, above and around the numbers, the same rows come out."""

import gzip
from datetime import UTC, datetime, timedelta

import numpy as np
import pandas as pd
import pytest

from scenarios.harness import logs
from scenarios.harness.logs.recorded import LogError

NAMES = ["t", "gx", "gy", "gz", "ax", "ay", "az", "vn", "ve", "roll", "pitch", "yaw"]
UNITS = "s,rad/s,rad/s,rad/s,m/s^2,m/s^2,m/s^2,m/s,m/s,rad,rad,rad"


@pytest.fixture
def write(tmp_path):
    """Writes bytes or lines to a log and reads it, by a map of its own where one is given."""

    def _write(text, name="log.csv", columns=None):
        path = tmp_path / name
        raw = text if isinstance(text, bytes) else ("\n".join(text) + "\n").encode()
        path.write_bytes(gzip.compress(raw) if name.endswith(".gz") else raw)
        if columns is not None:
            (tmp_path / "own.toml").write_text(columns)
            return logs.read(path, columns=str(tmp_path / "own.toml"))
        return logs.read(path)

    return _write


def aligned(lines):
    """Columns of one width, blanks between them."""
    return ["".join(f"{cell:>22}" for cell in line.split(",")) for line in lines]


def changed(old, new):
    """The lines with a character in the place of another."""
    return lambda lines: [line.replace(old, new) for line in lines]


def continental(delimiter):
    """Decimal commas."""
    return lambda lines: [line.replace(",", delimiter).replace(".", ",") for line in lines]


def quoted(lines):
    """Quotation marks about every cell."""
    return [",".join(f'"{cell}"' for cell in line.split(",")) for line in lines]


FORMS = {
    "semicolons": ("a.csv", changed(",", ";")),
    "tabs": ("a.tsv", changed(",", "\t")),
    "bars": ("a.txt", changed(",", "|")),
    "blanks": ("a.txt", changed(",", "  ")),
    "aligned": ("a.txt", aligned),
    "packed tabs": ("a.tsv.gz", changed(",", "\t")),
    "packed aligned": ("a.txt.gz", aligned),
    "semicolons and decimal commas": ("a.csv", continental(";")),
    "tabs and decimal commas": ("a.tsv", continental("\t")),
    "quoted decimal commas": ("a.csv", lambda lines: quoted(lines[:1]) + [
        ",".join(f'"{cell.replace(".", ",")}"' for cell in line.split(",")) for line in lines[1:]]),
    "blanks after commas": ("a.csv", changed(",", ", ")),
    "quoted": ("a.csv", quoted),
    "quoted header": ("a.csv", lambda lines: quoted(lines[:1]) + lines[1:]),
    "upper case": ("a.csv", lambda lines: [lines[0].upper(), *lines[1:]]),
    "comma at the end of each line": ("a.csv", lambda lines: [f"{line}," for line in lines]),
    "comma at the end of each row": ("a.csv", lambda lines: [lines[0], *(f"{line}," for line in lines[1:])]),
    "comma at the end of the header": ("a.csv", lambda lines: [f"{lines[0]},", *lines[1:]]),
    "row of units": ("a.csv", lambda lines: [lines[0], UNITS, *lines[1:]]),
    "row of units in brackets": ("a.csv", lambda lines: [lines[0], ",".join(f"[{u}]" for u in UNITS.split(",")),
                                                          *lines[1:]]),
    "remarks": ("a.csv", lambda lines: ["# logger", "% of mine", *lines[:5], "// a pause", "", *lines[5:]]),
    "header that is a remark": ("a.csv", lambda lines: ["# logger", f"# {lines[0]}", *lines[1:]]),
    "header as MATLAB remarks": ("a.csv", lambda lines: [f"%{lines[0]}", *lines[1:]]),
    "exponents": ("a.csv", lambda lines: [lines[0], *(",".join(f"{float(c):.12E}" for c in line.split(","))
                                                       for line in lines[1:])]),
    "Fortran's exponents": ("a.csv", lambda lines: [lines[0], *(
        ",".join(f"{float(c):.12E}".replace("E", "D") for c in line.split(",")) for line in lines[1:])]),
    "words in a column of no use": ("a.csv", lambda lines: [f"{lines[0]},mode", *(f"{ln},AUTO" for ln in lines[1:])]),
    "two columns of no use with one name": ("a.csv", lambda lines: [f"{lines[0]},x1,x1",
                                                                     *(f"{line},1,a" for line in lines[1:])]),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_form_of_a_text_file_makes_no_difference(held, write, form):
    """Every column of the rows is that of the plain file, and nothing is called a repair."""
    name, changed_by = FORMS[form]
    lines = held.lines(held.columns())
    plain, found = write(lines), write(changed_by(lines), name)
    assert found.rows.tobytes() == plain.rows.tobytes()
    assert found.repairs == ()
    np.testing.assert_array_equal(found.reference.R_eb, plain.reference.R_eb)


@pytest.mark.parametrize(
    ("encoding", "end"),
    [("utf-8-sig", "\n"), ("utf-16", "\r\n"), ("utf-8", "\r\n"), ("utf-8", "\r"), ("latin-1", "\n")],
)
def test_encoding_and_line_ends_make_no_difference(held, write, encoding, end):
    """A byte-order mark, two bytes a character, line ends of any system, a degree sign of Latin-1."""
    lines = held.lines(held.columns())
    remark = ["# °"] if encoding == "latin-1" else []
    found = write(end.join([*remark, *lines, ""]).encode(encoding))
    assert found.rows.tobytes() == write(lines).rows.tobytes()


def test_numbers_are_those_that_pandas_reads(held, write, tmp_path):
    """Time, unit, sign and count against another reader, with a row of units in degrees and g."""
    columns = held.columns(attitude=False) | {"t": 1e3 * held.t_s}
    for i, a in enumerate("xyz"):
        columns[f"g{a}"], columns[f"a{a}"] = np.degrees(held.rate[:, i]), held.force[:, i] / 9.80665
    lines = held.lines(columns)
    found = write([lines[0], "ms,deg/s,deg/s,deg/s,g,g,g,km/h,kn", *lines[1:]], "units.csv")
    read = pd.read_csv(tmp_path / "units.csv", skiprows=[1])
    assert len(found.rows) == len(read)
    np.testing.assert_allclose(found.rows["t_s"], 1e-3 * read["t"], rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.rows["gyro_b_rad_s"], np.radians(read[["gx", "gy", "gz"]]), rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.rows["force_b_m_s2"], 9.80665 * read[["ax", "ay", "az"]], rtol=0, atol=1e-14)
    fixes = found.rows[found.rows["gps_new"] > 0]
    changes = np.flatnonzero(np.diff(read["vn"]) != 0.0) + 1
    np.testing.assert_array_equal(np.flatnonzero(found.rows["gps_new"]), changes)
    np.testing.assert_allclose(fixes["gps_v_e_m_s"][:, 0], read["vn"][changes] / 3.6, rtol=0, atol=1e-13)
    np.testing.assert_allclose(fixes["gps_v_e_m_s"][:, 1], read["ve"][changes] * 1852.0 / 3600.0, rtol=0, atol=1e-14)


def test_cells_without_a_value_are_none(held, write):
    """Empty, nan, NULL and a dash between magnetic samples: one sample for each that is there."""
    lines = held.lines(held.columns())
    nothing = [",,,", ",nan,NaN,NAN", ",NULL,null,", ",-,--,N/A"]
    rows = [f"{line}{',20.5,1.25,43' if k % 5 == 0 else nothing[k % 4]}" for k, line in enumerate(lines[1:])]
    found = write([f"{lines[0]},mag_x,mag_y,mag_z", *rows])
    assert np.flatnonzero(found.rows["mag_new"]).tolist() == list(range(0, held.n, 5))
    np.testing.assert_array_equal(found.rows["mag_b_ut"], np.tile([20.5, 1.25, 43.0], (held.n, 1)))
    assert found.ledger["magnetometer"].used == 100


@pytest.mark.parametrize(
    ("form", "since"),
    [
        ("%Y-%m-%dT%H:%M:%S.%fZ", "1970"), ("%Y-%m-%d %H:%M:%S.%f", "1970"), ("%Y/%m/%d %H:%M:%S.%f", "1970"),
        ("%Y-%m-%dT%H:%M:%S.%f+00:00", "1970"), ("%H:%M:%S.%f", "midnight"),
    ],
)  # fmt: skip
def test_dates_and_times_of_day_become_seconds(held, write, form, since):
    """Across midnight, five seconds after the start; a date counts from 1970, a time of day from its midnight."""
    start = datetime(2024, 5, 1, 23, 59, 55, tzinfo=UTC)
    lines = held.lines(held.columns())
    stamps = [(start + timedelta(milliseconds=20 * (k + 1))).strftime(form) for k in range(held.n)]
    rows = [f"{stamp},{line.partition(',')[2]}" for stamp, line in zip(stamps, lines[1:], strict=True)]
    found = write([lines[0], *rows])
    zero = start.timestamp() if since == "1970" else 86395.0
    np.testing.assert_allclose(found.rows["t_s"] - zero, held.t_s, rtol=0, atol=1e-6)  # 2^-22 s at 1.7e9 s
    assert found.repairs[0].endswith(f"seconds since {since}")


def test_date_among_times_of_day_is_refused_with_its_line(held, write):
    """What is no time like those above it is named where it stands."""
    lines = held.lines(held.columns())
    rows = [f"12:00:{2 + 0.02 * k:06.3f},{line.partition(',')[2]}" for k, line in enumerate(lines[1:])]
    rows[40] = rows[40].replace("12:00:", "noon ")
    with pytest.raises(LogError, match=r"line 42, column t: 'noon 02\.800' is not a time of day like those above it"):
        write([lines[0], *rows])


def test_lines_above_the_header_are_passed_over(held, write):
    """A page about the logger has another number of cells than the rows; how many lines it has is reported."""
    lines = held.lines(held.columns())
    found = write(["Logger,v1.2", "Serial,123", "", *lines])
    assert found.rows.tobytes() == write(lines).rows.tobytes()
    assert found.repairs == ("2 lines above the header skipped",)


def test_file_without_a_header_needs_names_in_a_map(held, write):
    """The refusal says how, and what it says works."""
    lines = held.lines(held.columns())
    with pytest.raises(LogError, match=r'line 1 holds numbers and there is no header.*names = \["t", "gx"'):
        write(lines[1:])
    found = write(lines[1:], columns=f"names = {NAMES}".replace("'", '"'))
    assert found.rows.tobytes() == write(lines).rows.tobytes()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda lines: [lines[0], *(line.replace(".", ",") for line in lines[1:])],
         r"line 2: \d+ cells; the header has 12: commas between cells may be decimal commas"),
        (lambda lines: [line.replace(",", ";").replace("0.02;", "0,02;") for line in lines],
         r"occur: give the decimal sign in a column map"),
        (lambda lines: [lines[0].replace("gx", "gx (counts)"), *lines[1:]],
         r'no column for gyro\.x.*one in counts as "gx \(counts\)" = \{ is = "gyro\.x"'),
        (lambda lines: [lines[0].replace("vn", "gyro_x").replace("ve", "gyro_y").replace("roll", "gyro_z"),
                        *lines[1:]], r"gyro\.x may be gx or gyro_x: choose one in a column map"),
        (lambda _: ["hello", "1", "2"], "no columns found, the first line is 'hello'"),
        (lambda lines: [lines[0].replace("gy", "gx"), *lines[1:]], "two columns are named 'gx'"),
        (lambda _: ["a,b", "1,2", "3,4"], "no column name is recognised; it has a, b"),
        (lambda lines: ["recorded", *lines[:1]], "line 2: 12 cells; the header has 1"),
    ],
)  # fmt: skip
def test_what_can_be_read_in_two_ways_is_refused_with_the_way_out(held, write, change, said):
    """One line."""
    with pytest.raises(LogError, match=said) as error:
        write(change(held.lines(held.columns())))
    assert "\n" not in str(error.value)


def test_file_of_another_kind_is_refused(write):
    """Zero bytes are no text."""
    with pytest.raises(LogError, match="there are zero bytes in it"):
        write(b"t,gx\n1\x00,2\n")


def test_decimal_sign_of_the_map_decides(held, write):
    """A file with both signs: points are those of thousands."""
    lines = [line.replace(",", ";").replace(".", ",") for line in held.lines(held.columns())]
    note = [f"{lines[0]};note", *(f"{line};1.5" for line in lines[1:])]
    with pytest.raises(LogError, match="decimal"):
        write(note)
    assert write(note, columns='decimal = ","').rows.tobytes() == write(lines).rows.tobytes()


@pytest.mark.parametrize(("period", "per_s"), [(2.0**32, 1e6), (2.0**16, 1e3), (604800.0, 1.0), (86400e3, 1e3)])
def test_counter_that_begins_anew_goes_on(held, write, period, per_s):
    """A counter of 32 or 16 bits, the end of a week in seconds or of a day in milliseconds."""
    columns = held.columns() | {"t": np.round((held.t_s * per_s + period - 5.0 * per_s) % period, 6)}
    found = write(held.lines(columns))
    np.testing.assert_allclose(found.rows["t_s"] - (period / per_s - 5.0), held.t_s, rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("columns", "axes"),
    [("forward-left-up", (1, -1, -1)), ("right-forward-up", None), ("force-reversed", "force")],
)
def test_remedies_of_the_refusal_work(held, write, columns, axes, tmp_path):
    """Axes that point up and a reversed accelerometer are refused; each remedy brings the rows of the plain file."""
    table, level = held.columns(attitude=False), write(held.lines(held.columns(attitude=False)))
    gyro, force = (np.column_stack([table[f"{v}{a}"] for a in "xyz"]) for v in "ga")
    if axes == "force":
        force = -force
    elif axes is None:  # x right, y forward, z up
        gyro, force = (v[:, [1, 0, 2]] * [1, 1, -1] for v in (gyro, force))
    else:
        gyro, force = gyro * axes, force * axes
    for i, a in enumerate("xyz"):
        table[f"g{a}"], table[f"a{a}"] = gyro[:, i], force[:, i]
    with pytest.raises(LogError, match=rf"the median of z is.*--columns {columns}") as error:
        write(held.lines(table), "other.csv")
    assert "\n" not in str(error.value)
    found = logs.read(tmp_path / "other.csv", columns=columns)
    for name in ("gyro_b_rad_s", "force_b_m_s2"):
        np.testing.assert_array_equal(found.rows[name], level.rows[name])


def test_instruments_in_rows_of_their_own_arrive_with_the_next_inertial_sample(held, write):
    """Rows of the magnetometer and of the receiver between those of the inertial unit, empty cells in each."""
    header = "t,gx,gy,gz,ax,ay,az,mx,my,mz,vn,ve"
    rows = [(t, f"{t:.12g},{','.join(f'{v:.12g}' for v in (*w, *f))},,,,,")
            for t, w, f in zip(held.t_s, held.rate, held.force, strict=True)]  # fmt: skip
    field_s, fix_s = np.arange(0.003, 10.0, 0.015), np.arange(0.507, 10.0, 0.2)
    rows += [(t, f"{t:.12g},,,,,,,20,1,{40 + 0.001 * k:.12g},,") for k, t in enumerate(field_s)]
    rows += [(t, f"{t:.12g},,,,,,,,,,{t:.12g},-3") for t in fix_s]
    log = write([header, *(row for _, row in sorted(rows))])
    np.testing.assert_allclose(log.rows["t_s"], held.t_s, rtol=0, atol=1e-9)
    np.testing.assert_allclose(log.rows["gyro_b_rad_s"], held.rate, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(np.flatnonzero(log.rows["gps_new"]), np.searchsorted(held.t_s, fix_s))
    assert log.rows["mag_new"].sum() == len(np.unique(np.searchsorted(held.t_s, field_s)))
    books = {stream: (e.read, e.used, e.agrees) for stream, e in log.ledger.items()}
    assert books["gps"] == (len(fix_s), len(fix_s), True)
    assert books["magnetometer"] == (len(field_s), log.rows["mag_new"].sum(), True)
    assert books["imu"] == (held.n, held.n, True)
    assert log.repairs == ()


def test_accelerometer_in_rows_of_its_own_is_interpolated(held, write):
    """Halfway between those of the gyro: a straight line is within g (1.3 rad/s)^2 (0.02 s)^2 / 8 < 1e-3 m/s^2."""
    between = 0.5 * (held.force[1:] + held.force[:-1])
    rows = [(t, f"{t:.12g},{','.join(f'{v:.12g}' for v in w)},,,") for t, w in zip(held.t_s, held.rate, strict=True)]
    rows += [(t, f"{t:.12g},,,,{','.join(f'{v:.12g}' for v in f)}")
             for t, f in zip(held.t_s[:-1] + 0.01, between, strict=True)]  # fmt: skip
    log = write(["t,gx,gy,gz,ax,ay,az", *(row for _, row in sorted(rows))])
    np.testing.assert_allclose(log.rows["t_s"], held.t_s[1:-1], rtol=0, atol=1e-9)
    np.testing.assert_allclose(log.rows["force_b_m_s2"], held.force[1:-1], rtol=0, atol=2e-3)
    assert log.repairs[0] == "accelerometer in 499 rows of its own: interpolated to the rows of the gyro"
    assert (log.ledger["imu"].read, log.ledger["imu"].used) == (held.n, held.n - 2)


def test_rows_without_times_are_timed_by_their_intervals(held, write):
    """The sum of the intervals is the time."""
    columns = {"dt" if name == "t" else name: values for name, values in held.columns().items()}
    log = write(held.lines(columns | {"dt": np.full(held.n, 0.02)}))
    np.testing.assert_allclose(log.rows["t_s"], held.t_s, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(log.rows["dt_s"], 0.02)


def test_first_column_without_a_name_is_passed_over(held, write):
    """As pandas writes its index."""
    lines = held.lines(held.columns())
    found = write([f",{lines[0]}", *(f"{k},{line}" for k, line in enumerate(lines[1:]))])
    assert found.rows.tobytes() == write(lines).rows.tobytes()


def test_row_in_which_the_inertial_unit_was_silent_is_left_out_and_counted(held, write):
    """All six cells empty while the held columns go on: a sample that was lost, not another instrument's row."""
    lines = held.lines(held.columns())
    cells = lines[41].split(",")
    lines[41] = ",".join((cells[0], *[""] * 6, *cells[7:]))
    log = write(lines)
    assert log.repairs[0] == "column gx (gyro.x): 1 without a number left out, first line 42"
    assert log.ledger["imu"].left_out == {"without a number": 1}
