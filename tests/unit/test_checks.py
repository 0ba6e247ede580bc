"""Checks: limits, incomplete measurements, and how flights are pooled."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.harness.checks import LOOSEST, SURVIVED, Check
from scenarios.harness.metrics import Measured, Series, at
from sim.log import Flight, Log, Outcome

FLIGHT = Flight(Log.empty(1), 0.02, 0.0, Outcome.COMPLETED, "course")


def check_of(value, *, samples=1, expected=1, limit=4.0, **more):
    """A check whose metric measures `value`."""
    return Check("error", "deg", lambda _flight: Measured(value, samples, expected), limit, **more)


def rows_of(values, **more):
    """The check, and a row of it for each of the values."""
    rows = [check_of(value, **more).judge(FLIGHT) for value in values]
    return check_of(0.0, **more), rows


@pytest.mark.parametrize(
    ("value", "sense", "passes"),
    [
        (4.0, "<=", True),
        (np.nextafter(4.0, 5.0), "<=", False),
        (4.0, ">=", True),
        (np.nextafter(4.0, 3.0), ">=", False),
    ],
)
def test_judge_at_the_limit_passes_and_one_digit_beyond_does_not(value, sense, passes):
    """The limit itself passes; the next larger number does not."""
    assert check_of(value, sense=sense).judge(FLIGHT).passed is passes


@pytest.mark.parametrize("sense", ["<=", ">="])
@pytest.mark.parametrize("pooled", ["rms", "worst", "count"])
def test_judge_and_pool_of_nan_fail(sense, pooled):
    """NaN fails every limit, alone or among good flights."""
    good = 1.0 if sense == "<=" else 9.0
    check, rows = rows_of([good, math.nan, good], sense=sense, pooled=pooled)
    assert [row.passed for row in rows] == [True, False, True]
    assert not check.pool(rows).passed


def test_judge_and_pool_of_too_few_samples_fail_with_a_note():
    """A perfect value over half a window fails, and the note says why."""
    row = check_of(0.0, samples=250, expected=500).judge(FLIGHT)
    assert not row.passed
    assert row.note == "250 of 500 samples"
    pooled = check_of(0.0).pool([check_of(0.0).judge(FLIGHT), row])
    assert not pooled.passed
    assert pooled.note == "1 of 2 flights too short"


def test_judge_of_an_empty_window_fails():
    """A window without any samples is a mistake in the scenario, not a pass."""
    assert not check_of(0.0, samples=0, expected=0).judge(FLIGHT).passed


@given(st.lists(st.floats(0.0, 1e3), min_size=2, max_size=20))
def test_pool_by_rms_is_the_root_of_the_mean_square(values):
    """Against NumPy's norm."""
    check, rows = rows_of(values, pooled="rms")
    expected = np.linalg.norm(values) / math.sqrt(len(values))
    assert check.pool(rows).measured == pytest.approx(expected, rel=1e-12, abs=1e-100)


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=20), st.sampled_from(["<=", ">="]))
def test_pool_by_worst_is_the_value_furthest_over_the_limit(values, sense):
    """The largest value of an upper limit, the smallest of a lower one."""
    check, rows = rows_of(values, sense=sense)
    assert check.pool(rows).measured == (max(values) if sense == "<=" else min(values))


def test_pool_by_count_counts_the_flights_that_pass():
    """Two of three flights fail the count."""
    check, rows = rows_of([1.0, 5.0, 2.0], pooled="count")
    pooled = check.pool(rows)
    assert (pooled.measured, pooled.limit, pooled.unit, pooled.passed) == (2, 3, "flights", False)
    assert check.pool(rows[::2]).passed


def test_pool_of_several_flights_uses_the_pooled_limit_and_of_one_its_own():
    """A single flight may be 1.5 times as bad as all flights together."""
    check, rows = rows_of([5.0, 5.0], pooled="rms", per_flight_limit=6.0)
    assert all(row.passed for row in rows)
    assert not check.pool(rows).passed
    assert check.pool(rows[:1]).passed


def test_pool_of_nothing_fails():
    """Without flights nothing passes."""
    for pooled in ("rms", "worst", "count"):
        assert not check_of(1.0, pooled=pooled).pool([]).passed


@pytest.mark.parametrize("per_flight", [3.9, LOOSEST * 4.0 + 0.1])
def test_check_with_a_per_flight_limit_out_of_bounds_is_refused(per_flight):
    """Neither tighter than the pooled limit nor more than 1.5 times as loose."""
    with pytest.raises(ValueError, match=r"per_flight_limit .* must be between"):
        check_of(1.0, per_flight_limit=per_flight)
    with pytest.raises(ValueError, match=r"per_flight_limit"):
        check_of(1.0, sense=">=", per_flight_limit=4.1)


def test_check_without_a_finite_limit_is_refused():
    """An infinite limit would always pass."""
    with pytest.raises(ValueError, match="must be a finite number"):
        check_of(1.0, limit=math.inf)


def ramp(flight):
    """A series that falls from 10 to 0 over 10 s, at 10 Hz."""
    t_s = np.arange(1, 101) * flight.dt_s
    return Series(t_s, 10.0 - t_s, np.ones(100, np.bool_))


RAMP = Flight(Log.empty(1), 0.1, 0.0, Outcome.COMPLETED, "course", manifest={"config": {"duration_s": 10.0}})


@pytest.mark.parametrize(
    ("check", "measured", "sense", "limit"),
    [
        (Check.highest("x", "m", ramp, 7.0, at(4.0)), 5.9, "<=", 7.0),
        (Check.lowest("x", "m", ramp, 3.0, at(4.0), at(6.0)), 4.0, ">=", 3.0),
        (Check.settling("x", ramp, 2.5, 9.0, at(1.0)), 6.4, "<=", 9.0),
        (Check.rms("x", "m", ramp, 4.0, at(9.0)), math.sqrt(0.285), "<=", 6.0),
        (Check.rms("x", "m", ramp, 4.0, at(9.0), per_flight_limit=5.0), math.sqrt(0.285), "<=", 5.0),
    ],
)
def test_constructors_reduce_a_series_over_their_window(check, measured, sense, limit):
    """Extremes, RMS and settling time of a ramp in closed form; settling is below 2.5 from 7.5 s on."""
    row = check.judge(RAMP)
    assert row.measured == pytest.approx(measured, rel=0, abs=1e-9)
    assert (row.sense, row.limit, row.passed) == (sense, limit, True)


def test_rms_constructor_allows_a_flight_one_and_a_half_times_the_pooled_limit():
    """Unless its own limit is given; pooled as the root of the mean square."""
    check = Check.rms("x", "m", ramp, 4.0)
    assert (check.limit, check.per_flight_limit, check.pooled) == (4.0, 6.0, "rms")
    assert not Check.rms("x", "m", ramp, 4.0, at(9.0), at(12.0)).judge(RAMP).passed  # it ends at 10 s


def test_limited_changes_the_limit_and_scales_that_of_a_flight():
    """Everything else stays as it is."""
    check = Check.rms("x", "m", ramp, 4.0, per_flight_limit=5.0).limited(8.0)
    assert (check.limit, check.per_flight_limit) == (8.0, 10.0)
    assert check.judge(RAMP).measured == Check.rms("x", "m", ramp, 4.0).judge(RAMP).measured
    assert Check.highest("x", "m", ramp, 7.0).limited(9.0).per_flight_limit is None


@pytest.mark.parametrize("outcome", list(Outcome))
def test_survived_passes_completed_flights_only(outcome):
    """Ground contact, a failed estimator and an interrupted flight all fail."""
    flight = Flight(Log.empty(1), 0.02, 0.0, outcome, "course")
    assert SURVIVED.judge(flight).passed is (outcome == Outcome.COMPLETED)
