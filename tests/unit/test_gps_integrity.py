"""Fixes that cannot be true: what is refused, how soon, and what is not."""

import numpy as np
import pytest

from autopilot.fixes import take_in
from estimator.blocks.gps_integrity import WATCH, fix_is_sound
from estimator.compiler.jit import kernel
from estimator.interface import MEASURED_DTYPE, dtype_of

STATE, SEEN = dtype_of(WATCH), np.dtype([("fix_held_back", "i8"), *dtype_of(WATCH).descr], align=True)
SPEED_M_S, RADIUS_M = 13.0, 60.0
TURN_RAD_S = SPEED_M_S / RADIUS_M
FROM_S = 20.0  # of each fault


@kernel
def _watch(rows, turn_rad_s, state, sound, lost):  # type: ignore[no-untyped-def]
    for k in range(rows.shape[0]):
        sound[k] = fix_is_sound(rows[k], turn_rad_s[k], state[0])
        lost[k] = state[0].gps_lost


def watched(rows, turn_rad_s=0.0):
    """Whether each fix is sound, and whether the GPS is lost then."""
    sound, lost = np.zeros(len(rows), bool), np.zeros(len(rows), bool)
    _watch(rows, np.broadcast_to(turn_rad_s, len(rows)).astype(float), np.zeros(1, STATE), sound, lost)
    return sound, lost


def circle(hz=4.0, seconds=60.0, *, turn_rad_s=TURN_RAD_S, speed_m_s=SPEED_M_S, wind_m_s=4.0, noise=1.0, stamped=True):
    """Fixes of a circle in wind, or of straight flight, with the noise of a cheap receiver."""
    rng = np.random.default_rng(round(10 * hz))
    t = np.arange(1.0, seconds, 1.0 / hz)
    rows = np.zeros(len(t), MEASURED_DTYPE)
    rows["t_s"], rows["gps_new"], rows["gps_valid"] = t + 0.3, 1, 1
    rows["gps_t_s"] = t if stamped else np.nan
    angle = turn_rad_s * t
    v = np.stack([speed_m_s * np.cos(angle) + wind_m_s, speed_m_s * np.sin(angle), 0.0 * t], axis=1)
    if turn_rad_s:
        radius = speed_m_s / turn_rad_s
        p = np.stack([radius * np.sin(angle) + wind_m_s * t, radius * (1.0 - np.cos(angle)), 0.0 * t - 80.0], axis=1)
    else:
        p = np.stack([(speed_m_s + wind_m_s) * t, 0.0 * t, 0.0 * t - 80.0], axis=1)
    wander = np.cumsum(0.3 * np.sqrt(1.0 / hz) * rng.standard_normal(p.shape), axis=0)
    rows["gps_p_e_m"] = p + noise * (wander + 0.3 * rng.standard_normal(p.shape))
    return with_velocity(rows, v + noise * 0.1 * rng.standard_normal(v.shape))


def with_velocity(rows, v_e_m_s):
    """The rows with that velocity, course and speed."""
    rows["gps_v_e_m_s"] = v_e_m_s
    rows["gps_course_rad"] = np.arctan2(v_e_m_s[:, 1], v_e_m_s[:, 0]) % (2.0 * np.pi)
    rows["gps_speed_m_s"] = np.hypot(v_e_m_s[:, 0], v_e_m_s[:, 1])
    return rows


def spoilt(rows, kind, from_s=FROM_S, to_s=40.0):
    """The rows with a fault from `from_s` to `to_s`, and which of them have it."""
    rows = rows.copy()
    hit = (rows["t_s"] >= from_s) & (rows["t_s"] < to_s)
    last = rows[np.flatnonzero(hit)[0] - 1]
    if kind in ("stuck", "frozen_position"):
        rows["gps_p_e_m"][hit] = last["gps_p_e_m"]
    v = rows["gps_v_e_m_s"].copy()
    if kind in ("stuck", "frozen_velocity"):
        v[hit] = last["gps_v_e_m_s"]
    elif kind == "frozen_course":
        speed, course = rows["gps_speed_m_s"][hit], last["gps_course_rad"]
        v[hit] = np.stack([speed * np.cos(course), speed * np.sin(course), v[hit, 2]], axis=1)
    elif kind == "whole_degrees":
        speed, course = rows["gps_speed_m_s"][hit], np.radians(np.round(np.degrees(rows["gps_course_rad"][hit])))
        v[hit] = np.stack([speed * np.cos(course), speed * np.sin(course), v[hit, 2]], axis=1)
    elif kind == "jump":
        rows["gps_p_e_m"][hit, 0] += 50.0
    elif kind == "drift":
        v[hit, 1] += 1.0
        rows["gps_p_e_m"][hit, 1] += rows["t_s"][hit] - from_s
    return with_velocity(rows, v), hit


HZ = (1.0, 2.0, 4.0, 5.0, 10.0)


@pytest.mark.parametrize("hz", HZ)
@pytest.mark.parametrize("kind", ["stuck", "frozen_position", "frozen_velocity", "frozen_course", "jump"])
@pytest.mark.parametrize("stamped", [True, False], ids=["stamped", "unstamped"])
def test_fault_in_a_circle_is_a_lost_gps_within_3_s_and_over_2_s_after_it(hz, kind, stamped):
    """At every rate; no fix is refused before, and all are sound again after two seconds of consistent ones."""
    rows, hit = spoilt(circle(hz, stamped=stamped), kind)
    sound, lost = watched(rows, TURN_RAD_S)
    t = rows["t_s"]
    assert sound[t < FROM_S].all()
    first_s = t[lost][0]
    assert first_s - t[hit][0] <= 3.0
    if kind != "jump":  # those that follow are consistent with each other
        assert not sound[hit & (t > first_s)].any()
    end_s = t[hit][-1]
    back_s = 4.0 if kind == "jump" else 2.0  # it jumps back, which takes two seconds to be believed
    assert sound[t > end_s + back_s + 2.0 / hz + 1e-6].all()


@pytest.mark.parametrize("hz", HZ)
@pytest.mark.parametrize("kind", ["none", "whole_degrees", "drift"])
@pytest.mark.parametrize("turn_rad_s", [0.0, TURN_RAD_S, -1.2], ids=["straight", "circle", "steep"])
def test_no_fix_is_refused_of_a_sound_receiver_or_one_that_is_led_astray(hz, kind, turn_rad_s):
    """In straight flight and turns of up to 70 deg/s; a drift with its velocity to match cannot be seen."""
    rows, _ = spoilt(circle(hz, 300.0, turn_rad_s=turn_rad_s), kind, 30.0, 250.0)
    sound, _ = watched(rows, turn_rad_s)
    if kind == "drift":  # it ends with a jump back, which is one
        sound = sound[rows["t_s"] < 250.0]
    if kind == "whole_degrees":  # a course may repeat for one fix of a turn
        assert np.count_nonzero(~sound) <= 0.002 * len(sound)
    else:
        assert sound.all()


@pytest.mark.parametrize("hz", HZ)
def test_spike_costs_its_own_fix_alone(hz):
    """30 m off for one fix; the next is compared with the one before."""
    rows = circle(hz)
    k = len(rows) // 2
    rows["gps_p_e_m"][k] += [21.0, -21.0, 0.0]
    sound, lost = watched(rows, TURN_RAD_S)
    assert np.flatnonzero(~sound).tolist() == [k]
    assert not lost.any()


def test_frozen_course_in_straight_flight_is_not_seen_until_it_turns():
    """It does no harm before."""
    straight, turn = circle(seconds=30.0, turn_rad_s=0.0), circle(seconds=30.0)
    turn["t_s"] += 29.0
    turn["gps_t_s"] += 29.0
    turn["gps_p_e_m"] += straight["gps_p_e_m"][-1] - turn["gps_p_e_m"][0] + [17.0 / 4.0, 0.0, 0.0]
    rows, _ = spoilt(np.concatenate([straight, turn]), "frozen_course", 10.0, 99.0)
    rate = np.where(np.arange(len(rows)) < len(straight), 0.0, TURN_RAD_S)
    sound, lost = watched(rows, rate)
    assert sound[: len(straight)].all()
    assert 0.5 < rows["t_s"][lost][0] - turn["t_s"][0] <= 3.0


def test_receiver_at_rest_that_holds_its_position_is_not_frozen():
    """Identical fixes at a speed of exactly zero, then a throw, and position and velocity that catch up at once."""
    rows = circle(5.0)
    rest = rows["t_s"] < 30.0
    rows["gps_p_e_m"][rest] = [3.0, -2.0, 1.0]
    v = rows["gps_v_e_m_s"].copy()
    v[rest] = 0.0
    sound, _ = watched(with_velocity(rows, v))
    assert sound.all()


def test_slow_fix_that_repeats_is_frozen_after_two_seconds():
    """Hovering against the wind at 0.2 m/s: the distance says nothing, the bits do."""
    rows = circle(4.0, 30.0, turn_rad_s=0.0, speed_m_s=4.2, wind_m_s=-4.0, noise=0.1)
    frozen, hit = spoilt(rows, "stuck", 15.0, 25.0)
    sound, lost = watched(frozen)
    assert 1.7 <= frozen["t_s"][lost][0] - frozen["t_s"][hit][0] <= 2.3
    assert sound[~hit & (frozen["t_s"] < 20.0)].all()


def test_nothing_is_checked_without_positions_or_numbers():
    """A log that has only velocities, a velocity given as course and speed, and NaN, which others refuse."""
    rows = circle()
    without = rows.copy()
    without["gps_p_e_m"] = 0.0
    polar = rows.copy()
    polar["gps_v_e_m_s"] = 0.0
    numbers = rows.copy()
    numbers["gps_p_e_m"][::7] = np.nan
    numbers["gps_v_e_m_s"][3::11] = np.inf
    for each in (without, polar, numbers):
        assert watched(each)[0].all()


def test_silence_begins_the_comparison_again():
    """After an outage of 5 s in a turn there is nothing to compare with; a jump after that is seen again."""
    rows = circle(4.0)
    rows = rows[(rows["t_s"] < 20.0) | (rows["t_s"] > 25.0)]
    rows["gps_p_e_m"][rows["t_s"] > 25.0] += 100.0
    rows["gps_p_e_m"][rows["t_s"] > 40.0] += 100.0
    sound, lost = watched(rows, TURN_RAD_S)
    assert sound[rows["t_s"] < 40.0].all()
    assert lost.any()


@kernel
def _take_in(row, turn_rad_s, seen, state):  # type: ignore[no-untyped-def]
    take_in(row[0], turn_rad_s, seen[0], state[0])


def test_autopilot_sees_every_column_except_a_fix_that_cannot_be_true():
    """The last sound fix stays, its time stamp with it; all other columns are those of the tick."""
    row, seen, state = np.zeros(1, MEASURED_DTYPE), np.zeros(1, MEASURED_DTYPE), np.zeros(1, SEEN)
    fixes = spoilt(circle(), "jump")[0]
    rng = np.random.default_rng(1)
    of_gps = [name for name in MEASURED_DTYPE.names if name.startswith("gps_")]
    sound = None
    for k in range(int(FROM_S * 4)):
        for name in MEASURED_DTYPE.names:
            row[name] = fixes[name][k] if name in (*of_gps, "t_s") else 1 + rng.integers(9, size=row[name].shape)
        held_back = fixes["t_s"][k] >= FROM_S
        _take_in(row, TURN_RAD_S, seen, state)
        for name in MEASURED_DTYPE.names:
            if not (held_back and name in of_gps):
                np.testing.assert_array_equal(seen[name], row[name], err_msg=name)
        if held_back:
            assert seen["gps_new"][0] == 0
            for name in set(of_gps) - {"gps_new"}:
                np.testing.assert_array_equal(seen[name][0], sound[name][0], err_msg=name)
        else:
            sound = seen.copy()
    assert held_back


@pytest.mark.parametrize("hz", HZ)
def test_offset_of_the_gyros_in_perfect_straight_flight_is_no_frozen_course(hz):
    """A course without noise repeats to the last bit; the gyros see a turn of 3 deg/s that is none."""
    sound, lost = watched(circle(hz, turn_rad_s=0.0, noise=0.0), np.radians(3.0))
    assert sound.all()
    assert not lost.any()
