"""Flights and prescribed motions of claims: made once, shared, read-only; and what is measured over them."""

import numpy as np
import pytest

from estimator.premerlani import Premerlani, PremerlaniParams
from scenarios.harness.claims import flights as claim_flights
from scenarios.harness.claims.flights import clean_log, flights, hit_ground, percentage, rms_of_each
from scenarios.harness.claims.motions import (
    AS_PRINTED,
    EQUATIONS_ONLY,
    aboard,
    attitude_deg,
    begin,
    misread,
    printed,
    seen,
    sensed,
    tilt_deg,
)
from scenarios.harness.metrics import height_m
from scenarios.harness.registry import find
from sim.log import Outcome
from sim.motion.prescribed_plant import Rest, StraightLevel

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


def test_clean_log_is_calm_north_and_seen_without_error():
    """Steered by the true attitude, so the estimate in the log equals the truth; the log cannot be written."""
    log = clean_log("turns_180", {"duration_s": 3.0})
    assert np.array_equal(log.flown["R_eb"], log.truth["R_eb"])
    assert not log.truth["wind_e_m_s"].any()
    assert abs(log.truth["R_eb"][0, 1, 0]) < 0.1  # heading north
    with pytest.raises(ValueError, match="read-only"):
        log.measured["t_s"] += 1.0


def test_rms_of_each_flight_is_that_of_its_own_samples():
    """One value a flight, whatever the others are."""
    flown = flights("crosswind", [0, 1], SHORT)
    each = rms_of_each(flown, height_m)
    expected = [np.sqrt(np.mean(np.square(height_m(f).judged_values))) for f in flown]
    np.testing.assert_allclose(each, expected, rtol=1e-12, atol=0)


def test_percentage_counts_the_flights_for_which_it_is_so():
    """None of two flights of a second ends on the ground; one of them is the first."""
    flown = flights("crosswind", [0, 1], SHORT)
    assert percentage(flown, hit_ground) == 0.0
    assert all(flight.outcome != Outcome.GROUND_CONTACT for flight in flown)
    assert percentage(flown, lambda flight: flight is flown[0]) == 50.0


def test_prescribed_motion_is_sensed_once_and_cannot_be_written():
    """Claims share the log, with the changes of the sensors in any order; other changes make another log."""
    lag = {"gps.filter_s": 0.5, "gps.latency_s": 0.2}
    log = seen(StraightLevel(), 2.0, "ideal", lag)
    assert seen(StraightLevel(), 2.0, "ideal", dict(reversed(lag.items()))) is log
    assert seen(StraightLevel(), 2.0) is not log
    with pytest.raises(ValueError, match="read-only"):
        log.measured["t_s"] += 1.0


def test_sensed_has_the_gps_rate_of_the_suite_and_seen_five_hertz():
    """The lagged receiver of the theory's claims is that of the generic suite."""
    assert sensed(StraightLevel(), 10.0).measured["gps_new"].sum() == pytest.approx(40, abs=2)
    assert seen(StraightLevel(), 10.0).measured["gps_new"].sum() == pytest.approx(50, abs=1)


def test_begun_estimator_has_the_attitude_and_misread_gyros_turn_it_away():
    """At rest an offset of the gyros of 1 deg/s, not corrected, is an attitude error of a degree after a second."""
    log = seen(Rest(), 1.0)
    start = log.truth["R_eb"][0]
    still = PremerlaniParams(w_rp=0.0, w_y=0.0, k_i=0.0)
    offset = np.radians([0.0, 1.0, 0.0])
    R_eb = begin(Premerlani(still), start).replay(misread(log, offset_rad_s=offset))["R_eb"]
    # The earth turns by 0.004 degrees.
    assert attitude_deg(R_eb, log)[-1] == pytest.approx(1.0, rel=0, abs=0.02)
    assert tilt_deg(R_eb[-1:], log) == pytest.approx([1.0], rel=0, abs=0.02)


def test_parameters_as_printed_know_the_receiver_and_leave_out_what_was_added():
    """The equations alone leave out the lag filter too."""
    ours, theirs = aboard(), printed(w_y=0.7)
    assert (ours.gps_filter_s, ours.gps_latency_s) == (theirs.gps_filter_s, theirs.gps_latency_s) == (1.0, 0.3)
    assert ours.use_airspeed
    assert not theirs.use_airspeed
    assert theirs.w_y == 0.7
    assert set(AS_PRINTED) < set(EQUATIONS_ONLY)
    assert EQUATIONS_ONLY["gps_lag_filter"] is False
