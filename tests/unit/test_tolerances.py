"""Differences from the drawing in a configuration: drawn by seed, repeated from the manifest, refused in one line."""

import json
import math

import numpy as np
import pytest

from scenarios.harness.config import FlightConfig, override, resolve
from scenarios.harness.config.tolerances import (
    MOST_SIGMA,
    AirframeConfig,
    TolerancesConfig,
    built,
    resolve_airframe,
)
from scenarios.harness.flight import fly_config, fly_scenario, prepare
from scenarios.harness.registry import find
from sim.aeroplane.built import AS_DRAWN, drawn_inertia_kg_m2

REAL = {
    "tolerances.mass": "0.05", "tolerances.cg": "0.02", "tolerances.inertia": "0.1", "tolerances.trim": "0.03",
    "tolerances.thrust": "0.05", "tolerances.warp_deg": "0.5",
}  # fmt: skip
FACTORS = ("roll_inertia_factor", "pitch_inertia_factor", "yaw_inertia_factor")


def drawn(flight=0, seed=0, aircraft="endurance", **changes):
    changes = {name.replace("__", "."): value for name, value in changes.items()}
    return resolve(override(FlightConfig(aircraft=aircraft), {"seed": seed, "flight": flight, **changes})).airframe


def campaign(flight, aircraft="endurance", **tolerances):
    return resolve_airframe(AirframeConfig(), TolerancesConfig(**tolerances), aircraft, True, 0, flight)


def test_without_tolerances_the_aeroplane_is_as_drawn():
    assert built(resolve(FlightConfig(seed=5)).airframe) == AS_DRAWN


def test_differences_are_drawn_by_seed_and_flight_and_only_once():
    changes = {name.replace(".", "__"): value for name, value in REAL.items()}
    assert drawn(**changes) == drawn(**changes)
    others = [drawn(seed=1, **changes), drawn(flight=1, **changes)]
    for name in AirframeConfig.model_fields:
        values = {getattr(airframe, name) for airframe in (drawn(**changes), *others)}
        assert len(values) == 3, name
    config = resolve(override(FlightConfig(), REAL))
    assert resolve(config) == config


def test_each_tolerance_has_streams_of_its_own():
    """Another tolerance beside it changes no difference of its own."""
    alone, together = drawn(tolerances__cg=0.02), drawn(tolerances__cg=0.02, tolerances__trim=0.1, tolerances__mass=0.1)
    assert alone.cg_aft == together.cg_aft != 0.0
    assert alone.mass_factor == 1.0 != together.mass_factor


def test_difference_that_is_set_is_not_drawn():
    airframe = drawn(tolerances__trim=0.05, airframe__rudder_trim="0.2")
    assert airframe.rudder_trim == 0.2
    assert airframe.aileron_trim not in (0.0, 0.2)


def test_differences_are_normal_up_to_two_standard_deviations():
    """Of 400 flights: mean 0 and the 0.880 of a normal cut at 2 sigma, each within four of its own standard errors."""
    z = np.array([campaign(k, mass=0.1).mass_factor - 1.0 for k in range(400)]) / 0.1
    assert np.abs(z).max() <= MOST_SIGMA
    cut = math.sqrt(1.0 - 2.0 * 2.0 * math.exp(-2.0) / math.sqrt(2.0 * math.pi) / 0.9544997)
    np.testing.assert_allclose(z.mean(), 0.0, rtol=0, atol=4.0 * cut / 20.0)
    np.testing.assert_allclose(z.std(), cut, rtol=0.12, atol=0)
    assert ((z < -1.7) | (z > 1.7)).any()


@pytest.mark.parametrize("aircraft", ["endurance", "gentle_lady"])
def test_drawn_moments_of_inertia_are_those_of_a_possible_body(aircraft):
    """None exceeds the sum of the others, whatever is drawn; each varies by about the tolerance."""
    flights = [campaign(k, aircraft, inertia=0.2) for k in range(200)]
    factors = np.array([[getattr(airframe, name) for name in FACTORS] for airframe in flights])
    moments = factors * drawn_inertia_kg_m2(aircraft)
    assert (moments.sum(axis=1) > 2.0 * moments.max(axis=1)).all()
    assert ((factors.std(axis=0) > 0.08) & (factors.std(axis=0) < 0.2)).all()


def test_what_an_aeroplane_does_not_have_is_not_drawn():
    assert drawn(aircraft="gentle_lady", tolerances__thrust=0.1).thrust_factor == 1.0
    on_a_table = prepare("bench_rest", {"tolerances.mass": 0.1}).config
    assert built(on_a_table.airframe) == AS_DRAWN


def test_manifest_holds_what_was_drawn_and_repeats_the_flight():
    """The same aeroplane, the same bits; another seed draws another and flies otherwise."""
    changes = {**REAL, "duration_s": 1.0}
    flight = fly_scenario(find("return_to_launch"), changes, seed=3)
    kept = json.loads(json.dumps(flight.manifest["config"]))
    assert kept["tolerances"]["mass"] == 0.05
    assert 0.9 < kept["airframe"]["mass_factor"] < 1.1
    assert kept["airframe"]["mass_factor"] != 1.0
    again = fly_config(find("return_to_launch"), FlightConfig(**kept))
    assert again.log.truth.tobytes() == flight.log.truth.tobytes()
    other = fly_scenario(find("return_to_launch"), {**changes, "airframe.mass_factor": 1.0}, seed=3)
    assert other.log.truth.tobytes() != flight.log.truth.tobytes()


@pytest.mark.parametrize(
    ("scenario", "changes", "words"),
    [
        ("circle", {"airframe.mass_factor": "heavy"}, "airframe.mass_factor = 'heavy': must be a number or 'random'"),
        ("circle", {"airframe.mass_factor": "-1"}, "airframe.mass_factor = -1: must be above 0"),
        ("circle", {"airframe.mass": "1.1"}, "unknown parameter 'airframe.mass': did you mean airframe.mass_factor"),
        ("circle", {"airframe.warp_deg": "40"}, "airframe.warp_deg = 40 deg: must be at most 10 deg"),
        ("circle", {"tolerances.mass": "5"}, "tolerances.mass = 5: must be at most 0.3"),
        ("circle", {"airframe.cg_aft": "0.3"}, "airframe.cg_aft = 0.3: diverges in pitch, its static margin is"),
        ("circle", {"airframe.mass_factor": "4"}, "airframe.mass_factor = 4: cannot fly at its cruise speed"),
        ("circle", {"airframe.mass_factor": "2.5", "place.elevation_m": "4000"}, "airframe.mass_factor = 2.5: cannot"),
        ("bench_rest", {"airframe.cg_aft": "0.01"}, "airframe: the flight is on a table"),
        ("gentle_lady_return", {"airframe.thrust_factor": "0.9"}, "'gentle_lady' has no motor"),
    ],
)  # fmt: skip
def test_impossible_aeroplane_is_refused_before_the_flight_in_one_line(scenario, changes, words):
    with pytest.raises(ValueError, match=r"airframe|tolerances") as refused:
        prepare(scenario, changes)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)
