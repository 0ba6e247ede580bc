"""Column maps: units, signs, scales, axes and what is known of the instruments, spelled in TOML."""

import numpy as np
import pytest

from estimator.instruments import Known
from scenarios.harness.logs import column_groups
from scenarios.harness.logs.checks import Source
from scenarios.harness.logs.column_map import MAPS, ColumnMap, load
from scenarios.harness.logs.quantities import INERTIAL
from scenarios.harness.logs.recorded import LogError

DEG, KNOT = np.pi / 180.0, 1852.0 / 3600.0


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
    assert [found.columns[c].unit_given for c in "AE"] == [True, False]


@pytest.mark.parametrize(
    ("entry", "factor"),
    [
        ("gyro.x °/s", DEG), ("gyro.x deg/sec", DEG), ("gyro.x Degrees per second", DEG), ("gyro.x DPS", DEG),
        ("gyro.x rad/sec", 1.0), ("gyro.x deg/h", DEG / 3600.0), ("gyro.x rpm", 2.0 * np.pi / 60.0),
        ("force.x m/s²", 1.0), ("force.x m/s/s", 1.0), ("force.x M/S^2", 1.0), ("force.x G", 9.80665),
        ("force.x mG", 9.80665e-3), ("force.x ft/s^2", 0.3048),
        ("mag.x µT", 1.0), ("mag.x μT", 1.0), ("mag.x microtesla", 1.0), ("mag.x nT", 1e-3), ("mag.x Gauss", 100.0),
        ("mag.x G", 100.0), ("mag.x mG", 0.1), ("mag.x milligauss", 0.1),
        ("gps.vn kn", KNOT), ("gps.vn kt", KNOT), ("gps.vn kts", KNOT), ("gps.vn knots", KNOT), ("gps.vn ft/s", 0.3048),
        ("gps.vn mph", 0.44704), ("gps.vn km/h", 1.0 / 3.6), ("gps.vn mm/s", 1e-3), ("airspeed knot", KNOT),
        ("height ft", 0.3048), ("gps.altitude feet", 0.3048), ("gps.latitude 1e-7deg", 1e-7 * DEG),
        ("time milliseconds", 1e-3), ("time usec", 1e-6), ("time ns", 1e-9), ("yaw degrees", DEG),
    ],
)  # fmt: skip
def test_load_understands_spellings_of_a_unit(tmp_path, entry, factor):
    """In any case, with the usual words and signs; by the definitions of the units."""
    found = load(written(tmp_path, f'[columns]\na = "{entry}"')).columns["a"]
    assert found.factor == pytest.approx(factor, rel=1e-12)
    assert found.unit_given


def test_load_scale_is_factor_times_number_less_offset(tmp_path):
    """A sensor in counts: 512 is zero, one count 0.0305 deg/s, and the axis counts the other way."""
    text = '[columns]\nt = "time"\nw = { is = "-gyro.x", unit = "deg/s", factor = 0.0305, offset = 512 }'
    meanings = load(written(tmp_path, text))
    columns = {"t": np.array([0.0, 1.0]), "w": np.array([512.0, 712.0])}
    (group,), _ = column_groups.take(columns, meanings, Source(tmp_path))
    np.testing.assert_allclose(group.table["gyro.x"], [0.0, -6.1 * DEG], rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("axes", "forward", "right", "down"),
    [
        ("forward-left-up", 0, -1, -2), ("right-forward-up", 1, 0, -2), ("FRD", 0, 1, 2), ("back, right, up", 0, 1, -2),
        ("left-back-up", -1, 0, -2),
    ],
)  # fmt: skip
def test_load_axes_turn_gyro_force_and_field_together(tmp_path, axes, forward, right, down):
    """Each axis of the body is one of the sensor, or its negative: those that the names say."""
    signs = {"back, right, up": (-1, 1, -1), "left-back-up": (-1, -1, -1)}.get(axes)
    meanings = load(written(tmp_path, f'axes = "{axes}"\n'))
    numbers = np.array([1.0, 2.0, 3.0])
    table = {f"{v}.{a}": np.array([n]) for v in ("gyro", "force", "mag") for a, n in zip("xyz", numbers, strict=True)}
    group = column_groups.Group(table)
    column_groups.turn(group, meanings)
    wanted = [numbers[abs(i)] * (1 if i >= 0 else -1) for i in (forward, right, down)]
    if signs is not None:
        wanted = [s * numbers[abs(i)] for s, i in zip(signs, (forward, right, down), strict=True)]
    if axes == "left-back-up":  # forward is minus y, right is minus x
        wanted = [-2.0, -1.0, -3.0]
    for vector in ("gyro", "force", "mag"):
        assert [float(group.table[f"{vector}.{a}"][0]) for a in "xyz"] == wanted


def test_load_reads_the_form_of_a_file_and_what_its_attitude_is(tmp_path):
    """Decimal sign, names for a file without a header, kind of the reference, origin; no table of columns is needed."""
    text = 'decimal = ","\nnames = ["t", "gx"]\nreference = "truth"\norigin_deg = [47, 8.5]\nforce_reversed = true'
    found = load(written(tmp_path, text))
    assert (found.decimal, found.names, found.reference) == (",", ("t", "gx"), "truth")
    assert (found.origin_deg, found.force_reversed, found.columns) == ((47.0, 8.5), True, {})


def test_load_instruments_are_properties_or_parameters_of_an_estimator(tmp_path):
    """Numbers and truth values; `fly_forward` is a parameter of ap_dcm alone."""
    text = "[instruments]\ngps_latency_s = 0.2\ngps_stamped = true\nfly_forward = 0\n"
    known = load(written(tmp_path, text)).known
    assert known == {
        "gps_latency_s": Known(0.2, "log", "own.toml"),
        "gps_stamped": Known(True, "log", "own.toml"),
        "fly_forward": Known(0, "log", "own.toml"),
    }


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[columns", "own.toml"),
        ("other = 1\n[columns]", "unknown entry 'other'"),
        ('colums = "a"', "unknown entry 'colums': did you mean columns"),
        ("", "empty; a map has a table"),
        ("columns = 3", "columns must be a table"),
        ('[columns]\na = "gyro.w"', "a = 'gyro.w': unknown quantity 'gyro.w': did you mean"),
        ('[columns]\na = "gyro.x uT"', "unit 'uT' of gyro.x must be one of rad/s, deg/s"),
        ('[columns]\na = "gyro.x counts"', r"counts is not a unit: give the size of one.*factor = 0\.001"),
        ('[columns]\na = "gyro.x"\nb = "gyro.x"', "gyro.x is assigned to two columns, a and b"),
        ('[columns]\na = { is = "gyro.x", unit = "deg/s", facter = 2 }', "unknown entry 'facter': did you mean factor"),
        ('[columns]\na = { is = "gyro.x", factor = 0 }', "factor = 0 would make every value zero"),
        ('[columns]\na = { is = "gyro.x", offset = "b" }', "offset = 'b' must be a number"),
        ('[columns]\na = { unit = "deg/s" }', r"write \{ is = "),
        (
            '[columns]\n[instruments]\ngps_latency_s = "b"',
            "gps_latency_s = 'b' must be a number, true or false",
        ),
        ("[instruments]\ngps_lateny_s = 1", r"gps_lateny_s: no such property: did you mean gps_latency_s"),
        ("[instruments]\nfly_foward = 1", r"fly_foward: no such property: did you mean fly_forward\?$"),
        ("[instruments]\ngps_latency_s = inf", "gps_latency_s = inf must be a number"),
        ('delimiter = ",,"\n[columns]', "delimiter = ',,' must be one character"),
        ('decimal = ";"', "decimal = ';' must be"),
        ("skip_lines = -1", "skip_lines = -1 must be a whole number"),
        ("names = 3", "names = 3 must be a list"),
        ('axes = "forward-left-down"', "left-handed"),
        ('axes = "forward-back-up"', "give the directions of x, y and z"),
        ('axes = "north-east-down"', "give the directions of x, y and z"),
        ('force_reversed = "yes"', "must be true or false"),
        ('reference = "gold"', "reference = 'gold' must be truth, filter or firmware"),
        ('withheld = ["gps_rate"]', "withheld 'gps_rate': did you mean gps_rate_hz"),
        ('withheld = ["gps_rate_hz"]\n[instruments]\ngps_rate_hz = 4', "withheld 'gps_rate_hz': it also has a value"),
        ("origin_deg = [100, 0]", "must be a latitude and a longitude"),
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
    """Time, gyro and accelerometer, each with its unit said; or axes for columns that are recognised."""
    found = load(path.stem)
    if not found.columns:
        assert found.R_bs is not None or found.force_reversed
        return
    assert {"time", *INERTIAL} <= {m.quantity for m in found.columns.values()}
    assert all(m.unit_given for m in found.columns.values())


def test_map_without_columns_recognises_them():
    """As without a map."""
    assert ColumnMap().of(["gx", "mode"]).columns["gx"].quantity == "gyro.x"
