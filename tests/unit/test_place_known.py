"""The launch place in the configuration, and which code receives its elevation."""

import math
from dataclasses import replace

import numpy as np
import pytest

from autopilot.airframes import AutopilotParams
from autopilot.dcm import DcmAutopilot
from autopilot.energy import believe_airspeed, believe_headwind
from autopilot.guidance import direction_of_travel
from estimator.ap_dcm.ap_dcm import ApDcm
from estimator.blocks.air import height_above_launch, true_airspeed_factor, true_over_equivalent
from estimator.ins_ekf.ins_ekf import InsEkf
from estimator.instruments import Instruments, Known, property_value
from estimator.interface import MEASURED_DTYPE
from estimator.params.ap_dcm import ApDcmParams
from estimator.params.ins_ekf import InsEkfParams
from estimator.premerlani import Premerlani, PremerlaniParams
from scenarios.harness.config import FlightConfig, override
from scenarios.harness.flight import prepare
from scenarios.harness.logs.airspeeds import elevation, equivalent_m_s
from sim.view.story import launch_place

STILL = np.zeros(3)


def row_of(baro_m=math.nan, gps_m=math.nan, airspeed_m_s=math.nan):
    """One measured row with these heights and this equivalent airspeed."""
    rows = np.zeros(1, MEASURED_DTYPE)
    row = rows[0]
    row["dt_s"], row["force_b_m_s2"] = 0.02, (0.0, 0.0, -9.8)
    row["baro_height_m"], row["equivalent_airspeed_m_s"], row["air_new"] = baro_m, airspeed_m_s, 1
    row["gps_valid"] = math.isfinite(gps_m)
    row["gps_p_e_m"], row["gps_t_s"] = (0.0, 0.0, -gps_m), 0.0
    return rows


@pytest.mark.parametrize(("height_m", "factor"), [(0.0, 1.0), (1000.0, 1.0498), (2900.0, 1.1549), (4000.0, 1.2229)])
def test_true_over_equivalent_airspeed_by_the_table(height_m, factor):
    """sqrt(rho0 / rho) with the densities 1.225, 1.11164, 0.91844 and 0.81913 kg/m3 of ISO 2533."""
    assert true_over_equivalent(height_m) == pytest.approx(factor, rel=2e-4)
    assert equivalent_m_s(np.array([factor]), height_m)[0] == pytest.approx(1.0, rel=2e-4)


@pytest.mark.parametrize(
    ("heights", "found"),
    [((30.0, 90.0), 30.0), ((math.nan, 90.0), 90.0), ((math.nan, math.nan), 0.0), ((1e6, 90.0), 90.0),
     ((math.inf, 1e6), 0.0)],
)  # fmt: skip
def test_height_for_the_density_is_barometric_else_by_gps_else_none(heights, found):
    """A height that cannot be one counts as missing."""
    (row,) = row_of(*heights)
    assert height_above_launch(row) == found
    assert true_airspeed_factor(row, 2000.0) == true_over_equivalent(2000.0 + found)


@pytest.mark.parametrize(
    ("make", "column"),
    [
        (lambda e: Premerlani(PremerlaniParams(elevation_m=e)), "airspeed_m_s"),
        (lambda e: ApDcm(ApDcmParams(elevation_m=e)), "airspeed_m_s"),
        (lambda e: InsEkf(InsEkfParams(elevation_m=e)), "w_airspeed_m_s"),
    ],
)
def test_estimators_take_the_reading_for_the_true_airspeed_it_means(make, column):
    """14 m/s of equivalent airspeed, 100 m above a place at 2400 m."""
    for elevation_m, height_m in ((0.0, 0.0), (2400.0, 100.0)):
        estimator = make(elevation_m)
        estimator.reset(None)
        estimator._step(row_of(baro_m=height_m, airspeed_m_s=14.0), 0, estimator._state)
        taken = np.max(estimator._state[column])
        assert taken == pytest.approx(14.0 * true_over_equivalent(elevation_m + height_m), rel=1e-12)


def test_autopilot_speeds_are_equivalent_and_its_triangles_true():
    """At 2500 m: a pitot reading as it is; ground speed less wind over 1.1315; headwind and crab by true speed."""
    params = AutopilotParams()
    params = replace(params, energy=replace(params.energy, elevation_m=2500.0))
    memory = DcmAutopilot(params)._memory.view(np.recarray)
    factor, unknown = true_over_equivalent(2500.0), np.full(3, np.nan)
    s, p, row = memory[0].s, memory[0].p, row_of(0.0, 0.0, 13.0).view(np.recarray)[0]
    believe_airspeed(unknown, row, s, p, 1e9)
    assert s.airspeed_m_s == pytest.approx(13.0)
    assert s.true_factor == pytest.approx(factor)
    row.equivalent_airspeed_m_s, row.gps_v_e_m_s = math.nan, (factor * 12.0, 0.0, 0.0)
    s.air_left_s = 0.0
    believe_airspeed(STILL, row, s, p, 1e9)
    assert s.airspeed_m_s == pytest.approx(12.0, rel=1e-6)
    believe_headwind(1.0, 0.0, False, unknown, row, s, p, 1e9)
    assert s.headwind_m_s == pytest.approx(0.0, abs=1e-5)
    north, east = direction_of_travel(np.eye(3), np.array([0.0, 5.0, 0.0]), row, s, True, False, p.guidance)
    assert math.atan2(east, north) == pytest.approx(math.atan2(5.0, factor * 12.0), rel=1e-6)


def test_elevation_is_known_aboard_unless_withheld():
    """Set by the place; at sea level, or withheld, the assumption is the sea, and its source says so."""
    high = prepare("turns_180_high")
    assert high.instruments["elevation_m"] == Known(2500.0, "set", "place.elevation_m")
    for equipped in (high.estimator, high.autopilot):
        assert equipped.known["elevation_m"].value == 2500.0
    assert high.autopilot.code.params.energy.elevation_m == 2500.0
    hidden = prepare("turns_180_high", {"withheld": "elevation_m"})
    assert hidden.instruments["elevation_m"] == Known(0.0, "withheld")
    assert hidden.estimator.code.params.elevation_m == hidden.autopilot.code.params.energy.elevation_m == 0.0
    assert Instruments()["elevation_m"] == Known(0.0, "assumed")
    assert prepare("turns_180", {"elevation_m": 1200}).estimator.known["elevation_m"].source == "set"


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("place.latitude_deg", 90, "place.latitude_deg"),
        ("place.longitude_deg", -181, "place.longitude_deg"),
        ("place.elevation_m", 4500, "place.elevation_m"),
        ("place.ground_m", "hill", "place.ground_m"),
        ("place.elevation", 100, "place.elevation_m"),
        ("elevation_m", 20000, "-500 to 9000 m"),
    ],
)
def test_place_that_cannot_be_flown_is_refused_in_one_line(name, value, says):
    """The line names the field and what is right."""
    with pytest.raises(ValueError, match="(?i)" + says) as error:
        override(FlightConfig(), {name: value})
    assert "\n" not in str(error.value)


def test_elevation_of_a_property_may_be_below_the_sea():
    """Unlike the other numbers it has a sign."""
    assert property_value("elevation_m", "-420") == -420.0
    with pytest.raises(ValueError, match="zero or more"):
        property_value("gps_latency_s", "-1")
    assert elevation(-420.0, "x")["elevation_m"].value == -420.0
    assert elevation(None, "x") == elevation(1e5, "x") == {}


def test_place_of_a_recording_is_that_of_its_configuration():
    """Older recordings have none; a replay has the origin of its log."""
    config = FlightConfig(place={"latitude_deg": -33.0, "longitude_deg": 151.0, "elevation_m": 700.0})
    place = launch_place({"config": config.model_dump(mode="json")})
    assert (place.latitude_deg, place.longitude_deg, place.elevation_m) == (-33.0, 151.0, 700.0)
    assert launch_place({}).latitude_deg == 42.8
    assert launch_place({"launch_latitude_deg": 10.0, "launch_longitude_deg": 20.0}).longitude_deg == 20.0
    assert launch_place({"place": {"latitude_deg": "x", "more": 1}}).latitude_deg == 42.8
