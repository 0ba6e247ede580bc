"""The figures of the scripted pilot: how long they last, and the attitude that their rates amount to."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from autopilot.figures import (
    RunIn,
    aileron_roll,
    immelmann,
    inside_loops,
    inverted_circuit,
    outside_loops,
    spin,
    split_s,
    stall_turn,
    vertical_climb,
)
from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Manoeuvre, Script

AFTER = Setpoint(Mode.COURSE, course_rad=1.0)
FAST, SLOW = math.radians(120.0), math.radians(45.0)
UP, DOWN = RunIn(2.0, math.radians(15.0), 0.7), RunIn(2.5, math.radians(-20.0), 1.0)
ROUND_OFF = 1e-12  # radians, seconds: sums of a handful of numbers of order 1 to 10
NORTH_EAST = math.radians(40.0)

FIGURES: dict[str, Callable[..., Manoeuvre]] = {
    "inside_loops": lambda **k: inside_loops(10.0, 3, AFTER, **k),
    "outside_loops": lambda **k: outside_loops(10.0, 1, AFTER, **k),
    "aileron_roll": lambda **k: aileron_roll(10.0, 1, AFTER, **k),
    "immelmann": lambda **k: immelmann(10.0, AFTER, **k),
    "split_s": lambda **k: split_s(10.0, AFTER, **k),
    "vertical_climb": lambda **k: vertical_climb(10.0, 1.0, AFTER, **k),
    "stall_turn": lambda **k: stall_turn(10.0, 1.0, AFTER, **k),
    "spin": lambda **k: spin(10.0, 5.0, AFTER, **k),
}


def flown(figure: Manoeuvre, until: int = -1) -> Rotation:
    """Attitude after the set-points before number `until`, followed exactly from a north-easterly heading.

    The run-in is a pitch, wings level; each set-point after it turns about the body's own axes.
    """
    *steps, _ = figure.timed[: None if until == -1 else until + 1]
    attitude = Rotation.from_euler("ZY", [NORTH_EAST, steps[0].setpoint.pitch_rad])
    for step, after in zip(steps[1:], figure.timed[2:], strict=False):
        assert step.setpoint.mode == Mode.RATE
        attitude *= Rotation.from_rotvec(np.array(step.setpoint.rate_b_rad_s) * (after.t_s - step.t_s))
    return attitude


def assert_same(attitude: Rotation, expected: Rotation) -> None:
    """The angle between the two is round-off of angles up to 20 rad."""
    assert (attitude.inv() * expected).magnitude() < 1e-7  # the magnitude is a square root of round-off


LASTS = {
    "inside_loops": (inside_loops, 2, {"pitch_rate_rad_s": FAST}, 2.5 + 4.0 * math.pi / FAST),
    "outside_loops": (outside_loops, 1, {"pitch_rate_rad_s": SLOW}, 2.5 + 2.0 * math.pi / SLOW),
    "aileron_roll": (aileron_roll, 1.5, {"roll_rate_rad_s": FAST}, 2.5 + 3.0 * math.pi / FAST),
}


@pytest.mark.parametrize("figure", LASTS)
def test_turns_last_as_long_as_the_rate_takes_for_them(figure):
    """Run-in and angle over rate, from whenever they begin."""
    build, turns, rates, lasts_s = LASTS[figure]
    assert build(7.0, turns, AFTER, run_in=DOWN, **rates).ends_s - 7.0 == pytest.approx(lasts_s, rel=0, abs=ROUND_OFF)


def test_figures_of_several_parts_last_as_long_as_their_parts():
    """The closed forms of the docstrings, worked out from pitch, rates and times."""
    dive_rad = math.radians(-20.0)
    rates = {"pitch_rate_rad_s": FAST, "roll_rate_rad_s": SLOW}
    lasts_s = {
        immelmann(0.0, AFTER, run_in=DOWN, **rates): 2.5 + (math.pi - dive_rad) / FAST + math.pi / SLOW,
        split_s(0.0, AFTER, run_in=DOWN, **rates): 2.5 + math.pi / SLOW + (math.pi + dive_rad) / FAST,
        vertical_climb(0.0, 1.7, AFTER, pitch_rate_rad_s=FAST, run_in=DOWN): (2.5 + (math.pi - dive_rad) / FAST + 1.7),
        stall_turn(0.0, 1.7, AFTER, pitch_rate_rad_s=FAST, over_s=1.1, dive_s=0.3, run_in=DOWN): (
            2.5 + (math.pi - dive_rad) / FAST + 1.7 + 1.1 + 0.3
        ),
        spin(0.0, 5.0, AFTER, recovery_s=0.4, run_in=UP): 2.0 + 5.0 + 0.4,
    }
    for figure, expected_s in lasts_s.items():
        assert figure.ends_s == pytest.approx(expected_s, rel=0, abs=ROUND_OFF)


@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_begins_with_its_run_in_and_ends_with_what_follows(name):
    """A script of it is in order, holds the run-in first and `after` from the end on."""
    figure = FIGURES[name](run_in=UP)
    script = Script(figure.timed)
    first = script.at(10.0)
    assert (first.mode, first.pitch_rad, first.throttle, first.bank_rad) == (Mode.STABILISE, *UP[1:], 0.0)
    assert script.at(11.9) is first
    assert script.at(12.1) is not first
    assert figure.timed[-1].t_s == figure.ends_s
    assert script.at(figure.ends_s + 1e-6) is AFTER


@pytest.mark.parametrize("turns", [1, 3])
@pytest.mark.parametrize("build", [inside_loops, outside_loops, aileron_roll])
def test_whole_turns_end_in_the_attitude_of_the_run_in(build, turns):
    """Loops and rolls are the identity."""
    figure = build(0.0, turns, AFTER, run_in=DOWN)
    assert_same(flown(figure), Rotation.from_euler("ZY", [NORTH_EAST, DOWN.pitch_rad]))


def test_loops_and_rolls_turn_the_way_they_are_called():
    """Inside is nose up, outside nose down; a roll to the right lowers the right wing."""
    assert inside_loops(0.0, 1, AFTER).timed[1].setpoint.rate_b_rad_s[1] > 0.0
    assert outside_loops(0.0, 1, AFTER).timed[1].setpoint.rate_b_rad_s[1] < 0.0
    for right in (True, False):
        quarter = flown(aileron_roll(0.0, 0.25, AFTER, right=right, run_in=RunIn())).as_matrix()
        assert quarter[2, 1] == pytest.approx(1.0 if right else -1.0, rel=0, abs=ROUND_OFF)


@pytest.mark.parametrize("build", [immelmann, split_s])
@pytest.mark.parametrize("run_in", [UP, DOWN])
def test_immelmann_and_split_s_end_level_upright_and_reversed(build, run_in):
    """Whatever the pitch that they begin with."""
    assert_same(flown(build(0.0, AFTER, run_in=run_in)), Rotation.from_euler("Z", NORTH_EAST + math.pi))


def test_immelmann_is_upside_down_at_its_top_and_split_s_before_its_half_loop():
    """What tells one from the other: the roll comes last, or first; the loop goes up, or down."""
    top = flown(immelmann(0.0, AFTER), until=2).as_matrix()
    rolled = flown(split_s(0.0, AFTER, run_in=RunIn()), until=2).as_matrix()
    for R in (top, rolled):
        assert R[2, 2] == pytest.approx(-1.0, rel=0, abs=ROUND_OFF)
    assert top[0, 0] == pytest.approx(-math.cos(NORTH_EAST), rel=0, abs=ROUND_OFF)
    assert rolled[0, 0] == pytest.approx(math.cos(NORTH_EAST), rel=0, abs=ROUND_OFF)
    assert split_s(0.0, AFTER).timed[2].setpoint.throttle == 0.0


def test_vertical_climb_points_straight_up_without_rates_then_is_level_again():
    """Pulled through the angle missing, held, pushed back."""
    figure = vertical_climb(0.0, 1.5, AFTER, run_in=DOWN)
    up = flown(figure, until=2).as_matrix()
    np.testing.assert_allclose(up[:, 0], [0.0, 0.0, -1.0], rtol=0, atol=ROUND_OFF)
    assert figure.timed[2].setpoint.rate_b_rad_s == (0.0, 0.0, 0.0)
    assert_same(flown(figure), Rotation.from_euler("Z", NORTH_EAST))
    steeper = vertical_climb(0.0, 1.5, AFTER, pull_to_rad=math.radians(100.0), run_in=DOWN)
    assert_same(flown(steeper), Rotation.from_euler("Z", NORTH_EAST))


@pytest.mark.parametrize("pull_to_deg", [90.0, 98.0])
@pytest.mark.parametrize("right", [True, False])
def test_stall_turn_whose_rudder_turns_it_by_half_a_turn_ends_level_upright_and_reversed(pull_to_deg, right):
    """Full rudder to the side asked for; given that it makes half a turn, the pull-out is of the right size."""
    figure = stall_turn(0.0, 1.0, AFTER, right=right, pull_to_rad=math.radians(pull_to_deg), run_in=DOWN)
    _, _, _, over, dive, pull, end = figure.timed
    assert (over.setpoint.mode, over.setpoint.rudder) == (Mode.MANUAL, 1.0 if right else -1.0)
    assert (over.setpoint.throttle, dive.setpoint.throttle) == (1.0, 0.0)
    out = np.array(pull.setpoint.rate_b_rad_s) * (end.t_s - pull.t_s)
    attitude = flown(figure, until=3) * Rotation.from_euler("z", math.pi) * Rotation.from_rotvec(out)
    assert_same(attitude, Rotation.from_euler("Z", NORTH_EAST + math.pi))


@pytest.mark.parametrize("right", [True, False])
def test_spin_puts_the_sticks_in_the_corner_then_recovers_by_the_book(right):
    """Power off, ailerons neutral, opposite rudder, elevator forward: in manual control, no autopilot in between."""
    figure = spin(0.0, 5.0, AFTER, right=right, throttle=0.5)
    stall, corner, recovery = (timed.setpoint for timed in figure.timed[:3])
    side = 1.0 if right else -1.0
    assert (stall.mode, stall.throttle) == (Mode.STABILISE, 0.0)
    assert (corner.mode, corner.elevator, corner.rudder, corner.throttle) == (Mode.MANUAL, 1.0, side, 0.5)
    assert (recovery.mode, recovery.aileron, recovery.rudder, recovery.throttle) == (Mode.MANUAL, 0.0, -side, 0.0)
    assert recovery.elevator < 0.0


def test_inverted_circuit_is_a_square_flown_upside_down():
    """Four courses, a right angle to the right of each other, all inverted; upright from the end on."""
    course = Setpoint(Mode.COURSE, course_rad=0.3, height_m=80.0)
    square = inverted_circuit(5.0, course, 4, 12.0, AFTER)
    assert square.ends_s == 5.0 + 4 * 12.0
    assert [timed.t_s for timed in square.timed] == [5.0, 17.0, 29.0, 41.0, 53.0]
    legs = [timed.setpoint for timed in square.timed[:-1]]
    assert all(leg.inverted and leg.mode == Mode.COURSE and leg.height_m == 80.0 for leg in legs)
    turns = np.diff([leg.course_rad for leg in legs])
    np.testing.assert_allclose(turns, math.pi / 2.0, rtol=0, atol=ROUND_OFF)
    assert square.timed[-1].setpoint is AFTER
    left = inverted_circuit(5.0, course, 3, 12.0, AFTER, turn_rad=-1.0)
    assert left.timed[1].setpoint.course_rad == pytest.approx(-0.7, rel=0, abs=ROUND_OFF)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: inside_loops(0.0, 0, AFTER), "inside_loops: count = 0 must be positive"),
        (lambda: outside_loops(0.0, 1, AFTER, pitch_rate_rad_s=-1.0), "outside_loops: pitch_rate_rad_s = -1.0"),
        (lambda: aileron_roll(0.0, math.nan, AFTER), "aileron_roll: turns = nan"),
        (lambda: aileron_roll(0.0, 1, AFTER, run_in=RunIn(0.0)), "run_in: lasts_s = 0.0"),
        (lambda: immelmann(0.0, AFTER, roll_rate_rad_s=math.inf), "immelmann: roll_rate_rad_s = inf"),
        (lambda: split_s(0.0, AFTER, pitch_rate_rad_s=0.0), "split_s: pitch_rate_rad_s = 0.0"),
        (lambda: vertical_climb(0.0, 0.0, AFTER), "vertical_climb: climb_s = 0.0"),
        (lambda: stall_turn(0.0, 1.0, AFTER, over_s=-2.0), "stall_turn: over_s = -2.0"),
        (lambda: spin(0.0, -1.0, AFTER), "spin: hold_s = -1.0"),
        (lambda: inverted_circuit(0.0, AFTER, 4, 0.0, AFTER), "inverted_circuit: leg_s = 0.0"),
        (lambda: inverted_circuit(0.0, Setpoint(Mode.RETURN), 4, 9.0, AFTER), "RETURN: must be of mode COURSE"),
        (lambda: spin(0.0, 5.0, AFTER, throttle=1.5), "Setpoint.throttle: 1.5"),
    ],
)
def test_figures_that_nobody_can_fly_are_refused_by_name(build, message):
    """One line: which figure, which argument, what it was."""
    with pytest.raises(ValueError, match=message):
        build()
