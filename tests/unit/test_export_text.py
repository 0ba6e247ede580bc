"""A flight exported as a text log replays as the flight: row for row, bit for bit, with what is known of it."""

import tomllib
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from estimator.interface import MEASURED_DTYPE
from scenarios.harness import logs
from scenarios.harness.cli.app import run
from scenarios.harness.replay import replay
from sim import recording

KNOWN = {
    "gps_latency_s": {"value": 0.25, "source": "data sheet"},
    "gps_filter_s": {"value": 0.0, "source": "set"},
    "gps_stamped": {"value": True, "source": "data sheet"},
    "gps_noise_m_s": {"value": None, "source": "unknown"},
    "gps_latency_sigma_s": {"value": 0.15, "source": "withheld"},
    "gps_rate_hz": {"value": None, "source": "withheld"},
    "gps_vertical_velocity": {"value": None, "source": "unknown"},
}
FLIGHTS = {
    "generic": ["hand_launch", "--duration", "20"],
    "apm2": ["hand_launch", "--duration", "20", "--sensors", "apm2", "--fault", "gps:outage@8-12"],
    "ideal": ["hand_launch", "--duration", "10", "--sensors", "ideal"],
}


@pytest.fixture(scope="module", params=FLIGHTS)
def flown(request, tmp_path_factory) -> Path:
    """A recording whose manifest says what is known of its instruments; beside it flight.csv and flight.toml."""
    folder = tmp_path_factory.mktemp(request.param)
    assert run(["fly", *FLIGHTS[request.param], "--no-rerun", "--out", str(folder / "as_flown")]) in (0, 1)
    (made,) = (folder / "as_flown").iterdir()
    flight = recording.load(made)
    flight.manifest["known"] = KNOWN
    recording.save(flight, folder / "flight")
    assert run(["export", str(folder / "flight"), "--csv", str(folder / "flight.csv")]) == 0
    return folder


def test_exported_rows_come_back_bit_for_bit(flown):
    """All that was measured, and the truth; the height above the launch is not a number where there is no barometer."""
    ours = logs.read(flown / "flight")
    text = logs.read(flown / "flight.csv", columns=str(flown / "flight.toml"))
    has_air = ours.rows["air_new"].any()
    for name in MEASURED_DTYPE.names:
        if has_air or name != "baro_height_m":
            np.testing.assert_array_equal(text.rows[name], ours.rows[name], err_msg=name)
    np.testing.assert_array_equal(text.reference.R_eb, ours.reference.R_eb)
    assert (text.reference.kind, text.sensors, text.place) == ("truth", ours.sensors, ours.place)
    assert {n: (e.read, e.used) for n, e in text.ledger.items()} == {
        n: (e.read, e.used) for n, e in ours.ledger.items()
    }


@pytest.mark.parametrize("estimator", ["premerlani", "gps_velocity", "ins_ekf", "ap_dcm", "gyro_only"])
def test_exported_flight_replays_as_the_recording(flown, estimator):
    """Every estimate is bit-equal: it is given the same rows and told the same."""
    ours = replay(logs.read(flown / "flight"), estimator)
    text = replay(logs.read(flown / "flight.csv", columns=str(flown / "flight.toml")), estimator)
    assert text.failure == ours.failure
    np.testing.assert_array_equal(text.log.flown["R_eb"], ours.log.flown["R_eb"])
    np.testing.assert_equal(dict(text.scores), dict(ours.scores))


def test_exported_flight_without_its_map_has_the_rows_but_not_the_knowledge(flown):
    """Its names are understood; what was known of the instruments is not in them."""
    alone = logs.read(flown / "flight.csv")
    ours = logs.read(flown / "flight")
    for name in ("t_s", "dt_s", "gyro_b_rad_s", "force_b_m_s2", "gps_new", "gps_v_e_m_s", "mag_b_ut", "air_new"):
        np.testing.assert_array_equal(alone.rows[name], ours.rows[name], err_msg=name)
    assert not {"gps_latency_s", "gps_filter_s"} & set(alone.known)


def test_exported_map_holds_what_is_known_alone(flown):
    """Not what is withheld, unknown or assumed."""
    data = tomllib.loads((flown / "flight.toml").read_text())
    assert data["instruments"] == {"gps_latency_s": 0.25, "gps_filter_s": 0.0, "gps_stamped": True}
    assert data["reference"] == "truth"
    assert data["withheld"] == ["gps_rate_hz", "gps_vertical_velocity"]  # which the rows would show


def test_exported_numbers_are_those_of_the_parquet_file(flown):
    """Read by pandas, against the columns of the Parquet file."""
    import pandas as pd

    text = pd.read_csv(flown / "flight.csv")
    table = pq.read_table(flown / "flight" / recording.PARQUET)
    for name, column in {
        "time_s": "measured.t_s", "interval_s": "measured.dt_s", "gyro_y_rad_s": "measured.gyro_b_rad_s.y",
        "force_z_m_s2": "measured.force_b_m_s2.z", "r20": "truth.R_eb.zx", "gps_new": "measured.gps_new",
    }.items():  # fmt: skip
        np.testing.assert_array_equal(text[name], table[column].to_numpy(), err_msg=name)
    new = table["measured.gps_new"].to_numpy() > 0
    for name, column in {"gps_ve_m_s": "measured.gps_v_e_m_s.e", "gps_t_s": "measured.gps_t_s"}.items():
        np.testing.assert_array_equal(text[name][new], table[column].to_numpy()[new], err_msg=name)
        assert text[name][~new].isna().all()


def test_fixes_whose_stamps_are_withheld_have_none(flown, tmp_path):
    """Else the file would tell what the manifest does not."""
    flight = recording.load(flown / "flight")
    flight.manifest["known"] = KNOWN | {"gps_stamped": {"value": False, "source": "withheld"}}
    recording.save(flight, tmp_path / "flight")
    assert run(["export", str(tmp_path / "flight"), "--csv", str(tmp_path / "f.csv")]) == 0
    assert "gps_t_s" not in (tmp_path / "f.csv").read_text().partition("\n")[0]
    log = logs.read(tmp_path / "f.csv", columns=str(tmp_path / "f.toml"))
    assert log.known["gps_stamped"].value is False


def test_export_packed_and_twice_is_the_same(flown, tmp_path):
    """Packed where the name says so, with the map beside it; the same bytes each time."""
    for _ in range(2):
        assert run(["export", str(flown / "flight"), "--csv", str(tmp_path / "f.csv.gz")]) == 0
        first = (tmp_path / "f.csv.gz").read_bytes()
    assert (tmp_path / "f.csv.gz").read_bytes() == first
    assert (tmp_path / "f.toml").is_file()
    packed = logs.read(tmp_path / "f.csv.gz", columns=str(tmp_path / "f.toml"))
    plain = logs.read(flown / "flight.csv", columns=str(flown / "flight.toml"))
    assert packed.rows.tobytes() == plain.rows.tobytes()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--csv", "f.txt"], "--csv f.txt: name a file that ends with .csv or .csv.gz"),
        (["--csv", "no/such/f.csv"], "there is no folder"),
        (["--csv", "f.csv", "--nmea", "f.toml"], "--nmea and the map of --csv both name f.toml"),
    ],
)
def test_export_refusals_of_a_text_log_are_one_line(flown, tmp_path, monkeypatch, capsys, arguments, said):
    """Before anything is written."""
    monkeypatch.chdir(tmp_path)
    assert run(["export", str(flown / "flight"), *arguments]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())
