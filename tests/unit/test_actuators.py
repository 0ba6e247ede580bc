"""Faults of surfaces and motor: what each does to a command, and when."""

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.harness.config.faults import parse_fault
from sim.aeroplane.actuators import CHANNELS, PLACES, Actuators, kinds_of, play, slew

DT_S = 0.02
RELEASE_S = 1.0
COMMAND = (0.3, -0.2, 0.1, 0.6)


class Servos:
    """Stands for a model: places that the test sets, and what was written."""

    def __init__(self, aircraft="endurance", trims=(0.0, 0.0, 0.0)):
        self.folder, self.built = Path(aircraft), SimpleNamespace(trims=trims)
        self.places, self.jammed = dict.fromkeys(PLACES, 0.0), {}

    def getter(self, name):
        return lambda: self.places[name]

    def setter(self, name):
        return lambda value: self.jammed.__setitem__(name, value)


def moved(*faults, commands=None, servos=None, n=100, release_s=RELEASE_S):
    """What arrives in each of `n` ticks, (n, 4), servos that follow at once; `commands` (n, 4) or one for all."""
    servos = servos or Servos()
    actuators = Actuators(servos, [parse_fault(f) for f in faults], None, release_s, DT_S)
    commands = np.broadcast_to(COMMAND if commands is None else commands, (n, 4))
    arrived = []
    for k, command in enumerate(commands):
        arrived.append(actuators.move(k, tuple(command)))
        trims = (*servos.built.trims, 0.0)
        servos.places = {name: v + t for name, v, t in zip(PLACES, arrived[-1], trims, strict=True)}
    return np.array(arrived)


@given(st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=12), st.floats(0.01, 1.0))
def test_play_is_that_of_a_pin_in_a_slot(ends, width):
    """Oracle: the input moves in small steps, and carries the surface along while a wall of the slot touches it."""
    place, pin, walked = 0.0, 0.0, 0.0
    for end in ends:
        steps = np.linspace(walked, end, 400)[1:]
        for wall in steps:
            if wall - 0.5 * width > pin:
                pin = wall - 0.5 * width
            elif wall + 0.5 * width < pin:
                pin = wall + 0.5 * width
            walked = wall
        place = play(place, end, 0.5 * width)
        np.testing.assert_allclose(place, pin, rtol=0, atol=1e-12)
        assert abs(place - end) <= 0.5 * width + 1e-12


def test_slack_of_a_sine_lags_by_half_its_width_and_keeps_its_size():
    """Where the command rises the surface is half the play below it, where it falls as far above."""
    t_s = DT_S * np.arange(500)
    command = np.zeros((500, 4))
    command[:, 2] = 0.5 * np.sin(t_s)
    arrived = moved("rudder:slack=0.2@-9", commands=command, n=500)[:, 2]
    rising, falling = (t_s > 5.7) & (t_s < 7.5), (t_s > 2.6) & (t_s < 4.5)
    np.testing.assert_allclose(arrived[rising], command[rising, 2] - 0.1, rtol=0, atol=1e-12)
    np.testing.assert_allclose(arrived[falling], command[falling, 2] + 0.1, rtol=0, atol=1e-12)
    assert arrived.max() == pytest.approx(0.4, rel=0, abs=1e-4)


def test_slow_servo_takes_its_time():
    """From -0.5 to 0.5 at half a deflection a second: two seconds, along a straight line."""
    command = np.full((200, 4), -0.5)
    command[50:] = 0.5
    arrived = moved("elevator:slow=0.5@-9", commands=command, n=200)[:, 1]
    assert slew(0.0, 1.0, 0.3) == 0.3
    np.testing.assert_allclose(np.diff(arrived[50:149]), 0.01, rtol=0, atol=1e-12)
    np.testing.assert_allclose(arrived[149:], 0.5, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("fault", "channel", "expected"),
    [
        ("aileron:reversed@0-1", 0, -0.3),
        ("elevator:reversed@0-1", 1, 0.2),
        ("rudder:lost@0-1", 2, 0.0),
        ("elevator:stuck=0.5@0-1", 1, 0.5),
        ("motor:dead@0-1", 3, 0.0),
        ("motor:weak=0.5@0-1", 3, 0.3),
        ("motor:stuck=1@0-1", 3, 1.0),
    ],
)
def test_fault_acts_on_its_own_channel_in_its_window(fault, channel, expected):
    """From the tick that begins at the release to the one that begins a second later; the others as commanded."""
    arrived = moved(fault, n=150)
    inside = np.zeros(150, bool)
    inside[50:100] = True
    np.testing.assert_array_equal(arrived[inside, channel], expected)
    np.testing.assert_array_equal(arrived[~inside, channel], COMMAND[channel])
    others = [c for c in range(4) if c != channel]
    np.testing.assert_array_equal(arrived[:, others], np.broadcast_to(COMMAND, (150, 4))[:, others])


def test_stuck_without_a_value_jams_the_servo_and_frees_it():
    """The model's own servo stops where it is, also for two windows that touch."""
    servos = Servos()
    stuck = "fcs/aileron-servo/malfunction/fail_stuck"
    actuators = Actuators(
        servos, [parse_fault(f) for f in ("aileron:stuck@0-0.1", "aileron:stuck@0.1-0.2")], None, RELEASE_S, DT_S
    )
    seen = []
    for k in range(80):
        actuators.move(k, COMMAND)
        seen.append(servos.jammed.get(stuck, 0.0))
    np.testing.assert_array_equal(np.flatnonzero(seen), np.arange(50, 60))
    assert servos.jammed.get("fcs/elevator-servo/malfunction/fail_stuck", 0.0) == 0.0


def test_trim_of_the_aeroplane_is_part_of_a_deflection():
    """A surface with its neutral off stands at the value of the fault, and off the linkage at none."""
    trims = (0.1, 0.05, -0.1)
    for fault, channel, deflection in (("aileron:stuck=0.3@-9", 0, 0.3), ("rudder:lost@-9", 2, 0.0)):
        arrived = moved(fault, servos=Servos(trims=trims))
        np.testing.assert_allclose(arrived[:, channel] + trims[channel], deflection, rtol=0, atol=1e-15)
    held = Servos(trims=trims)
    held.places["servo/elevator"] = -0.15  # what the command -0.2 makes of it
    slow = moved("elevator:slow=0.5@-9", servos=held)
    np.testing.assert_allclose(slow[:, 1], -0.2, rtol=0, atol=1e-15)


def test_faults_of_one_channel_act_in_order():
    """A reversed servo that is slow as well; a weak motor that is dead for a while."""
    arrived = moved("aileron:reversed@0", "aileron:slow=0.5@0", n=200)
    np.testing.assert_allclose(arrived[52, 0], 0.3 - 3 * 0.01, rtol=0, atol=1e-12)
    np.testing.assert_allclose(arrived[-1, 0], -0.3, rtol=0, atol=1e-12)
    assert set(moved("motor:weak=0.5@0", "motor:dead@0.5-1", n=120)[:, 3]) == {0.6, 0.3, 0.0}


def test_every_kind_is_known_to_the_kernel_of_the_fault():
    """No kind passes its command on unchanged."""
    for channel in CHANNELS:
        for kind in kinds_of(channel):
            servos = Servos()
            servos.places = dict.fromkeys(PLACES, 0.9)
            fault = parse_fault(f"{channel}:{kind}@-9")
            arrived = Actuators(servos, [fault], None, RELEASE_S, DT_S).move(0, (0.3, 0.3, 0.3, 0.3))
            assert arrived[CHANNELS.index(channel)] != 0.3, fault


def test_actuators_refuse_what_the_aeroplane_does_not_have():
    """Also where no configuration was checked."""
    with pytest.raises(ValueError, match="gentle_lady has no aileron; it has elevator, rudder"):
        Actuators(Servos("gentle_lady"), [parse_fault("aileron:lost@3")], None, 0.0, DT_S)
    assert math.isinf(parse_fault("motor:dead@30-").to_s)
