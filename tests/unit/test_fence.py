"""The geofence: accepted values, which autopilots receive it, and single ticks."""

import math

import numpy as np
import pytest

from autopilot.dcm import DcmAutopilot
from autopilot.fence import FenceAction, FenceParams
from autopilot.interface import Mode, Setpoint
from estimator.interface import MEASURED_DTYPE, AttitudeEstimate, Measurements
from scenarios.harness.config import FlightConfig, override
from scenarios.harness.flight import prepare

OUT = Setpoint(Mode.COURSE, height_m=60.0)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"fence.radius_m": 20}, "fence.radius_m"),
        ({"fence.radius_m": "wide"}, "fence.radius_m"),
        ({"fence.height_m": 30}, "fence.height_m"),
        ({"fence.radius_m": 200, "fence.action": "land"}, "fence.action"),
        ({"fence.action": "glide"}, "there is no fence; set radius_m or height_m too"),
        ({"fence.radius_m": 3000}, "fence.radius_m = 3000 m: must be less than box_radius_m, 3000 m"),
        ({"fence.height_m": 1000}, "fence.height_m = 1000 m: must be less than box_height_m, 1000 m"),
        ({"fence.radius": 200}, "fence.radius_m"),
    ],
)
def test_fence_of_nonsense_is_refused_in_one_line(changes, said):
    """With the name of the field, and what would be right."""
    with pytest.raises(ValueError, match="fence") as refused:
        override(FlightConfig(), changes)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("changes", [{"radius_m": 10.0}, {"height_m": math.nan}, {"action": 7.0}])
def test_fence_parameters_of_nonsense_are_refused(changes):
    """Also where no configuration has looked at them."""
    with pytest.raises(ValueError, match=f"fence.{next(iter(changes))}"):
        FenceParams(**changes)


def test_fence_with_an_autopilot_that_knows_none_is_refused(tmp_path):
    """It would fly through it; a fence that is only reported is nobody's business but the report's."""
    (tmp_path / "straight.py").write_text(
        "class Straight:\n    def update(self, estimate, m, setpoint):\n        pass\n"
    )
    autopilot = {"autopilot": f"{tmp_path / 'straight.py'}:Straight", "fence.radius_m": 200.0}
    with pytest.raises(ValueError, match="has no argument 'fence' and would fly through it"):
        prepare("crosswind", autopilot)
    prepare("crosswind", autopilot | {"fence.action": "report"})


def test_fence_reaches_the_autopilot():
    """As its parameters, with the limits that were set and no others."""
    prepared = prepare("crosswind", {"fence.radius_m": "200", "fence.action": "loiter"})
    fence = prepared.autopilot.code.params.fence
    assert (fence.radius_m, fence.height_m, fence.action) == (200.0, math.inf, FenceAction.LOITER)


def mode_at(autopilot, north_m, *, height_m=60.0, v_m_s=(0.0, 0.0, 0.0), setpoint=OUT, gps=True):
    """The mode after one tick with a fix there; `gps` False is a tick without one."""
    row = np.zeros(1, MEASURED_DTYPE)
    row["dt_s"], row["force_b_m_s2"] = 0.02, (0.0, 0.0, -9.8)
    if gps:
        row["gps_new"] = row["gps_valid"] = 1
        row["gps_p_e_m"], row["gps_v_e_m_s"] = (north_m, 0.0, -height_m), v_m_s
    return autopilot.update(AttitudeEstimate(np.eye(3)), Measurements(row, 0), setpoint).mode


def fenced(**fence):
    return DcmAutopilot(fence=FenceParams(**{"radius_m": 300.0} | fence))


def test_fence_acts_ahead_by_the_outward_velocity_alone():
    """4 s at 12 m/s outwards, plus the second by which the fix is late: at 235 m not yet, at 245 m already."""
    v = (12.0, 0.0, 0.0)
    assert mode_at(fenced(), 235.0, v_m_s=v) == Mode.COURSE
    assert mode_at(fenced(), 245.0, v_m_s=v) == Mode.RETURN
    assert mode_at(fenced(), 280.0, v_m_s=(0.0, 12.0, 0.0)) == Mode.COURSE  # along it
    assert mode_at(fenced(), 290.0, v_m_s=(-12.0, 0.0, 0.0)) == Mode.COURSE  # towards home
    assert mode_at(fenced(), -245.0, v_m_s=(-12.0, 0.0, 0.0)) == Mode.RETURN  # on the other side


def test_fence_acts_earlier_with_the_wind_behind():
    """At 18.9 m/s over the ground, 1.5 times cruise, it looks 1.5 times as long ahead."""
    reach_m = 18.9 * (4.0 * 1.5 + 1.0)
    assert mode_at(fenced(), 300.0 - reach_m - 3.0, v_m_s=(18.9, 0.0, 0.0)) == Mode.COURSE
    assert mode_at(fenced(), 300.0 - reach_m + 3.0, v_m_s=(18.9, 0.0, 0.0)) == Mode.RETURN


def test_fence_is_released_well_inside():
    """80 m inside, not before; half the radius of a small fence."""
    autopilot = fenced()
    expected = ((310.0, Mode.RETURN), (230.0, Mode.RETURN), (215.0, Mode.COURSE), (290.0, Mode.COURSE))
    for north_m, mode in expected:
        assert mode_at(autopilot, north_m) == mode
    small = fenced(radius_m=60.0)
    assert [mode_at(small, x) for x in (70.0, 35.0, 25.0)] == [Mode.RETURN, Mode.RETURN, Mode.COURSE]


@pytest.mark.parametrize(("action", "mode"), [(FenceAction.LOITER, Mode.LOITER), (FenceAction.GLIDE, Mode.GLIDE)])
def test_fence_loiter_and_glide_last_until_another_setpoint(action, mode):
    """Inside again, they go on; another setpoint ends them, the same one once more does not."""
    autopilot = fenced(action=action)
    assert [mode_at(autopilot, x) for x in (310.0, 100.0, 10.0)] == [mode] * 3
    assert mode_at(autopilot, 10.0, setpoint=Setpoint(Mode.COURSE, height_m=60.0)) == mode
    assert mode_at(autopilot, 10.0, setpoint=Setpoint(Mode.COURSE, height_m=70.0)) == Mode.COURSE


@pytest.mark.parametrize("mode", [m for m in Mode if m <= Mode.WAYPOINTS and m != Mode.LAUNCH])
def test_fence_overrides_all_but_sticks_and_return(mode):
    """MANUAL and RATE belong to the pilot; RETURN is on its way home already."""
    setpoint = Setpoint(mode, route=((0.0, 0.0, 60.0),), height_m=60.0)
    kept = mode in (Mode.MANUAL, Mode.RATE, Mode.RETURN)
    assert mode_at(fenced(), 350.0, setpoint=setpoint) == (mode if kept else Mode.RETURN)


def test_fence_ends_the_climb_of_a_launch_above_a_safe_height():
    """In the hand and low above the ground it goes on; at 40 m it turns back."""
    autopilot, launch = fenced(), Setpoint(Mode.LAUNCH, height_m=100.0)
    assert mode_at(autopilot, 350.0, height_m=40.0, setpoint=launch) == Mode.LAUNCH
    autopilot._memory["s"]["thrown_s"] = 1.0
    assert mode_at(autopilot, 350.0, height_m=20.0, setpoint=launch) == Mode.LAUNCH
    assert mode_at(autopilot, 350.0, height_m=40.0, setpoint=launch) == Mode.RETURN


def test_fence_ceiling_returns_and_is_released_below():
    """Above it, or about to be within 4 s."""
    autopilot = fenced(radius_m=math.inf, height_m=100.0)
    assert mode_at(autopilot, 0.0, height_m=98.0) == Mode.COURSE
    assert mode_at(autopilot, 200.0, height_m=101.0) == Mode.RETURN
    assert mode_at(autopilot, 200.0, height_m=96.0) == Mode.RETURN
    assert mode_at(autopilot, 200.0, height_m=94.0) == Mode.COURSE
    assert mode_at(autopilot, 200.0, height_m=88.0, v_m_s=(0.0, 0.0, -3.0)) == Mode.RETURN


def test_fence_without_a_position_is_none():
    """Before the first fix, and with the GPS lost."""
    assert mode_at(fenced(), 0.0, gps=False) == Mode.COURSE


def test_fence_report_and_no_fence_leave_the_autopilot_alone():
    """10 km out."""
    assert mode_at(fenced(action=FenceAction.REPORT), 1e4) == Mode.COURSE
    assert mode_at(DcmAutopilot(), 1e4) == Mode.COURSE
