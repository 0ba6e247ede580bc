"""Text and MATLAB logs: what they hold is read, mended and counted, or refused with the line and the column."""

import gzip

import numpy as np
import pytest
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from scenarios.harness import logs
from scenarios.harness.logs.recorded import LogError

N = 500
T_S = 0.02 * np.arange(1, N + 1)
RATE = np.stack([0.8 * np.sin(2.0 * T_S), 0.4 * np.cos(1.3 * T_S), 0.3 + 0.2 * np.sin(0.7 * T_S)], axis=-1)
R_EB = np.empty((N, 3, 3))
_R = Rotation.identity()
for _k in range(N):  # exact for a rate that is constant in each interval
    _R = _R * Rotation.from_rotvec(0.02 * RATE[_k])
    R_EB[_k] = _R.as_matrix()
FORCE = np.einsum("nij,i->nj", R_EB, np.array([0.0, 0.0, -9.80665]))  # held, not accelerated: R^T (0, 0, -g)


def table():
    """A hand-held motion as columns by name, with a fix every half second."""
    last = np.maximum(0, (np.arange(N) + 1) // 25 * 25 - 1)
    roll_yx = Rotation.from_matrix(R_EB).as_euler("ZYX")
    return {
        "t": T_S,
        **{f"g{a}": RATE[:, i] for i, a in enumerate("xyz")},
        **{f"a{a}": FORCE[:, i] for i, a in enumerate("xyz")},
        "vn": 1.0 + 0.1 * last,
        "ve": -2.0 + 0.0 * last,
        "roll": roll_yx[:, 2],
        "pitch": roll_yx[:, 1],
        "yaw": roll_yx[:, 0],
    }


def lines(columns):
    """The lines of a text file of these columns."""
    return [",".join(columns), *(",".join(f"{v:.9g}" for v in row) for row in np.column_stack(list(columns.values())))]


@pytest.fixture
def write(tmp_path):
    """Writes lines to a log and reads it."""

    def _write(text, name="log.csv", **options):
        path = tmp_path / name
        path.write_bytes("\n".join(text).encode() + b"\n")
        return logs.read(path, **options)

    return _write


def test_columns_become_rows(write):
    """Every column arrives where it belongs; the attitude in angles is the matrix it came from."""
    log = write(lines(table()))
    np.testing.assert_allclose(log.rows["t_s"], T_S, rtol=0, atol=1e-9)
    np.testing.assert_allclose(log.rows["dt_s"], 0.02, rtol=0, atol=1e-7)
    np.testing.assert_allclose(log.rows["gyro_b_rad_s"], RATE, rtol=0, atol=1e-8)
    np.testing.assert_allclose(log.rows["force_b_m_s2"], FORCE, rtol=0, atol=1e-7)
    assert log.reference is not None
    np.testing.assert_allclose(log.reference.R_eb, R_EB, rtol=0, atol=1e-7)
    assert (log.sensors, log.repairs) == (("gyro", "accelerometer", "gps"), ())


def test_fix_arrives_where_its_values_change(write):
    """Values held between reports are one report; what stands before the first change may be a filler."""
    rows = write(lines(table())).rows
    assert np.flatnonzero(rows["gps_new"]).tolist() == list(range(24, N, 25))
    assert not rows["gps_valid"][:24].any()
    np.testing.assert_allclose(rows["gps_v_e_m_s"][49:75, 0], [5.9] * 25 + [8.4], rtol=0, atol=1e-9)
    assert rows["gps_course_rad"][60] == pytest.approx(np.arctan2(-2.0, 5.9) + 2.0 * np.pi, rel=1e-12)
    assert rows["gps_speed_m_s"][60] == pytest.approx(np.hypot(2.0, 5.9), rel=1e-12)


def test_fix_in_cells_that_are_else_empty_counts_from_the_first(write):
    """A log that leaves cells empty between fixes has one in every row that has a value, other than the last."""
    columns = table()
    columns["vn"] = np.where(np.arange(N) % 50 == 0, columns["vn"], np.nan)
    rows = write([line.replace("nan", "") for line in lines(columns)]).rows
    assert np.flatnonzero(rows["gps_new"]).tolist() == list(range(0, N, 50))


def test_latitude_and_longitude_become_metres(write):
    """A thousandth of a degree of latitude at 45 degrees is 111.13 m, of longitude 78.85 m (WGS 84)."""
    columns = table()
    third = np.arange(N) // (N // 3)
    columns |= {"lat": 45.0 + 1e-3 * (third > 1), "lon": -93.0 + 1e-3 * (third > 1), "alt": 250.0 + 5.0 * (third > 1)}
    columns["lat"][:20] = 0.0  # no fix yet
    log = write(lines(columns))
    np.testing.assert_allclose(log.rows["gps_p_e_m"][-1], [111.13, 78.85, -5.0], rtol=0, atol=0.05)
    assert log.place == (45.0, -93.0)


@pytest.mark.parametrize("name", ["log.csv.gz", "log.mat"])
def test_other_containers_hold_the_same(tmp_path, write, name):
    """A packed text file and a MATLAB file with the columns at the top give the rows of the plain text file."""
    path = tmp_path / name
    if name.endswith(".mat"):
        savemat(path, {n: np.array([float(f"{v:.9g}") for v in column]) for n, column in table().items()})
    else:
        path.write_bytes(gzip.compress("\n".join(lines(table())).encode()))
    plain = write(lines(table()))
    assert logs.read(path).rows.tobytes() == plain.rows.tobytes()


def test_column_map_reads_any_names_units_and_axes(tmp_path, write):
    """Forward-left-up axes, degrees, g, milliseconds and semicolons, put right by a map, give the same rows."""
    columns = table()
    foreign = {
        "clock": 1e3 * T_S,
        "w1": np.degrees(RATE[:, 0]), "w2": -np.degrees(RATE[:, 1]), "w3": -np.degrees(RATE[:, 2]),
        "f1": FORCE[:, 0] / 9.80665, "f2": -FORCE[:, 1] / 9.80665, "f3": -FORCE[:, 2] / 9.80665,
    }  # fmt: skip
    path = tmp_path / "own.toml"
    path.write_text(
        'delimiter = ";"\nskip_lines = 1\n[columns]\nclock = "time ms"\nw1 = "gyro.x deg/s"\nw2 = "-gyro.y deg/s"\n'
        'w3 = "-gyro.z deg/s"\nf1 = "force.x g"\nf2 = "-force.y g"\nf3 = "-force.z g"\n'
    )
    text = ["logger 3.1", *(line.replace(",", ";") for line in lines(foreign))]
    log, plain = write(text, columns=str(path)), write(lines(columns), "plain.csv")
    for name, atol in (("t_s", 1e-9), ("gyro_b_rad_s", 1e-8), ("force_b_m_s2", 1e-7)):
        np.testing.assert_allclose(log.rows[name], plain.rows[name], rtol=0, atol=atol)
    assert log.repairs == ()


def test_map_that_comes_with_the_package_fits_by_itself(tmp_path):
    """A structure with the columns of a shipped map is read by it: gauss, axes and all."""
    columns = logs.column_map.load("umn_ultrastick").columns
    record = {name: np.linspace(0.1, 1.0, N) for name in columns}
    record |= {"time": T_S, **{n: RATE[:, i] for i, n in enumerate("pqr")}}
    record |= {f"a{a}": FORCE[:, i] for i, a in enumerate("xyz")} | {"h": np.ones(N), "note": "flown by hand"}
    savemat(tmp_path / "f.mat", {"flight_data": record})
    log = logs.read(tmp_path / "f.mat")
    np.testing.assert_allclose(log.rows["mag_b_ut"][-1], [100.0, -100.0, -100.0], rtol=1e-12)
    assert log.sensors == ("gyro", "accelerometer", "gps", "magnetometer", "airspeed")


def test_words_are_left_alone_in_columns_that_nobody_asked_for(write):
    """A column of flight modes hinders nobody."""
    text = lines(table())
    text = [f"mode,{text[0]}", *(f"AUTO,{line}" for line in text[1:])]
    assert len(write(text).rows) == N


def test_filter_that_has_not_started_is_no_reference(write):
    """Angles of exactly zero at the beginning are those of a filter that waits; later they are an attitude."""
    columns = table()
    for name in ("roll", "pitch", "yaw"):
        columns[name] = columns[name].copy()
        columns[name][:100] = 0.0
        columns[name][200] = 0.0
    reference = write(lines(columns)).reference
    assert reference is not None
    assert np.flatnonzero(~reference.known).tolist() == list(range(100))


@pytest.mark.parametrize("factor", [1.0, 180.0 / np.pi])
def test_angles_without_a_unit_are_degrees_where_radians_cannot_be(write, factor):
    """The attitude is the same, whether written in radians or in degrees."""
    columns = table() | {name: factor * table()[name] for name in ("roll", "pitch", "yaw")}
    reference = write(lines(columns)).reference
    assert reference is not None
    np.testing.assert_allclose(reference.R_eb, R_EB, rtol=0, atol=1e-7)


def test_reference_of_its_own_file_is_taken_at_the_times_of_the_log(tmp_path, write):
    """Quaternions at 10 Hz, interpolated on the shortest way: within the curvature, (0.1 s)^2 / 8 of 1.4 rad/s^2."""
    quaternion = Rotation.from_matrix(R_EB[4::5]).as_quat()
    path = tmp_path / "ref.csv"
    path.write_text("\n".join(lines({"t": T_S[4::5], **{f"q{c}": quaternion[:, i] for i, c in enumerate("xyzw")}})))
    bare = {name: v for name, v in table().items() if name not in ("roll", "pitch", "yaw")}
    reference = write(lines(bare), reference=path).reference
    assert reference is not None
    assert np.flatnonzero(~reference.known).tolist() == [0, 1, 2, 3]
    np.testing.assert_allclose(reference.R_eb[4:], R_EB[4:], rtol=0, atol=3e-3)


# What is wrong in a file, and what is said.


def changed(text, line, old=None, new="", cell=None):
    """`text` with one line (as people count) changed."""
    cells = text[line - 1].split(",")
    if cell is not None:
        cells[cell] = new
    return [*text[: line - 1], ",".join(cells) if old is None else text[line - 1].replace(old, new), *text[line:]]


def test_missing_columns_are_refused_by_name(write):
    """What is missing, what is there, and the way out."""
    columns = {name: v for name, v in table().items() if name not in ("gy", "az")}
    with pytest.raises(LogError, match=r"no column for gyro\.y, force\.z; it has t, gx, gz.*--columns"):
        write(lines(columns))


def test_cell_that_is_no_number_is_refused_with_line_and_column(write):
    """A word among numbers is named where it stands."""
    with pytest.raises(LogError, match=r"log\.csv: line 41, column gy: 'oops' is not a number"):
        write(changed(lines(table()), 41, cell=2, new="oops"))


def test_line_with_a_cell_too_few_is_refused_in_the_middle_and_left_out_at_the_end(write):
    """In the middle nobody knows which cell is missing; the last line was being written."""
    text = lines(table())
    short = ",".join(text[40].split(",")[:-2])
    with pytest.raises(LogError, match=r"log\.csv: line 41: 10 cells; the header has 12"):
        write([*text[:40], short, *text[41:]])
    log = write([*text[:-1], text[-1][:20]])
    assert len(log.rows) == N - 1
    assert log.repairs == (f"line {N + 1}, the last, was cut off: left out",)


def test_nan_is_left_out_and_counted_with_line_and_column(write):
    """The rows that remain account for the time."""
    text = changed(changed(lines(table()), 41, cell=2, new=""), 60, cell=2, new="nan")
    log = write(text)
    assert len(log.rows) == N - 2
    assert log.repairs[0] == "column gy (gyro.y): 2 without a number left out, first line 41"
    assert log.rows["dt_s"].sum() == pytest.approx(N * 0.02, rel=0, abs=1e-6)


def test_late_lines_are_sorted_and_repeated_ones_left_out(write):
    """Two neighbours exchanged, a line twice: the rows of the log in order are what remains."""
    text = lines(table())
    text[99], text[100] = text[100], text[99]
    text.insert(200, text[199])
    log = write(text)
    assert log.rows.tobytes() == write(lines(table()), "plain.csv").rows.tobytes()
    assert log.repairs == (
        "column t (time): 1 out of order, sorted; first line 101",
        "column t (time): 1 repeated, left out; first line 201",
    )


def test_clock_that_runs_back_is_refused_with_its_line(write):
    """Two logs in one file are not one flight."""
    text = lines(table())
    with pytest.raises(LogError, match=r"line 502, column t \(time\): runs back from 10 to 0\.02 s"):
        write([*text, *text[1:]])


def test_clock_that_stands_is_refused(write):
    """Time in whole seconds cannot time an inertial unit."""
    columns = table() | {"t": np.floor(T_S)}
    with pytest.raises(LogError, match=r"column t \(time\): 489 of 500 rows repeat the time before"):
        write(lines(columns))


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")])
def test_clock_in_another_unit_is_converted(write, factor, unit):
    """An inertial unit that would sample every 20 s samples every 20 ms."""
    log = write(lines(table() | {"t": factor * T_S}))
    np.testing.assert_allclose(log.rows["t_s"], T_S, rtol=1e-8)
    assert log.repairs == (f"column t (time) in {unit}, not seconds: converted",)


def test_gaps_are_told(write):
    """A silence of 2 s is told with its length; of three lost samples the next one stands for them."""
    text = lines(table())
    log = write([*text[:100], *text[200:300], *text[303:]])
    assert log.repairs == (
        "3 samples lost, covered by the next one; first at 6.06 s",
        "1 gaps longer than 0.5 s, the longest 2.0 s until 4.00 s",
    )


@pytest.mark.parametrize("without", [(), ("roll", "pitch", "yaw")])
def test_gyro_in_degrees_is_detected(write, without):
    """By the reference attitude, and without one by the direction of the specific force."""
    columns = {name: v for name, v in table().items() if name not in without}
    columns |= {f"g{a}": np.degrees(RATE[:, i]) for i, a in enumerate("xyz")}
    log = write(lines(columns))
    np.testing.assert_allclose(log.rows["gyro_b_rad_s"], RATE, rtol=0, atol=1e-7)
    assert log.repairs == ("column gx gy gz (gyro) in degrees per second, not rad/s: converted",)


def test_gyro_said_to_be_in_degrees_but_in_radians_is_detected(write):
    """The same mistake the other way round."""
    text = lines(table())
    log = write([text[0].replace("gx,gy,gz", "gyro_x_deg_s,gyro_y_deg_s,gyro_z_deg_s"), *text[1:]])
    np.testing.assert_allclose(log.rows["gyro_b_rad_s"], RATE, rtol=0, atol=1e-7)
    assert "in rad/s, not degrees per second: converted" in log.repairs[0]


def test_accelerometer_in_g_is_converted_and_the_wrong_way_round_refused(write):
    """A force of 1 at rest is a g; a force of +9.8 down may be two mistakes, and only the person knows which."""
    columns = table()
    log = write(lines(columns | {f"a{a}": FORCE[:, i] / 9.80665 for i, a in enumerate("xyz")}))
    np.testing.assert_allclose(log.rows["force_b_m_s2"], FORCE, rtol=0, atol=1e-7)
    assert log.repairs == ("column ax ay az (force) in g, not m/s^2: converted",)
    level = np.tile([0.0, 0.0, 9.8], (N, 1))
    with pytest.raises(LogError, match=r"column ax ay az \(force\): the median of z is 9\.8 m/s\^2.*minus sign"):
        write(lines(columns | {f"a{a}": level[:, i] for i, a in enumerate("xyz")}))


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"az": np.full(N, np.nan)}, r"column az \(force\.z\): no number in 500 rows"),
        ({"gx": np.where(np.arange(N) < 300, np.nan, 0.1)}, "300 of 500 rows lack a number, the first is line 2"),
        ({f"a{a}": np.full(N, 1e3) for a in "xyz"}, r"\(force\): its median is 1732\.05 m/s\^2"),
        ({"t": 1e-6 * np.arange(N)}, "an inertial unit samples every 5e-05 to 0.5 s"),
    ],
)
def test_log_that_cannot_be_believed_is_refused(write, columns, said):
    """One line with the column and the figure."""
    with pytest.raises(LogError, match=said) as error:
        write(lines(table() | columns))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("log.csv", b"", "no row of numbers: a header and rows of numbers"),
        ("log.csv", b"t,gx,t\n1,2,3\n", "line 1: two columns are named 't'"),
        ("log.csv", b"\xff\xfe\x00", "cannot be read"),
        ("log.csv.gz", b"\x1f\x8b\x08\x00", "cannot be read"),
        ("log.mat", b"MATLAB 5.0", "cannot be read as a MATLAB file"),
        ("log.xyz", b"", "unknown kind of log; recordings are folders or .parquet"),
        ("log.parquet", b"PAR1", "cannot read"),
    ],
)
def test_file_that_is_no_log_is_refused(tmp_path, name, content, said):
    """Empty, foreign and truncated files: one line with the file."""
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(LogError, match=said) as error:
        logs.read(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_log_that_is_not_there_is_refused(tmp_path):
    """The path, and that it is not there."""
    with pytest.raises(LogError, match=r"no log at .*none\.csv: there is no such file"):
        logs.read(tmp_path / "none.csv")
