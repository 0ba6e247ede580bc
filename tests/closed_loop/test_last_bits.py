"""How far the last bit of a start moves what is measured of the flight: what `agree` allows is made from it."""

import math

import pytest

from scenarios.harness.commands import agree as agreement
from scenarios.harness.config import BenchStart, resolve
from scenarios.harness.flight import fly_config
from scenarios.harness.registry import find, registered
from scenarios.harness.verdict import Verdict, judge

SEEDS = (0, 1)


def flown(name: str, seed: int, last_bits: int) -> Verdict:
    """The verdict on one flight that starts with so many of the last bits of its heading more."""
    scenario = find(name)
    config = resolve(scenario.config.model_copy(update={"seed": seed}))
    heading_deg = config.heading_deg
    if last_bits:
        heading_deg = math.nextafter(heading_deg, math.copysign(math.inf, last_bits))
    start = config.start.model_copy(update={"heading_deg": heading_deg})
    flight = fly_config(scenario, config.model_copy(update={"start": start}))
    return Verdict.of([(scenario, judge(scenario, flight))])


def demand_agreement(name: str, seed: int) -> agreement.Agreement:
    """Demand that a flight and its twin agree as two machines should."""
    first = flown(name, seed, 0).to_json()
    for last_bit in (1, -1):
        compared = agreement.compare(first, flown(name, seed, last_bit).to_json())
        assert compared.agree, [(d.where, d.check, d.values) for d in compared.disagreeing] + list(compared.others)
    return compared


def test_last_bit_of_the_start_moves_values_less_than_agree_allows() -> None:
    """A crosswind flight through turbulence: the bits change, the verdict does not."""
    compared = demand_agreement("crosswind", 0)
    assert compared.worst(), "the last bit must have reached the flight"


@pytest.mark.long
@pytest.mark.parametrize("name", [n for n, s in registered().items() if not isinstance(s.config.start, BenchStart)])
def test_last_bit_of_the_start_moves_no_scenario_more_than_agree_allows(name: str) -> None:
    """Every scenario that flies, two seeds, a bit up and a bit down."""
    for seed in SEEDS:
        demand_agreement(name, seed)
