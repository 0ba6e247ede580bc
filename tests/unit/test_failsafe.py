"""The mode in force: each failsafe taken, held and handed back, one tick at a time."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from autopilot.airframes import params_of
from autopilot.dcm import DcmAutopilot
from autopilot.energy import EnergyParams
from autopilot.failsafe import FailsafeParams
from autopilot.interface import Mode, Setpoint, Waypoint
from estimator.interface import MEASURED_DTYPE, AttitudeEstimate, Health, Measurements

P, DT_S = FailsafeParams(), 0.02
ROUTE = (Waypoint(300, 0, 60), Waypoint(300, 300, 60), Waypoint(0, 300, 60))
BY_POSITION = (Mode.COURSE, Mode.RETURN, Mode.LOITER, Mode.WAYPOINTS)
OTHERS = (Mode.MANUAL, Mode.RATE, Mode.STABILISE)


def asking(mode, **others):
    return Setpoint(mode, route=ROUTE, **others)


class Aboard:
    """An autopilot and the measurements it is shown, tick after tick."""

    def __init__(self, aircraft="endurance"):
        params = params_of(aircraft)
        still = replace(params.lift, incidence_per_elevator_rad=0.0)  # it does not move: the elevator tells no speed
        self.autopilot, self.row = DcmAutopilot(replace(params, lift=still)), np.zeros(1, MEASURED_DTYPE)
        self.row["dt_s"], self.row["force_b_m_s2"] = DT_S, (0.0, 0.0, -9.8)
        self.ticks, self.height_m, self.latency_s, self.numbers, self.ground_m_s = 0, 60.0, 0.3, True, 12.0
        self.dt_s = DT_S
        self.north_m = 200.0  # of the last fix, moved by the velocity that it reports

    def fly(self, setpoint, seconds, *, gps=True, estimate=None):
        """Commands of so many seconds; a fix every 0.2 s where there is a GPS."""
        commands = []
        for _ in range(round(seconds / self.dt_s)):
            self.north_m += self.dt_s * self.ground_m_s
            self.row["t_s"], self.row["dt_s"] = self.ticks * self.dt_s, self.dt_s
            self.row["gps_new"] = gps and self.ticks % round(0.2 / self.dt_s) == 0
            if self.row["gps_new"][0]:
                self.row["gps_valid"], self.row["gps_t_s"] = 1, self.row["t_s"] - self.latency_s
                self.row["gps_p_e_m"] = (self.north_m, 0.0, -self.height_m) if self.numbers else math.nan
                self.row["gps_v_e_m_s"] = (self.ground_m_s, 0.0, 0.0)
            self.row["force_b_m_s2"] += 1e-9 * (-1) ** self.ticks  # frozen is what never changes
            measured = Measurements(self.row.copy(), 0)
            commands.append(self.autopilot.update(estimate or AttitudeEstimate(np.eye(3)), measured, setpoint))
            self.ticks += 1
        return commands

    @property
    def learnt_rad(self):
        """The pitch error that the height loop has learnt."""
        return self.autopilot.snapshot().memory["s"]["climb_integral_rad"][0]

    def modes(self, *args, **others):
        """The modes in force, each with how long it was, s."""
        found = []
        for command in self.fly(*args, **others):
            if found and found[-1][0] == command.mode:
                found[-1][1] += DT_S
            else:
                found.append([command.mode, DT_S])
        return [(Mode(mode), round(time_s, 6)) for mode, time_s in found]


@pytest.mark.parametrize("mode", BY_POSITION)
def test_gps_silent_circles_then_glides_and_hands_back_what_was_asked_for(mode):
    """Circle after 3 s of silence, glide 30 s later, and back 2 s after the first fix."""
    aboard = Aboard()
    assert aboard.modes(asking(mode), 10.0) == [(mode, 10.0)]
    silent = aboard.modes(asking(mode), 60.0, gps=False)
    assert [m for m, _ in silent] == [mode, Mode.CIRCLE, Mode.GLIDE]
    times = [t for _, t in silent]
    np.testing.assert_allclose(times[0], P.gps_lost_s, rtol=0, atol=0.21)  # since the last fix, not the last tick
    np.testing.assert_allclose(times[1], P.circle_s, rtol=0, atol=2 * DT_S)
    back = aboard.modes(asking(mode), 10.0)
    assert [m for m, _ in back] == [Mode.GLIDE, mode]
    np.testing.assert_allclose(back[0][1], P.gps_back_s, rtol=0, atol=0.21)


def test_gps_silent_circle_is_gentle_at_cruise_and_glide_is_without_motor():
    """Both with the same bank; the pilot's throttle is not obeyed by a failsafe."""
    aboard, setpoint = Aboard(), asking(Mode.COURSE, throttle=1.0)
    aboard.fly(setpoint, 2.0)
    commands = aboard.fly(setpoint, 60.0, gps=False)
    circle, glide = (next(c for c in reversed(commands) if c.mode == mode) for mode in (Mode.CIRCLE, Mode.GLIDE))
    assert circle.bank_demand_rad == glide.bank_demand_rad == P.bank_rad
    assert circle.throttle == EnergyParams().throttle_trim
    assert glide.throttle == 0.0
    assert glide.pitch_demand_rad == P.glide_pitch_rad + aboard.learnt_rad
    assert aboard.learnt_rad == circle.pitch_demand_rad - EnergyParams().pitch_trim_rad != 0.0


@pytest.mark.parametrize("mode", OTHERS)
def test_gps_silent_is_nothing_to_modes_that_need_no_position(mode):
    """Sticks and attitudes are flown on."""
    aboard = Aboard()
    aboard.fly(asking(mode), 1.0)
    assert aboard.modes(asking(mode), 50.0, gps=False) == [(mode, 50.0)]


def test_gps_late_but_alive_is_not_lost():
    """Fixes that arrive, each 12 s old: not to be believed, but nothing is silent."""
    aboard = Aboard()
    aboard.latency_s = 12.0
    assert aboard.modes(asking(Mode.COURSE), 60.0) == [(Mode.COURSE, 60.0)]


def test_gps_that_reports_no_numbers_is_lost():
    """A fix of no numbers is none."""
    aboard = Aboard()
    aboard.fly(asking(Mode.COURSE), 5.0)
    aboard.numbers = False
    assert aboard.modes(asking(Mode.COURSE), 10.0)[-1][0] == Mode.CIRCLE


def test_gps_never_heard_is_not_lost():
    """An aeroplane without a receiver, or one that waits for the first fix, flies as it was told to."""
    assert Aboard().modes(asking(Mode.COURSE), 60.0, gps=False) == [(Mode.COURSE, 60.0)]


def test_gps_that_flickers_goes_on_circling():
    """One fix in four seconds is never heard for long enough, and the time of the circle goes on."""
    aboard = Aboard()
    aboard.fly(asking(Mode.COURSE), 2.0)
    modes = []
    for _ in range(12):
        modes += [c.mode for c in aboard.fly(asking(Mode.COURSE), 3.8, gps=False)]
        modes += [c.mode for c in aboard.fly(asking(Mode.COURSE), 0.2)]
    assert list(dict.fromkeys(modes)) == [Mode.COURSE, Mode.CIRCLE, Mode.GLIDE]
    assert np.count_nonzero(np.diff(modes)) == 2


@pytest.mark.parametrize("mode", [m for m in Mode if m not in (Mode.LAUNCH, Mode.RETURN)])
def test_radio_lost_returns_at_once_and_obeys_when_it_is_heard_again(mode):
    """In any mode; also where the pilot had the sticks."""
    aboard = Aboard()
    before = aboard.modes(asking(mode), 5.0)
    assert aboard.modes(asking(mode, radio=False), 5.0) == [(Mode.RETURN, 5.0)]
    assert aboard.modes(asking(mode), 5.0) == before


def test_radio_lost_and_gps_lost_circles():
    """There is no way home without a position."""
    aboard = Aboard()
    aboard.fly(asking(Mode.MANUAL), 2.0)
    modes = aboard.modes(asking(Mode.MANUAL, radio=False), 50.0, gps=False)
    assert [m for m, _ in modes] == [Mode.RETURN, Mode.CIRCLE, Mode.GLIDE]


def test_radio_lost_turns_home_whatever_bank_the_pilot_allowed():
    """A bank limit of zero is no way home."""
    aboard = Aboard()
    assert aboard.fly(asking(Mode.COURSE, bank_limit_rad=0.0), 1.0)[-1].bank_demand_rad == 0.0
    home = aboard.fly(asking(Mode.COURSE, bank_limit_rad=0.0, radio=False), 1.0)[-1]
    assert 0.8 * P.bank_rad < abs(home.bank_demand_rad) <= P.bank_rad


def test_radio_lost_does_not_end_a_launch_but_follows_it():
    """In the hand and in the climb the launch goes on; at its height the aeroplane comes home, motor on."""
    aboard, launch = Aboard(), asking(Mode.LAUNCH, radio=False)
    aboard.height_m = 1.7
    assert aboard.fly(launch, 2.0)[-1][3:5] == (0.0, Mode.LAUNCH)
    aboard.row["force_b_m_s2"] = (27.0, 0.0, -9.8)
    aboard.fly(launch, 0.3)
    aboard.row["force_b_m_s2"] = (0.0, 0.0, -9.8)
    assert aboard.fly(launch, 3.0)[-1].mode == Mode.LAUNCH
    aboard.height_m = 49.0
    commands = aboard.fly(launch, 3.0)
    assert commands[-1].mode == Mode.RETURN
    assert all(c.throttle > 0.0 for c in commands)
    heard = aboard.fly(asking(Mode.LAUNCH), 1.0)[-1]  # not back into the hand: its throw was felt
    assert heard.mode == Mode.LAUNCH
    assert heard.throttle > 0.0


def poor(R_eb=None, health=Health.POOR):
    return AttitudeEstimate(np.eye(3) if R_eb is None else R_eb, health=health)


@pytest.mark.parametrize("mode", [*BY_POSITION, Mode.STABILISE])
def test_estimator_poor_with_gps_alive_flies_level_until_it_is_good_as_long(mode):
    """POOR for 5 s, then level; GOOD for 5 s, then again what was asked for."""
    aboard = Aboard()
    aboard.fly(asking(mode), 5.0)
    modes = aboard.modes(asking(mode), 20.0, estimate=poor())
    assert [m for m, _ in modes] == [mode, Mode.LEVEL]
    np.testing.assert_allclose(modes[0][1], P.unhealthy_s, rtol=0, atol=2 * DT_S)
    back = aboard.modes(asking(mode), 20.0)
    assert [m for m, _ in back] == [Mode.LEVEL, mode]
    np.testing.assert_allclose(back[0][1], P.unhealthy_s, rtol=0, atol=2 * DT_S)


@pytest.mark.parametrize("mode", [Mode.MANUAL, Mode.RATE])
def test_estimator_poor_leaves_the_pilot_his_sticks(mode):
    """Manual and rate are never taken away, but by a radio that falls silent."""
    aboard = Aboard()
    aboard.fly(asking(mode), 1.0)
    assert aboard.modes(asking(mode), 20.0, estimate=poor()) == [(mode, 20.0)]
    assert aboard.fly(asking(mode, radio=False), 1.0, estimate=poor())[-1].mode == Mode.LEVEL


def test_estimator_poor_for_want_of_fixes_is_left_to_the_gps_failsafe():
    """Shipped estimators call themselves POOR 2 s after the last fix: that is no reason for LEVEL."""
    aboard = Aboard()
    aboard.fly(asking(Mode.COURSE), 5.0)
    aboard.fly(asking(Mode.COURSE), 2.0, gps=False)
    modes = aboard.modes(asking(Mode.COURSE), 60.0, gps=False, estimate=poor())
    assert [m for m, _ in modes] == [Mode.COURSE, Mode.CIRCLE, Mode.GLIDE]
    aboard.latency_s = 12.0
    aboard.fly(asking(Mode.COURSE), 2.0)
    assert aboard.modes(asking(Mode.COURSE), 20.0, estimate=poor()) == [(Mode.COURSE, 20.0)]


def test_estimator_poor_for_want_of_a_course_is_not_ill():
    """Hardly moving over the ground against the wind there is no course: what misses one is POOR for that alone."""
    aboard = Aboard()
    aboard.fly(asking(Mode.COURSE), 5.0)
    aboard.ground_m_s = P.course_speed_m_s - 1.0
    assert aboard.modes(asking(Mode.COURSE), 20.0, estimate=poor()) == [(Mode.COURSE, 20.0)]
    aboard.ground_m_s = P.course_speed_m_s + 1.0
    assert aboard.modes(asking(Mode.COURSE), 20.0, estimate=poor())[-1][0] == Mode.LEVEL


def test_estimator_that_rejects_a_sample_now_and_then_is_believed():
    """POOR in every third tick is no lasting illness."""
    aboard = Aboard()
    aboard.fly(asking(Mode.COURSE), 1.0)
    for _ in range(500):
        command = [*aboard.fly(asking(Mode.COURSE), 0.04), *aboard.fly(asking(Mode.COURSE), 0.02, estimate=poor())]
    assert {c.mode for c in command} == {Mode.COURSE}


@pytest.mark.parametrize("health", [Health.STARTING, Health.POOR])
def test_estimator_that_never_was_healthy_leaves_no_attitude_to_fall_back_on(health):
    """What it says is all there is."""
    aboard = Aboard()
    assert aboard.modes(asking(Mode.COURSE), 30.0, estimate=poor(health=health)) == [(Mode.COURSE, 30.0)]


def test_level_flies_on_the_last_healthy_attitude_and_the_raw_gyros():
    """Against SciPy: 20 degrees of bank when last healthy, 30 deg/s for a second since, the offset taken off.

    Roll control is then that of an attitude which the broken estimate does not know: it must be the same as that of
    an autopilot told the true attitude; equal to 0.5 % of full deflection, for Eqn 17's steps of first order.  The
    accelerometer shows the forces of a slip in that attitude, so that nothing is to be corrected.
    """
    offset, turning = np.radians([3.0, -2.0, 1.0]), np.radians([30.0, 0.0, 0.0])
    aboard, told = Aboard(), Aboard()
    last = Rotation.from_euler("ZYX", [0.0, 0.05, math.radians(20.0)])
    healthy = AttitudeEstimate(last.as_matrix(), np.zeros(3), offset)
    aboard.row["gyro_b_rad_s"] = offset
    aboard.row["force_b_m_s2"] = last.inv().apply([0.0, 0.0, -9.8])
    aboard.fly(asking(Mode.STABILISE), 1.0, estimate=healthy)
    garbage = poor(Rotation.from_euler("ZYX", [2.0, 1.0, -2.5]).as_matrix())
    aboard.fly(asking(Mode.STABILISE), P.unhealthy_s + 0.1, estimate=garbage)
    aboard.row["gyro_b_rad_s"] = offset + turning
    for i in range(51):
        now = last * Rotation.from_rotvec(turning * DT_S * (i + 1))
        aboard.row["force_b_m_s2"] = now.inv().apply([0.0, 0.0, -9.8])
        if i == 50:
            aboard.autopilot._memory["s"]["roll_integral"] = 0.0
            aboard.autopilot._memory["s"]["pitch_integral"] = 0.0
            aboard.autopilot._memory["s"]["climb_integral_rad"] = 0.0
        (level,) = aboard.fly(asking(Mode.STABILISE), DT_S, estimate=garbage)
    assert level.mode == Mode.LEVEL
    true = AttitudeEstimate(now.as_matrix(), turning)
    (expected,) = told.fly(asking(Mode.STABILISE, pitch_rad=level.pitch_demand_rad), DT_S, estimate=true)
    np.testing.assert_allclose(level[:3], expected[:3], rtol=0, atol=0.005)
    assert level.bank_demand_rad == 0.0


def test_level_gyro_that_is_no_number_turns_nothing():
    """The attitude kept stays one, and the commands stay finite."""
    aboard = Aboard()
    aboard.fly(asking(Mode.COURSE), 1.0)
    aboard.fly(asking(Mode.COURSE), 6.0, estimate=poor())
    aboard.row["gyro_b_rad_s"] = math.nan
    commands = aboard.fly(asking(Mode.COURSE), 1.0, estimate=poor())
    assert commands[-1].mode == Mode.LEVEL
    assert np.isfinite(commands).all()


@pytest.mark.parametrize("mode", BY_POSITION)
def test_low_banks_little_and_climbs_until_it_is_safe(mode):
    """Below 20 m until above 30 m; 25 m on the way down is not low, and on the way up still is."""
    aboard, asked = Aboard(), asking(mode, height_m=60.0)
    for height_m, expected in ((25.0, mode), (15.0, Mode.LOW), (25.0, Mode.LOW), (31.0, mode), (25.0, mode)):
        aboard.height_m = height_m
        command = aboard.fly(asked, 1.0)[-1]
        assert command.mode == expected
        if expected == Mode.LOW:
            assert abs(command.bank_demand_rad) <= P.low_bank_rad
            assert command.pitch_demand_rad > EnergyParams().pitch_trim_rad
            assert command.throttle > EnergyParams().throttle_trim


def test_low_climbs_although_less_height_was_asked_for():
    """10 m is not flown at: it is below what is safe."""
    aboard = Aboard()
    aboard.height_m = 12.0
    command = aboard.fly(asking(Mode.COURSE, height_m=10.0), 1.0)[-1]
    assert command.pitch_demand_rad > EnergyParams().pitch_trim_rad


@pytest.mark.parametrize("mode", [*OTHERS, Mode.LAUNCH])
def test_low_is_nothing_to_launch_and_to_modes_without_a_height(mode):
    """Whoever takes off or lands by hand is low."""
    aboard = Aboard()
    aboard.height_m = 2.0
    assert aboard.modes(asking(mode), 5.0) == [(mode, 5.0)]


def test_low_on_the_way_home_without_radio():
    """Radio lost is RETURN, and RETURN climbs first."""
    aboard = Aboard()
    aboard.height_m = 5.0
    assert aboard.fly(asking(Mode.STABILISE, radio=False), 1.0)[-1].mode == Mode.LOW


def test_low_sailplane_keeps_its_glide_and_lands_nearly_straight():
    """It cannot climb; 5 degrees of bank at most, and the pitch of the glide."""
    aboard = Aboard("gentle_lady")
    aboard.height_m = 6.0
    command = aboard.fly(asking(Mode.RETURN), 1.0)[-1]
    assert command.mode == Mode.LOW
    assert abs(command.bank_demand_rad) <= math.radians(5.0) + 1e-12
    assert command.throttle == 0.0


def test_route_goes_on_to_the_same_waypoint_after_a_failsafe_and_begins_anew_when_another_is_given():
    """The waypoint due is kept through circle and glide; a new route has its own first."""
    aboard = Aboard()
    on_the_way = Setpoint(Mode.WAYPOINTS, route=(Waypoint(201, 0, 60), Waypoint(900, 0, 60), Waypoint(0, 300, 60)))
    due = aboard.autopilot._memory["s"]["next_waypoint"]
    aboard.fly(on_the_way, 1.0)
    assert due[0] == 1  # the first is where the aeroplane is
    aboard.fly(on_the_way, 10.0, gps=False)
    aboard.fly(on_the_way, 2.0)
    assert due[0] == 1
    aboard.fly(asking(Mode.WAYPOINTS), DT_S)
    assert due[0] == 0


def test_failsafes_snapshot_restored_continues_exactly():
    """In the middle of a circle and of a level flight: time left, attitude kept and all."""
    aboard = Aboard()
    aboard.fly(asking(Mode.WAYPOINTS), 5.0)
    aboard.fly(asking(Mode.WAYPOINTS), 20.0, gps=False, estimate=poor())
    snapshot, row, ticks = aboard.autopilot.snapshot(), aboard.row.copy(), aboard.ticks
    first = aboard.fly(asking(Mode.WAYPOINTS), 30.0, gps=False)
    aboard.autopilot.restore(snapshot)
    aboard.row, aboard.ticks = row, ticks
    np.testing.assert_array_equal(aboard.fly(asking(Mode.WAYPOINTS), 30.0, gps=False), first)
    assert {c.mode for c in first} == {Mode.CIRCLE, Mode.GLIDE}


def test_level_uses_nothing_of_the_sick_estimate():
    """Whatever attitude, rate, offset and wind it tells, or no numbers: the commands are the same to the last bit."""
    well = AttitudeEstimate(np.eye(3), wind_e_m_s=np.array([3.0, 0.0, 0.0]))
    nonsense = Rotation.from_euler("ZYX", [2.0, 1.0, -2.5]).as_matrix()
    told = (
        poor()._replace(wind_e_m_s=np.array([50.0, -80.0, 0.0])),
        AttitudeEstimate(nonsense, np.array([5.0, -4.0, 9.0]), np.ones(3), None, Health.POOR),
        AttitudeEstimate(np.full((3, 3), math.nan), np.full(3, math.nan), np.zeros(3), None, Health.GOOD),
    )
    flown = []
    for sick in told:
        aboard = Aboard()
        aboard.fly(asking(Mode.COURSE), 1.0, estimate=well)
        aboard.fly(asking(Mode.COURSE), P.unhealthy_s + 0.1, estimate=poor()._replace(wind_e_m_s=well.wind_e_m_s))
        flown.append(aboard.fly(asking(Mode.COURSE), 5.0, estimate=sick))
    assert {c.mode for c in flown[0]} == {Mode.LEVEL}
    np.testing.assert_array_equal(flown[1], flown[0])
    np.testing.assert_array_equal(flown[2], flown[0])


def test_estimator_that_tells_no_numbers_is_unhealthy():
    """Neutral for as long as one that says POOR is borne, then level on the gyros; the sticks move the surfaces."""
    aboard, none = Aboard(), AttitudeEstimate(np.full((3, 3), math.nan))
    aboard.fly(asking(Mode.COURSE), 1.0)
    commands = aboard.fly(asking(Mode.COURSE), P.unhealthy_s + 1.0, estimate=none)
    assert commands[0][:4] == (0.0, 0.0, 0.0, 0.0)
    assert commands[-1].mode == Mode.LEVEL
    assert commands[-1].throttle > 0.0
    stick = aboard.fly(asking(Mode.MANUAL, aileron=0.5, throttle=0.7), DT_S, estimate=none)[0]
    assert (stick.aileron, stick.throttle) == (0.5, 0.7)


def test_level_too_near_the_ground_climbs():
    """Taken ill at 8 m, it does not stay there."""
    aboard = Aboard()
    aboard.height_m = 8.0
    aboard.fly(asking(Mode.STABILISE), 1.0)
    command = aboard.fly(asking(Mode.STABILISE), P.unhealthy_s + 1.0, estimate=poor())[-1]
    assert command.mode == Mode.LEVEL
    assert command.pitch_demand_rad > EnergyParams().pitch_trim_rad
    assert command.throttle > EnergyParams().throttle_trim


def test_gps_silent_circles_after_a_launch_that_is_over():
    """At its height a launch holds no course: without fixes it would fly away straight ahead."""
    aboard, launch = Aboard(), asking(Mode.LAUNCH)
    aboard.height_m = 49.0
    aboard.row["force_b_m_s2"] = (27.0, 0.0, -9.8)
    aboard.fly(launch, 0.3)
    aboard.row["force_b_m_s2"] = (0.0, 0.0, -9.8)
    aboard.fly(launch, 3.0)
    assert [m for m, _ in aboard.modes(launch, 40.0, gps=False)] == [Mode.LAUNCH, Mode.CIRCLE, Mode.GLIDE]
    assert [m for m, _ in aboard.modes(launch, 5.0)] == [Mode.GLIDE, Mode.LAUNCH]


def test_radio_lost_on_the_way_home_obeys_neither_throttle_nor_bank_limit():
    """RETURN was asked for already, motor off and without bank: what nobody can take back is not obeyed."""
    aboard, home = Aboard(), asking(Mode.RETURN, throttle=0.0, bank_limit_rad=0.0)
    told = aboard.fly(home, 1.0)[-1]
    assert (told.throttle, told.bank_demand_rad) == (0.0, 0.0)
    alone = aboard.fly(asking(Mode.RETURN, throttle=0.0, bank_limit_rad=0.0, radio=False), 1.0)[-1]
    assert alone.throttle > 0.0
    assert abs(alone.bank_demand_rad) > 0.8 * P.bank_rad


def test_estimator_far_from_the_standby_attitude_is_distrusted_at_once():
    """POOR, and upside down where the gyros saw no roll: not for five seconds, but for half of one."""
    aboard = Aboard()
    aboard.fly(asking(Mode.COURSE), 5.0)
    upside_down = poor(np.diag([1.0, -1.0, -1.0]))
    (_, before_s), (mode, _) = aboard.modes(asking(Mode.COURSE), 2.0, estimate=upside_down)
    assert mode == Mode.LEVEL
    np.testing.assert_allclose(before_s, P.apart_s, rtol=0, atol=2 * DT_S)


def test_estimator_that_tells_no_numbers_is_distrusted_without_a_gps_too():
    """Whether there are fixes says nothing about it."""
    aboard, none = Aboard(), AttitudeEstimate(np.full((3, 3), math.nan))
    aboard.fly(asking(Mode.COURSE), 5.0, gps=False)
    assert aboard.fly(asking(Mode.COURSE), P.apart_s + 0.1, gps=False, estimate=none)[-1].mode == Mode.LEVEL


def test_level_without_gps_lands():
    """Level for as long as a circle lasts, then down with wings level; motor on again once the GPS has been back."""
    aboard = Aboard()
    aboard.fly(asking(Mode.COURSE), 5.0)
    aboard.fly(asking(Mode.COURSE), 10.0, estimate=poor())
    silent = aboard.modes(asking(Mode.COURSE), 60.0, gps=False, estimate=poor())
    assert [m for m, _ in silent] == [Mode.LEVEL, Mode.LAND]
    np.testing.assert_allclose(silent[0][1], P.gps_lost_s + P.circle_s, rtol=0, atol=0.3)
    land = aboard.fly(asking(Mode.COURSE), DT_S, gps=False, estimate=poor())[-1]
    assert land[3:] == (0.0, Mode.LAND, 0.0, P.glide_pitch_rad + aboard.learnt_rad)
    back = aboard.modes(asking(Mode.COURSE), 10.0, estimate=poor())
    assert [m for m, _ in back] == [Mode.LAND, Mode.LEVEL]


def test_level_without_radio_lands_later():
    """A minute for the estimator to recover; the pilot, heard again, has the sticks."""
    aboard, alone = Aboard(), asking(Mode.STABILISE, radio=False)
    aboard.fly(asking(Mode.STABILISE), 5.0)
    aboard.fly(asking(Mode.STABILISE), 10.0, estimate=poor())
    modes = aboard.modes(alone, 100.0, estimate=poor())
    assert [m for m, _ in modes] == [Mode.LEVEL, Mode.LAND]
    np.testing.assert_allclose(modes[0][1], P.level_s, rtol=0, atol=2 * DT_S)
    assert aboard.fly(asking(Mode.MANUAL), DT_S, estimate=poor())[-1].mode == Mode.MANUAL


def test_level_radio_that_flickers_lands_as_well():
    """A second of radio in ten is nobody who can help."""
    aboard = Aboard()
    aboard.fly(asking(Mode.COURSE), 5.0)
    modes = []
    for _ in range(9):
        modes += [c.mode for c in aboard.fly(asking(Mode.COURSE, radio=False), 9.0, estimate=poor())]
        modes += [c.mode for c in aboard.fly(asking(Mode.COURSE), 1.0, estimate=poor())]
    assert modes[-100] == Mode.LAND


def test_launch_without_any_fix_climbs_for_a_time_circles_and_glides():
    """One and a half times as long as the climb takes; a first fix ends the circle, and the launch is at its height."""
    aboard, launch = Aboard(), asking(Mode.LAUNCH, height_m=30.0)
    aboard.row["force_b_m_s2"] = (27.0, 0.0, -9.8)
    aboard.fly(launch, 1.0, gps=False)
    aboard.row["force_b_m_s2"] = (0.0, 0.0, -9.8)
    modes = aboard.modes(launch, 80.0, gps=False)
    assert [m for m, _ in modes] == [Mode.LAUNCH, Mode.CIRCLE, Mode.GLIDE]
    climb_m_s = EnergyParams().airspeed_m_s * math.sin(math.radians(12.0) - EnergyParams().pitch_trim_rad)
    np.testing.assert_allclose(modes[0][1], P.blind_climb * 30.0 / climb_m_s, rtol=0, atol=1.0)
    np.testing.assert_allclose(modes[1][1], P.circle_s, rtol=0, atol=2 * DT_S)
    assert aboard.modes(launch, 1.0) == [(Mode.LAUNCH, 1.0)]


def test_launch_without_any_fix_ends_its_climb_by_the_barometer():
    """Where one is fitted, it knows the height."""
    aboard, launch = Aboard(), asking(Mode.LAUNCH, height_m=30.0)
    aboard.row["baro_height_m"] = 10.0
    aboard.row["force_b_m_s2"] = (27.0, 0.0, -9.8)
    aboard.fly(launch, 1.0, gps=False)
    aboard.row["force_b_m_s2"] = (0.0, 0.0, -9.8)
    assert aboard.modes(launch, 4.0, gps=False) == [(Mode.LAUNCH, 4.0)]
    aboard.row["baro_height_m"] = 26.0
    assert aboard.fly(launch, 0.1, gps=False)[-1].mode == Mode.CIRCLE


BY_HAND, BY_ATTITUDE, BY_PLACE, THROWN = Mode.MANUAL, Mode.STABILISE, Mode.COURSE, Mode.LAUNCH
GROUPS = dict.fromkeys(BY_POSITION, BY_PLACE) | {Mode.MANUAL: BY_HAND, Mode.RATE: BY_HAND}
AS_COMMANDED = None
ENDS = {  # GPS, radio, estimator: where it ends by hand, by attitude, by place, after a launch
    ("works", "works", "healthy"): (AS_COMMANDED, AS_COMMANDED, AS_COMMANDED, AS_COMMANDED),
    ("works", "works", "ill"): (AS_COMMANDED, Mode.LEVEL, Mode.LEVEL, Mode.LEVEL),
    ("works", "works", "never healthy"): (AS_COMMANDED, AS_COMMANDED, AS_COMMANDED, AS_COMMANDED),
    ("works", "lost", "healthy"): (Mode.GLIDE, Mode.GLIDE, Mode.GLIDE, Mode.GLIDE),
    ("works", "lost", "ill"): (Mode.LAND, Mode.LAND, Mode.LAND, Mode.LAND),
    ("works", "lost", "never healthy"): (Mode.GLIDE, Mode.GLIDE, Mode.GLIDE, Mode.GLIDE),
    ("lost", "works", "healthy"): (AS_COMMANDED, AS_COMMANDED, Mode.GLIDE, Mode.GLIDE),
    ("lost", "works", "ill"): (AS_COMMANDED, Mode.LAND, Mode.LAND, Mode.LAND),
    ("lost", "works", "never healthy"): (AS_COMMANDED, AS_COMMANDED, Mode.GLIDE, Mode.GLIDE),
    ("lost", "lost", "healthy"): (Mode.GLIDE, Mode.GLIDE, Mode.GLIDE, Mode.GLIDE),
    ("lost", "lost", "ill"): (Mode.LAND, Mode.LAND, Mode.LAND, Mode.LAND),
    ("lost", "lost", "never healthy"): (Mode.GLIDE, Mode.GLIDE, Mode.GLIDE, Mode.GLIDE),
    ("never", "works", "healthy"): (AS_COMMANDED, AS_COMMANDED, AS_COMMANDED, Mode.GLIDE),
    ("never", "works", "ill"): (AS_COMMANDED, Mode.LAND, Mode.LAND, Mode.LAND),
    ("never", "works", "never healthy"): (AS_COMMANDED, AS_COMMANDED, AS_COMMANDED, Mode.GLIDE),
    ("never", "lost", "healthy"): (Mode.GLIDE, Mode.GLIDE, Mode.GLIDE, Mode.GLIDE),
    ("never", "lost", "ill"): (Mode.LAND, Mode.LAND, Mode.LAND, Mode.LAND),
    ("never", "lost", "never healthy"): (Mode.GLIDE, Mode.GLIDE, Mode.GLIDE, Mode.GLIDE),
}


@pytest.mark.parametrize("conditions", ENDS, ids=" ".join)
@pytest.mark.parametrize("mode", [*BY_POSITION, *OTHERS, Mode.LAUNCH])
def test_no_mode_lasts_for_ever_without_somebody_who_can_end_it(mode, conditions):
    """Every mode with every combination of failures, after 130 s of them: the pilot is in command, or the motor is off.

    A launch is thrown first.  The ill estimator tells no numbers any more, which is noticed without a GPS, too.
    """
    gps, radio, estimator = conditions
    params = replace(Aboard().autopilot.params, failsafe=FailsafeParams(return_s=100.0))
    aboard = Aboard()
    aboard.autopilot, aboard.dt_s = DcmAutopilot(params), 0.1
    well = poor(health=Health.STARTING) if estimator == "never healthy" else None
    command = asking(mode)
    aboard.row["force_b_m_s2"] = (27.0, 0.0, -9.8)
    aboard.fly(command, 1.0, gps=gps != "never", estimate=well)
    aboard.row["force_b_m_s2"] = (0.0, 0.0, -9.8)
    aboard.fly(command, 9.0, gps=gps != "never", estimate=well)
    ill = AttitudeEstimate(np.full((3, 3), math.nan)) if estimator == "ill" else well
    after = replace(command, radio=radio == "works")
    last = aboard.fly(after, 130.0, gps=gps == "works", estimate=ill)[-1]
    column = (BY_HAND, BY_ATTITUDE, BY_PLACE, THROWN).index(GROUPS.get(mode, mode))
    expected = ENDS[conditions][column]
    assert last.mode == (mode if expected is AS_COMMANDED else expected)
    if last.mode in (Mode.GLIDE, Mode.LAND):
        assert last.throttle == 0.0
    else:
        assert after.radio
