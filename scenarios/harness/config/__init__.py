"""The configuration of a flight: what flies, in which air, with which faults."""

from scenarios.harness.config.air import AirConfig, GustConfig, Wind, build_air, parse_wind
from scenarios.harness.config.fence import FenceConfig
from scenarios.harness.config.flight import (
    FlightConfig,
    RatesConfig,
    fitted_suite,
    is_field,
    literal,
    overridden,
    override,
    resolve,
)
from scenarios.harness.config.place import PlaceConfig
from scenarios.harness.config.start import BenchStart, HandMotion, HandThrowStart, InFlightStart

__all__ = [
    "AirConfig",
    "BenchStart",
    "FenceConfig",
    "FlightConfig",
    "GustConfig",
    "HandMotion",
    "HandThrowStart",
    "InFlightStart",
    "PlaceConfig",
    "RatesConfig",
    "Wind",
    "build_air",
    "fitted_suite",
    "is_field",
    "literal",
    "overridden",
    "override",
    "parse_wind",
    "resolve",
]
