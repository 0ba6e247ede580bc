"""A reference in a file of its own passes through the repairs of a log, whatever kind of file it is."""

import re

import numpy as np
import pytest
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from scenarios.harness import logs
from scenarios.harness.logs.recorded import LogError
from scenarios.harness.replay import Window, why_none
from sim import recording
from sim.log import Flight, Log, Outcome


@pytest.fixture
def score(held, tmp_path):
    """Reads the held motion without its attitude against a reference of columns, lines or a path."""

    def _score(reference, name="ref.csv"):
        (tmp_path / "log.csv").write_text("\n".join(held.lines(held.columns(attitude=False))))
        path = tmp_path / name
        if isinstance(reference, dict) and name.endswith(".mat"):
            savemat(path, reference)
        elif isinstance(reference, dict):
            path.write_text("\n".join(held.lines(reference)))
        elif isinstance(reference, list):
            path.write_text("\n".join(reference))
        else:
            path = reference
        return logs.read(tmp_path / "log.csv", reference=path)

    return _score


@pytest.fixture
def angles(held):
    """Time, roll, pitch and yaw of the held motion."""
    yaw, pitch, roll = held.attitude.as_euler("ZYX").T
    return {"t": held.t_s, "roll": roll, "pitch": pitch, "yaw": yaw}


def in_degrees(angles, wrap=180.0):
    """The angles in degrees, the yaw below `wrap`."""
    found = angles | {name: np.degrees(angles[name]) for name in ("roll", "pitch", "yaw")}
    return found | {"yaw": (found["yaw"] + 360.0 - wrap) % 360.0 + wrap - 360.0}


def quaternion(held, names, order=(3, 0, 1, 2)):
    """A quaternion with signs that change from row to row."""
    q = held.attitude.as_quat() * np.where(np.arange(held.n) % 3 == 0, -1.0, 1.0)[:, None]
    return {"t": held.t_s, **{name: q[:, i] for name, i in zip(names, order, strict=True)}}


FORMS = {
    "radians": (lambda _, a: a, ()),
    "degrees": (lambda _, a: in_degrees(a), ()),
    "degrees from 0 to 360": (lambda _, a: in_degrees(a, 360.0), ()),
    "a heading from 350 over 10": (lambda _, a: in_degrees(a, 190.0), ()),
    "milliseconds by name": (lambda _, a: {"time_ms": 1e3 * a["t"], **{n: v for n, v in a.items() if n != "t"}}, ()),
    "milliseconds": (lambda _, a: a | {"t": 1e3 * a["t"]}, ("ref.csv: column t (time) in milliseconds, not seconds: "
                                                          "converted",)),
    "microseconds": (lambda _, a: a | {"t": 1e6 * a["t"]}, ("ref.csv: column t (time) in microseconds, not seconds: "
                                                          "converted",)),
    "neighbours exchanged": (lambda h, a: {n: v[swapped(h.n)] for n, v in a.items()},
                             ("ref.csv: column t (time): 1 out of order, sorted",)),
    "backwards": (lambda _, a: {n: v[::-1] for n, v in a.items()},
                  ("ref.csv: column t (time): 499 out of order, sorted",)),
    "repeated": (lambda h, a: {n: v[np.sort([*range(h.n), 5, 5, 9])] for n, v in a.items()},
                 ("ref.csv: column t (time): 3 repeated, left out; first line 8",)),
    "quaternion of either sign": (lambda h, _: quaternion(h, ("qw", "qx", "qy", "qz")), ()),
    "numbered quaternion": (lambda h, _: quaternion(h, ("q[0]", "q[1]", "q[2]", "q[3]")), ()),
    "matrix": (lambda h, _: {"t": h.t_s, **{f"r{i}{j}": h.R_eb[:, i, j] for i in range(3) for j in range(3)}}, ()),
}  # fmt: skip


def swapped(n):
    """The numbers below n, two neighbours exchanged."""
    order = np.arange(n)
    order[[100, 101]] = order[[101, 100]]
    return order


@pytest.mark.parametrize("form", FORMS)
def test_reference_is_mended_as_a_log_is(held, score, angles, form):
    """The attitude at the times of the rows is that of SciPy, and what was repaired is said."""
    make, repairs = FORMS[form]
    log = score(make(held, angles))
    assert log.reference is not None
    np.testing.assert_allclose(log.reference.R_eb, held.R_eb, rtol=0, atol=1e-8)
    assert log.repairs == repairs
    entry = log.ledger["reference"]
    assert entry.agrees
    assert entry.used == held.n


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")])
def test_reference_that_begins_at_zero_is_in_the_unit_in_which_it_can_be_interpolated(
    held, score, angles, factor, unit
):
    """Its span overlaps that of the log in any unit."""
    more = {name: np.concatenate((v[:1], v)) for name, v in angles.items()}
    more["t"] = factor * np.concatenate(([0.0], held.t_s))
    log = score(more)
    np.testing.assert_allclose(log.reference.R_eb, held.R_eb, rtol=0, atol=1e-8)
    assert log.repairs == (f"ref.csv: column t (time) in {unit}, not seconds: converted",)


def test_reference_with_an_infinite_angle_lacks_that_row_alone(held, score, angles):
    """It is no number, and says nothing of the unit of the others; between its neighbours within 4e-4 / 4 rad."""
    log = score(angles | {"roll": np.where(np.arange(held.n) == 50, np.inf, angles["roll"])})
    np.testing.assert_allclose(log.reference.R_eb, held.R_eb, rtol=0, atol=4e-4)
    entry = log.ledger["reference"]
    assert (entry.read, entry.used, entry.left_out) == (held.n, held.n - 1, {"without a number": 1})


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda a: a | {"yaw": np.linspace(0.0, 20.0, len(a["t"]))}, "yaw up to 20 may be degrees or"),
        (lambda a: a | {"roll": 100.0 * np.degrees(a["roll"])}, r"roll up to \d+.* is neither radians nor degrees"),
    ],
)  # fmt: skip
def test_angles_whose_unit_cannot_be_found_are_refused_with_what_to_write(score, angles, change, said):
    """Unless the header names the unit."""
    changed = change(angles)
    with pytest.raises(LogError, match=said):
        score(changed)
    named = {name if name == "t" else f"{name}_rad": values for name, values in changed.items()}
    assert score(named).reference is not None


@pytest.mark.parametrize("name", ["ref.mat", "X_truth.csv"])
def test_reference_in_other_files_is_read(held, score, angles, name):
    """A MATLAB file; a name that says that it is the truth."""
    log = score(angles, name)
    np.testing.assert_allclose(log.reference.R_eb, held.R_eb, rtol=0, atol=1e-8)
    assert log.reference.kind == ("truth" if "truth" in name else "filter")


@pytest.mark.parametrize("of", ["folder", "file"])
def test_recording_of_ours_is_a_reference(held, score, tmp_path, of):
    """Its truth, at its own times, which are those of the log."""
    flown = Log.empty(held.n)
    flown.measured["t_s"], flown.measured["dt_s"] = held.t_s, 0.02
    flown.measured["gyro_b_rad_s"], flown.measured["force_b_m_s2"] = held.rate, held.force
    flown.truth["t_s"], flown.truth["R_eb"] = held.t_s, held.R_eb
    folder = recording.save(Flight(flown, 0.02, 0.0, Outcome.COMPLETED, "nose"), tmp_path / "flight")
    log = score(folder if of == "folder" else folder / recording.PARQUET)
    assert log.reference.kind == "truth"
    np.testing.assert_allclose(log.reference.R_eb, held.R_eb, rtol=0, atol=1e-12)


def test_reference_with_lost_cells_is_interpolated_and_counted(held, score, angles):
    """Every seventh row without a yaw: between its neighbours, 0.04 s apart, within 2 rad/s^2 (0.04 s)^2 / 8 = 4e-4."""
    yaw = np.where(np.arange(held.n) % 7 == 3, np.nan, angles["yaw"])
    log = score([line.replace("nan", "") for line in held.lines(angles | {"yaw": yaw})])
    np.testing.assert_allclose(log.reference.R_eb, held.R_eb, rtol=0, atol=4e-4)
    entry = log.ledger["reference"]
    assert (entry.read, entry.left_out) == (held.n, {"without a number": 71})
    assert entry.agrees


def test_reference_beyond_the_log_is_left_out_and_counted(held, score, angles):
    """Before it began and after it ended."""
    more = {name: np.concatenate(([v[0]], v, v[-2:])) for name, v in angles.items()}
    more["t"] = np.concatenate(([-5.0], held.t_s, [12.0, 13.0]))
    entry = score(more).ledger["reference"]
    assert (entry.read, entry.used, entry.left_out) == (503, 500, {"outside the times of the log": 3})


@pytest.mark.parametrize("shift_s", [1000.0, -1000.0, 86400.0])
def test_reference_on_another_clock_scores_nothing_and_names_both_spans(score, angles, shift_s):
    """Nobody guesses by how much the clocks differ; no unit is found that would make them meet."""
    first, last = 0.02 + shift_s, 10.0 + shift_s
    said = rf"its times, {first:.10g} to {last:.10g} s, do not overlap those of the log, 0\.02 to 10 s"
    log = score(angles | {"t": angles["t"] + shift_s})
    assert not log.reference.known.any()
    assert re.search(said, why_none(log, Window()))
    assert "\n" not in why_none(log, Window())
    entry = log.ledger["reference"]
    assert (entry.read, entry.used, entry.left_out) == (500, 0, {"outside the times of the log": 500})


@pytest.mark.parametrize(
    ("reference", "said"),
    [
        (lambda a: {"t": a["t"], "foo": a["t"], "roll": a["roll"]}, "no time and attitude in it"),
        (lambda a: {n: np.concatenate((v, v)) for n, v in a.items()}, "runs back from 10 to 0.02 s"),
    ],
)  # fmt: skip
def test_reference_that_cannot_be_used_is_refused(score, angles, reference, said):
    """One line with the file."""
    with pytest.raises(LogError, match=said) as error:
        score(reference(angles))
    assert "ref.csv" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("reference", "said"),
    [
        (lambda a: {n: v[::50] for n, v in a.items()}, r"its 10 attitudes are 1 s apart; those at most 0.5 s apart"),
        (lambda a: {n: v[:1] for n, v in a.items()}, "a single attitude, at 0.02 s"),
        (lambda a: a | dict.fromkeys(("roll", "pitch", "yaw"), 0.0 * a["t"]), "no attitude in any of its 500 rows"),
    ],
)  # fmt: skip
def test_reference_of_which_nothing_can_be_used_scores_nothing_and_says_why(score, angles, reference, said):
    """The log is replayed all the same; the books account for every attitude."""
    log = score(reference(angles))
    assert not log.reference.known.any()
    assert re.search(said, why_none(log, Window()))
    assert log.ledger["reference"].agrees
    assert log.ledger["reference"].used == 0


def test_reference_that_is_not_there_is_refused(score, tmp_path):
    """The path, and that it is not there."""
    with pytest.raises(LogError, match=r"no reference at .*none\.csv: there is no such file"):
        score(tmp_path / "none.csv")


def test_reference_replaces_the_attitude_of_the_log(held, tmp_path, angles):
    """In the rows and in the books."""
    (tmp_path / "log.csv").write_text("\n".join(held.lines(held.columns())))
    turned = Rotation.from_euler("z", 1.0) * held.attitude
    yaw, pitch, roll = turned.as_euler("ZYX").T
    (tmp_path / "ref.csv").write_text("\n".join(held.lines({"t": held.t_s, "roll": roll, "pitch": pitch, "yaw": yaw})))
    log = logs.read(tmp_path / "log.csv", reference=tmp_path / "ref.csv")
    np.testing.assert_allclose(log.reference.R_eb, turned.as_matrix(), rtol=0, atol=1e-8)
    assert (log.ledger["reference"].read, log.ledger["reference"].used) == (held.n, held.n)
