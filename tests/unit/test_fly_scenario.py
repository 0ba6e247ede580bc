"""Flights from Python: a class, a function or a name as estimator, and a manifest that says what flew."""

from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest

from estimator.gps_velocity import GpsVelocityMagnetometer
from estimator.interface import AttitudeEstimate
from estimator.premerlani import Premerlani
from scenarios.harness.flight import fly_scenario
from scenarios.harness.registry import find

REST = find("bench_rest")
SHORT = {"duration_s": 0.1}
FLOWN = []  # what was made for the flights


@dataclass(frozen=True)
class Gains:
    k_p: float = 1.0
    gps_latency_s: float = 0.1

    def __post_init__(self):
        if self.k_p < 0.0:
            raise ValueError("k_p is negative")


class Mine:
    """Takes its parameters, and one beside them."""

    def __init__(self, params=None, colour="red"):
        self.params, self.colour = params or Gains(), colour
        FLOWN.append(self)

    def update(self, m):
        return AttitudeEstimate(np.eye(3))


class ByArgument(Mine):
    """Has no dataclass: arguments alone."""

    def __init__(self, k_p=1.0, gps_latency_s=None):
        self.k_p, self.gps_latency_s = k_p, gps_latency_s
        FLOWN.append(self)


def made_here(k_p=2.0):
    return Mine(Gains(k_p))


def fly(overrides, estimator, **options):
    """The last estimator made, and the configuration in the manifest."""
    FLOWN.clear()
    flight = fly_scenario(REST, {**SHORT, **overrides}, estimator=estimator, **options)
    return FLOWN[-1] if FLOWN else None, flight.manifest["config"]


@pytest.mark.parametrize("value", [0.5, np.float64(0.5), np.float32(0.5)])
@pytest.mark.parametrize(
    ("maker", "k_p"),
    [
        (Mine, lambda e: e.params.k_p),
        (ByArgument, lambda e: e.k_p),
        (made_here, lambda e: e.params.k_p),
        (partial(made_here, k_p=3.0), lambda e: e.params.k_p),
        (lambda k_p: Mine(Gains(k_p)), lambda e: e.params.k_p),
    ],
)
def test_parameters_of_a_class_or_function_are_flown_and_in_the_manifest(maker, k_p, value):
    """What the manifest claims is what flew."""
    flown, config = fly({"estimator_params.k_p": value}, maker)
    assert k_p(flown) == 0.5
    assert config["estimator_params"] == {"k_p": 0.5}


def test_parameters_and_arguments_of_one_class_are_both_flown():
    """Neither hides the other."""
    flown, _ = fly({"estimator_params.k_p": 0.5, "estimator_params.colour": "blue", "gps_latency_s": 0.7}, Mine)
    assert (flown.params, flown.colour) == (Gains(0.5, 0.7), "blue")


@pytest.mark.parametrize(
    ("overrides", "maker", "says"),
    [
        ({"estimator_params.k_q": 1.0}, Mine, "unknown parameter 'k_q' of estimator .*Mine: did you mean k_p"),
        ({"estimator_params.k_q": 1.0}, ByArgument, "has no parameter 'k_q': did you mean k_p"),
        ({"estimator_params.k_q": 1.0}, made_here, "has no parameter 'k_q'.*: what a function made is kept"),
        ({"estimator_params.gps_latency_s": 1.0}, made_here, "has no parameter 'gps_latency_s'"),
        ({"estimator_params.k_p": "x"}, Mine, "k_p = 'x' of estimator .*Mine: must be a number"),
        ({"estimator_params.k_p": -1.0}, Mine, r"k_p is negative \(test_fly_scenario.py, line 27, in __post_init__\)"),
        ({}, Mine(), "is not a class; name the class, or a function that makes a new one for each flight"),
        ({}, 3, "3 is not a class"),
        ({}, lambda: None, r"NoneType has no method update\(measurements\)"),
        ({}, partial(Mine, 1, 2, 3), "TypeError"),
        ({"gps_rate_hz": 5.0}, ByArgument, "gps_rate_hz = 5.0: neither estimator .*ByArgument nor autopilot"),
        ({"estimator": Mine}, None, "estimator = <class .*"),
        ({"seed": 3}, Mine, "seed = 4 and seed = 3 in the overrides: name it once"),
    ],
)
def test_flight_that_would_not_be_what_was_asked_for_is_refused(overrides, maker, says):
    """In one line, before it is flown."""
    with pytest.raises(ValueError, match=says) as refused:
        fly(overrides, maker, **({"seed": 4} if "seed" in overrides else {}))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("maker", "name"),
    [
        (Mine, "Mine"),
        (made_here, "made_here"),
        (lambda: Mine(), "<lambda>"),
        (partial(Mine, Gains(2.0), colour="blue"), "Mine(Gains(k_p=2.0, gps_latency_s=0.1), colour='blue')"),
    ],
)
def test_manifest_names_what_made_the_estimator(maker, name):
    """Not that it was `functools.partial`."""
    assert fly({}, maker)[1]["estimator"] == f"{__name__}:{name}" or fly({}, maker)[1]["estimator"].endswith(name)


def test_class_is_calibrated_on_the_turn_table_as_its_name_is():
    """The same flight, whether the estimator is named or given."""
    overrides = {**SHORT, "suite": "apm2", "turn_table": True}
    by_name = fly_scenario(REST, overrides, estimator="gps_velocity_magnetometer")
    by_class = fly_scenario(REST, overrides, estimator=GpsVelocityMagnetometer)
    params = [flight.manifest["config"]["estimator_params"] for flight in (by_name, by_class)]
    assert params[0] == params[1]
    assert "calibration.hard_iron_b_ut" in params[0]
    assert by_name.log.flown.tobytes() == by_class.log.flown.tobytes()


def test_numbers_of_numpy_in_overrides_are_those_of_python():
    """A loop over an array is how parameters are varied."""
    overrides = {"duration_s": np.float32(0.5), "seed": np.int64(3), "estimator_params.k_p": np.int64(1)}
    config = fly_scenario(REST, overrides, estimator=Premerlani, flight=np.int8(2)).manifest["config"]
    assert (config["duration_s"], config["seed"], config["flight"]) == (0.5, 3, 2)
    assert config["estimator_params"] == {"k_p": 1}
