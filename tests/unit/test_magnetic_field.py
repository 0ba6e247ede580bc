"""The earth's field: against a second model, against the picture everybody knows, and only where the model holds."""

import datetime
import math
import subprocess
import sys

import numpy as np
import ppigrf
import pytest

from sim import place
from sim.magnetic_field import declination_rad, field_e_ut

PLACES = {
    "launch point": (place.LATITUDE_DEG, place.LONGITUDE_DEG, place.ELEVATION_M),
    "Berlin": (52.5, 13.4, 40.0),
    "Dhaka": (23.7, 90.4, 10.0),
    "Sydney": (-33.9, 151.2, 100.0),
    "Ushuaia": (-54.8, -68.3, 0.0),
    "Nairobi": (-1.3, 36.8, 1700.0),
    "Mexico City": (19.4, -99.1, 2200.0),
    "Tromso": (69.6, 18.9, 0.0),
    "Manaus": (-3.1, -60.0, 0.0),
    "high above Tokyo": (35.7, 139.7, 100e3),
}
at_places = pytest.mark.parametrize("where", PLACES.values(), ids=PLACES.keys())


@at_places
@pytest.mark.parametrize("date", [(2025, 1, 1), (2026, 7, 2), (2028, 1, 1), (2029, 12, 1)])
def test_field_agrees_with_the_reference_field(where, date):
    """The International Geomagnetic Reference Field, another expansion fitted by others, within 100 nT a component."""
    latitude, longitude, height = where
    day = datetime.datetime(*date)
    first, last = datetime.datetime(day.year, 1, 1), datetime.datetime(day.year + 1, 1, 1)
    east, north, up = (float(c.item()) for c in ppigrf.igrf(longitude, latitude, height / 1e3, day))
    field = field_e_ut(latitude, longitude, height, day.year + (day - first) / (last - first))
    # Measured: 33 nT at most; the two see other years' satellites, and the reference goes one degree further.
    np.testing.assert_allclose(field, [north / 1e3, east / 1e3, -up / 1e3], rtol=0, atol=0.1)


@pytest.mark.parametrize(
    ("name", "declination_deg", "inclination_deg"),
    [("launch point", -13, 67), ("Berlin", 5, 68), ("Sydney", 13, -64), ("Nairobi", 0, -22), ("Tromso", 11, 79)],
)
def test_field_shows_the_known_picture(name, declination_deg, inclination_deg):
    """West of north in New York, east in Sydney; down in the north, up in the south (charts, to two degrees)."""
    north, east, down = field_e_ut(*PLACES[name], 2026.5)
    assert abs(math.degrees(math.atan2(east, north)) - declination_deg) <= 2.0
    assert abs(math.degrees(math.atan2(down, math.hypot(north, east))) - inclination_deg) <= 2.0
    assert 22.0 <= np.linalg.norm([north, east, down]) <= 67.0  # microtesla: the range of the whole surface


def test_field_is_found_once_and_cannot_be_edited():
    """The same place and date give the same array, which is read-only."""
    field = field_e_ut(*PLACES["Berlin"], 2027.0)
    assert field_e_ut(*PLACES["Berlin"], 2027.0) is field
    with pytest.raises(ValueError, match="read-only"):
        field[0] = 0.0


@pytest.mark.parametrize("year", [2024.99, 2030.01, 1900.0, math.nan])
def test_field_outside_the_models_years_is_refused(year):
    """The message names the years there are."""
    with pytest.raises(ValueError, match=r"year = .*: choose 2025 to 2030"):
        field_e_ut(42.0, -74.0, 0.0, year)


@pytest.mark.parametrize("year", [2025.0, 2030.0])
def test_field_at_the_ends_of_the_models_years_is_given(year):
    """Both ends belong to it."""
    assert np.all(np.isfinite(field_e_ut(42.0, -74.0, 0.0, year)))


@pytest.mark.parametrize(
    ("where", "said"),
    [
        ((90.5, 0.0, 0.0), r"latitude_deg = 90.5 deg: choose an angle from -90 to 90 deg"),
        ((0.0, 181.0, 0.0), r"longitude_deg = 181.0 deg: choose an angle from -180 to 180 deg"),
        ((math.nan, 0.0, 0.0), r"latitude_deg = nan deg"),
        ((0.0, 0.0, 1e7), r"height_m = 10000000.0 m: choose a height from -1000 to 850000 m"),
    ],
)
def test_field_of_a_place_not_on_earth_is_refused(where, said):
    """Latitude, longitude and height are named with their unit."""
    with pytest.raises(ValueError, match=said):
        field_e_ut(*where, 2026.0)


def test_importing_the_sensor_does_not_load_the_model():
    """A flight without a magnetometer pays nothing for it."""
    told = "import sys, sim.magnetic_field; sys.exit('pygeomag' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", told], check=False).returncode == 0


@pytest.mark.parametrize("year", [2025.0, 2027.3, 2030.0])
def test_declination_is_the_angle_of_the_field_from_true_north(year):
    """Within the years of the newest model."""
    north, east, _ = field_e_ut(42.8, -73.95, 100.0, year)
    assert declination_rad(42.8, -73.95, 100.0, year) == pytest.approx(np.arctan2(east, north), rel=0, abs=1e-6)


def test_declination_of_older_years_is_by_the_model_of_its_time():
    """It moves on within each model and does not jump between them; before the first it stays."""
    years = [2010.0, 2014.9, 2015.1, 2019.9, 2020.1, 2024.9, 2025.1]
    found = np.degrees([declination_rad(42.8, -73.95, 100.0, year) for year in years])
    assert np.all(np.diff(found)[0::2] > 0.1)  # to the east, within each
    assert np.all(np.abs(np.diff(found)[1::2]) < 0.1)  # from one model to the next
    assert declination_rad(42.8, -73.95, 100.0, 1999.0) == declination_rad(42.8, -73.95, 100.0, 2010.0)
    with pytest.raises(ValueError, match=r"latitude_deg = 91\.0 deg: choose an angle from -90 to 90 deg"):
        declination_rad(91.0, 0.0, 0.0, 2026.0)
