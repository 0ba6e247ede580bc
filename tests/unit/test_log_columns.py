"""Column maps: units, signs and names, spelled in TOML or recognised."""

import numpy as np
import pytest

from scenarios.harness.logs import column_map
from scenarios.harness.logs.column_map import MAPS, QUANTITIES, automatic, load
from scenarios.harness.logs.recorded import LogError


def written(tmp_path, text):
    """A map file with `text` in it."""
    path = tmp_path / "own.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_load_reads_sign_quantity_and_unit(tmp_path):
    """Factors are those of the definitions of the units: 180 degrees are pi, a standard g is 9.80665 m/s^2."""
    entries = {"A": "-force.z g", "B": "gyro.x deg/s", "C": "mag.y gauss", "D": "time us", "E": "gps.vn"}
    text = ['delimiter = ";"', "skip_lines = 3", "[columns]", *(f'{n} = "{entry}"' for n, entry in entries.items())]
    path = written(tmp_path, "\n".join(text))
    found = load(path)
    factors = {name: meaning.factor for name, meaning in found.columns.items()}
    assert factors == pytest.approx({"A": -9.80665, "B": np.pi / 180, "C": 100.0, "D": 1e-6, "E": 1.0}, rel=1e-15)
    assert (found.columns["A"].quantity, found.delimiter, found.skip_lines) == ("force.z", ";", 3)
    assert [found.columns[c].told for c in "AE"] == [True, False]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[columns", "own.toml"),
        ("other = 1\n[columns]", "unknown entry 'other'"),
        ("", r"no table \[columns\]"),
        ('[columns]\na = "gyro.w"', "a = 'gyro.w': unknown quantity 'gyro.w': did you mean"),
        ('[columns]\na = "gyro.x uT"', "unit 'uT' of gyro.x must be one of rad/s, deg/s"),
        ('[columns]\na = "gyro.x"\nb = "gyro.x"', "gyro.x is the meaning of two columns"),
        ('[columns]\n[suits]\na = "b"', r"\[suits\] must hold numbers"),
        ('delimiter = ",,"\n[columns]', "delimiter must be one character"),
    ],
)
def test_load_bad_map_is_refused_in_one_line(tmp_path, text, said):
    """The line names the map, the column and what would be right."""
    with pytest.raises(LogError, match=said) as error:
        load(written(tmp_path, text))
    assert "\n" not in str(error.value)


def test_load_unknown_map_names_those_there_are():
    """A misspelt name is answered with what comes near."""
    with pytest.raises(LogError, match="did you mean umn_ultrastick"):
        load("umn_ultrastik")


@pytest.mark.parametrize("path", sorted(MAPS.glob("*.toml")), ids=lambda path: path.stem)
def test_every_shipped_map_has_what_a_replay_needs(path):
    """Time, gyro and accelerometer, each with its unit said."""
    columns = load(path.stem).columns
    assert {"time", *column_map.INERTIAL} <= {m.quantity for m in columns.values()}
    assert all(m.told for m in columns.values())


@pytest.mark.parametrize(
    ("column", "quantity", "factor"),
    [
        ("gx", "gyro.x", 1.0),
        ("gyro_y_deg_s", "gyro.y", np.pi / 180),
        ("GyrZ [dps]", "gyro.z", np.pi / 180),
        ("measured.gyro_b_rad_s.z", "gyro.z", 1.0),
        ("acc_x (g)", "force.x", 9.80665),
        ("accel_z_m_s2", "force.z", 1.0),
        ("mag_x_uT", "mag.x", 1.0),
        ("time_ms", "time", 1e-3),
        ("timestamp_us", "time", 1e-6),
        ("measured.gps_v_e_m_s.e", "gps.ve", 1.0),
        ("measured.gps_p_e_m.d", "gps.d", 1.0),
        ("truth.R_eb.zx", "r20", 1.0),
        ("roll_deg", "roll", np.pi / 180),
        ("Airspeed", "airspeed", 1.0),
    ],
)
def test_automatic_knows_names_in_use(column, quantity, factor):
    """Our own Parquet's names, those of other people's logs, a unit behind the name or in brackets."""
    meaning = automatic([column]).columns[column]
    assert meaning.quantity == quantity
    assert meaning.factor == pytest.approx(factor, rel=1e-15)


def test_automatic_takes_no_estimate_for_a_measurement_and_the_first_of_two():
    """What an autopilot believed is not what a sensor said; a second column of one meaning is left alone."""
    found = automatic(["flown.R_eb.xx", "truth.airspeed_m_s", "gx", "gyro_x", "mode", "airspeed"])
    assert {name: m.quantity for name, m in found.columns.items()} == {"gx": "gyro.x", "airspeed": "airspeed"}


def test_automatic_name_of_every_quantity_is_its_own():
    """Our own names, with a dot or an underscore, are understood for every quantity."""
    for name in QUANTITIES:
        for spelled in (name, name.replace(".", "_")):
            assert automatic([spelled]).columns[spelled].quantity == name
