"""A flight on disk: the round trip is exact, nothing half-written stays behind, what cannot be read says why."""

import hashlib
import json
import os
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from autopilot.interface import Mode, Setpoint
from sim import recording
from sim.log import TABLES, Event, Flight, Log, Outcome
from sim.recording import MANIFEST, PARQUET, RecordingError, check_writable, digest, elements, load, plain, save


def a_flight(n_ticks=40, seed=0):
    """A flight whose every element is a different number, some of them NaN, infinite or negative zero.

    Times increase, flags and enumerations hold what they may.
    """
    rng = np.random.default_rng(seed)
    log = Log.empty(n_ticks)
    for table, columns in TABLES.items():
        rows = getattr(log, table)
        for column in columns:
            shape = (n_ticks, *column.shape)
            rows[column.name] = rng.integers(0, 2, shape) if column.integer else rng.standard_normal(shape)
            if column.name == "t_s":
                rows["t_s"] = 0.02 * np.arange(1, n_ticks + 1) + 1e-3 * np.abs(rows["t_s"]).clip(0.0, 9.0)
    if n_ticks > 3:
        log.truth["p_e_m"][:4, 1] = np.nan, np.inf, -0.0, 5e-324
    return Flight(
        log, 0.02, 8.3, Outcome.GROUND_CONTACT, "nose", "touched the ground", (Event(0.1 + 0.2, "GPS lost", "warn"),),
        {"seed": seed, "config": {"wind_m_s": 0.1, "rates": [200, 50]}, "versions": {"python": "3"}},
    )  # fmt: skip


@pytest.fixture
def flight():
    return a_flight()


@pytest.mark.parametrize("n_ticks", [0, 1, 40])
def test_loaded_flight_equals_the_saved_one_bit_for_bit(tmp_path, n_ticks):
    """Bytes, not values, are compared: NaN, signed zeros and subnormals included."""
    flight = a_flight(n_ticks)
    back = load(save(flight, tmp_path))
    for table in TABLES:
        assert getattr(back.log, table).dtype == getattr(flight.log, table).dtype
        assert getattr(back.log, table).tobytes() == getattr(flight.log, table).tobytes()
    assert replace(back, log=flight.log) == flight


def test_every_column_of_the_tables_is_in_the_parquet_under_its_own_name(tmp_path, flight):
    """Each element of each column, found by name, with the meaning from the table beside it."""
    table = pq.read_table(save(flight, tmp_path) / PARQUET)
    n_elements = sum(int(np.prod(c.shape)) for columns in TABLES.values() for c in columns)
    assert len(set(table.column_names)) == n_elements == table.num_columns
    np.testing.assert_array_equal(table["truth.R_eb.zx"], flight.log.truth["R_eb"][:, 2, 0])
    np.testing.assert_array_equal(table["truth.p_e_m.e"], flight.log.truth["p_e_m"][:, 1])
    np.testing.assert_array_equal(table["measured.gyro_b_rad_s.z"], flight.log.measured["gyro_b_rad_s"][:, 2])
    np.testing.assert_array_equal(table["flown.mode"], flight.log.flown["mode"])
    for element in elements():
        about = table.schema.field(element.name).metadata
        assert about[b"meaning"].decode() == element.column.meaning
        assert tuple(json.loads(about[b"shape"])) == element.column.shape


def test_manifest_tells_the_flight_and_vouches_for_the_parquet(tmp_path, flight):
    """The manifest is plain JSON, the Parquet carries the same, and the hash is that of the file."""
    directory = save(flight, tmp_path / "new" / "folder")
    told = json.loads((directory / MANIFEST).read_text())
    assert told["seed"] == 0
    assert told["outcome"] == "ground_contact"
    assert told["message"] == "touched the ground"
    assert told["events"] == [{"t_s": 0.1 + 0.2, "text": "GPS lost", "level": "warn"}]
    assert (told["dt_s"], told["release_s"], told["n_ticks"]) == (0.02, 8.3, 40)
    assert told.pop("sha256") == hashlib.sha256((directory / PARQUET).read_bytes()).hexdigest()
    assert json.loads(pq.read_schema(directory / PARQUET).metadata[b"wingslevel"]) == told


def test_versions_are_added_where_the_manifest_names_none(tmp_path, flight):
    told = load(save(replace(flight, manifest={"seed": 1}), tmp_path)).manifest
    assert set(told["versions"]) == {"python", "jsbsim", "numpy", "numba", "wingslevel"}
    assert told["versions"]["numpy"] == np.__version__


def test_manifest_with_a_name_of_the_recording_is_refused(tmp_path, flight):
    with pytest.raises(RecordingError, match="outcome"):
        save(replace(flight, manifest={"outcome": "fine"}), tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_digest_changes_with_any_single_bit_of_any_column(flight):
    """Flip the lowest bit of one element of each column in turn: no two digests are equal."""
    seen = {digest(flight)}
    for element in elements():
        rows = getattr(flight.log, element.table)[element.column.name]
        bits = rows.view(np.int64)[(slice(5, 6), *element.at)]
        bits ^= 1
        seen.add(digest(flight))
        bits ^= 1
    assert len(seen) == 1 + len(elements())
    assert digest(flight) == digest(a_flight())


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, OSError(28, "No space left on device")])
@pytest.mark.parametrize("victim", ["write_table", "replace"])
def test_interrupted_save_leaves_nothing_behind(tmp_path, monkeypatch, flight, interruption, victim):
    """Ctrl-C or a full disk amid the write, or just before the rename: the folder stays as it was."""

    def interrupted(*arguments, **_):
        if victim == "write_table":
            arguments[1].write_bytes(b"PAR1 half a file")
        raise interruption

    monkeypatch.setattr(pq if victim == "write_table" else os, victim, interrupted)
    with pytest.raises((KeyboardInterrupt, RecordingError)):
        save(flight, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_interrupted_overwrite_keeps_the_old_flight_readable(tmp_path, monkeypatch, flight):
    """A new flight into the folder of an old one, interrupted: the old one is still there, whole."""
    save(flight, tmp_path)

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save(a_flight(seed=1), tmp_path)
    assert digest(load(tmp_path)) == digest(flight)


@pytest.mark.parametrize("kept", [0, 100, 0.5, -1])
def test_truncated_parquet_is_refused_in_one_line(tmp_path, flight, kept):
    path = save(flight, tmp_path) / PARQUET
    whole = path.read_bytes()
    path.write_bytes(whole[: int(kept * len(whole)) if isinstance(kept, float) else kept])
    with pytest.raises(RecordingError, match="truncated, or not a Parquet file") as refusal:
        load(tmp_path)
    assert str(path) in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_foreign_parquet_is_refused(tmp_path):
    pq.write_table(pa.table({"x": [1, 2]}), tmp_path / PARQUET)
    with pytest.raises(RecordingError, match="is a Parquet file, but not a flight"):
        load(tmp_path)


def test_parquet_with_another_column_is_refused_by_its_name(tmp_path, flight):
    path = save(flight, tmp_path) / PARQUET
    table = pq.read_table(path)
    pq.write_table(table.drop_columns("truth.beta_rad"), tmp_path / "less.parquet")
    with pytest.raises(RecordingError, match=r"lacks column truth\.beta_rad"):
        load(tmp_path / "less.parquet")


def test_recording_from_before_the_rename_of_the_airspeed_loads_bit_for_bit(tmp_path, flight):
    """`measured.equivalent_airspeed_m_s` was `measured.airspeed_m_s`."""
    save(flight, tmp_path)
    (tmp_path / MANIFEST).unlink()
    table = pq.read_table(tmp_path / PARQUET)
    older = [name.replace("measured.equivalent_airspeed", "measured.airspeed") for name in table.column_names]
    assert "measured.airspeed_m_s" in older
    table = table.rename_columns(older).replace_schema_metadata(table.schema.metadata)
    pq.write_table(table, tmp_path / PARQUET)
    assert digest(load(tmp_path)) == digest(flight)


def test_parquet_changed_after_the_fact_is_refused(tmp_path, flight):
    """A good Parquet file that is not the one which the manifest describes."""
    save(flight, tmp_path / "a")
    save(a_flight(seed=1), tmp_path / "b")
    os.replace(tmp_path / "b" / PARQUET, tmp_path / "a" / PARQUET)
    with pytest.raises(RecordingError, match="SHA-256 differs"):
        load(tmp_path / "a")


def test_missing_recording_is_refused_with_its_path(tmp_path):
    with pytest.raises(RecordingError, match=r"no recording at .*nowhere"):
        load(tmp_path / "nowhere")


@pytest.mark.parametrize("act", [check_writable, lambda directory: save(a_flight(), directory)])
def test_unwritable_directory_is_refused_with_path_and_reason(tmp_path, act):
    """A file stands where the folder should be: refused before and while writing alike, in one line."""
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match=r"cannot write to .*file.*: (Not a directory|File exists)") as refusal:
        act(tmp_path / "file" / "deep")
    assert "\n" not in str(refusal.value)


def test_check_writable_leaves_no_trace(tmp_path):
    check_writable(tmp_path / "not" / "yet")
    check_writable(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_file_of_an_uneventful_flight_is_small(tmp_path):
    """Compression is on: columns that never change cost next to nothing."""
    still = replace(a_flight(0), log=Log.empty(3000))
    in_memory = 3000 * 8 * len(elements())
    assert (save(still, tmp_path) / PARQUET).stat().st_size < 0.05 * in_memory


def test_plain_turns_what_json_does_not_know_into_what_it_knows():
    """NaN is None, an enumeration its name, NumPy numbers numbers, tuples lists, dataclasses dicts."""
    values = {"n": np.int64(3), "v": np.array([1.0, np.nan]), "o": Outcome.LEFT_BOX}
    told = plain({"setpoint": Setpoint(Mode.RETURN), **values})
    assert told["setpoint"]["mode"] == "return"
    assert told["setpoint"]["throttle"] is None
    assert told["setpoint"]["rate_b_rad_s"] == [0.0, 0.0, 0.0]
    assert (told["n"], told["v"], told["o"]) == (3, [1.0, None], "left_box")
    assert json.loads(json.dumps(told, allow_nan=False)) == told


def test_replacing_removes_the_temporary_file_and_passes_other_errors_on(tmp_path):
    """What is not the system's refusal is not reworded."""

    def half_done():
        with recording.replacing(tmp_path / "x.json") as path:
            path.write_text("half")
            raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        half_done()
    assert list(tmp_path.iterdir()) == []
