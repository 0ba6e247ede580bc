"""The flights of claims: flown once, shared, read-only."""

import pytest

from scenarios.harness.claims import flights as claim_flights
from scenarios.harness.claims.flights import flights
from scenarios.harness.registry import find

SHORT = {"duration_s": 1.0}


def test_flights_asked_for_again_are_not_flown_again_and_others_are(monkeypatch):
    """What decides a flight is scenario, changes, seed and estimator; the order of the changes does not matter."""
    flown = []
    fly = claim_flights.fly_scenario
    monkeypatch.setattr(claim_flights, "fly_scenario", lambda *a, **k: flown.append(k) or fly(*a, **k))
    claim_flights._fly.cache_clear()
    first = flights("crosswind", [0, 1], {**SHORT, "wind": "3@270"})
    assert flights("crosswind", [1, 0], {"wind": "3@270", **SHORT}) == first[::-1]
    assert len(flown) == 2
    for others in (
        flights("crosswind", [0], SHORT),
        flights("crosswind", [0], {**SHORT, "wind": "3@270"}, "gyro_only"),
        flights("circle", [0], SHORT),
        flights(find("crosswind").varied("again", "Again.", {}), [0], {**SHORT, "wind": "3@270"}),
    ):
        assert others[0] is not first[0]
    assert len(flown) == 6


def test_flights_are_shared_and_cannot_be_written():
    """One claim must not spoil what another one reads."""
    (flight,) = flights("crosswind", [0], SHORT)
    with pytest.raises(ValueError, match="read-only"):
        flight.log.truth["t_s"] += 1.0
