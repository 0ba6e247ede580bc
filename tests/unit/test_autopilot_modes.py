"""The autopilot as a whole: its modes, its mixer, its set-points and its scripts."""

import math
from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import sim.aircraft
from autopilot.airframes import AutopilotParams, params_of
from autopilot.dcm import _PARAMS, DcmAutopilot
from autopilot.energy import EnergyParams
from autopilot.interface import Mode, Setpoint
from autopilot.mixer import MixerParams, mix
from autopilot.pilot import Script, Timed, reversals
from autopilot.stabilise import StabiliseParams
from estimator.interface import MEASURED_DTYPE, AttitudeEstimate, Measurements

LEVEL = AttitudeEstimate(np.eye(3))


def measurements(*, north_m=0.0, height_m=50.0, force_x=0.0):
    rows = np.zeros(1, MEASURED_DTYPE)
    rows["t_s"], rows["dt_s"], rows["gps_t_s"], rows["gps_valid"] = 10.0, 0.02, 9.7, 1
    rows["gps_v_e_m_s"] = (12.6, 0.0, 0.0)
    rows["gps_p_e_m"], rows["force_b_m_s2"] = (north_m, 0.0, -height_m), (force_x, 0.0, -9.8)
    return Measurements(rows, 0)


def estimate(heading=0.0, pitch=0.0, roll=0.0, omega=(0.0, 0.0, 0.0), wind=None):
    R = Rotation.from_euler("ZYX", [heading, pitch, roll]).as_matrix()
    return AttitudeEstimate(R, np.array(omega), np.zeros(3), wind)


def test_manual_passes_the_sticks_through():
    """Manual: surfaces are the sticks, the throttle is off unless given, nothing is held."""
    autopilot = DcmAutopilot()
    command = autopilot.update(LEVEL, measurements(), Setpoint(Mode.MANUAL, 0.3, -0.4, 0.5))
    assert command[:5] == (0.3, -0.4, 0.5, 0.0, Mode.MANUAL)
    assert math.isnan(command.bank_demand_rad)
    assert math.isnan(command.pitch_demand_rad)
    assert autopilot.update(LEVEL, measurements(), Setpoint(Mode.MANUAL, throttle=0.7)).throttle == 0.7


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_rate_commands_the_surface_of_its_axis_in_its_sense(axis):
    """Rate: roll right, nose up, nose right each move their own surface to the positive side."""
    rate = [0.0, 0.0, 0.0]
    rate[axis] = 0.8
    command = DcmAutopilot().update(LEVEL, measurements(), Setpoint(Mode.RATE, rate_b_rad_s=tuple(rate)))
    assert command[axis] > 0.05
    assert math.isnan(command.bank_demand_rad)


def test_stabilise_holds_what_is_asked_and_reports_it():
    """Stabilise: bank and pitch demand are the set-point's, aileron and elevator lead there."""
    setpoint = Setpoint(Mode.STABILISE, bank_rad=0.3, pitch_rad=0.2)
    command = DcmAutopilot().update(LEVEL, measurements(), setpoint)
    assert (command.bank_demand_rad, command.pitch_demand_rad) == (0.3, 0.2)
    assert command.aileron > 0.0
    assert command.elevator > 0.0


def test_course_demands_bank_towards_the_course_and_climb_towards_the_height():
    """Course: east is to the right of north, 80 m are above 50 m."""
    setpoint = Setpoint(Mode.COURSE, course_rad=math.pi / 2, height_m=80.0)
    command = DcmAutopilot().update(LEVEL, measurements(), setpoint)
    assert command.bank_demand_rad == setpoint.bank_limit_rad
    assert command.pitch_demand_rad > EnergyParams().pitch_trim_rad
    assert command.throttle > EnergyParams().throttle_trim


def test_course_nose_estimator_crabs_into_the_wind():
    """Heading north in a wind to the east, wanted north: turn left, into the wind; a course estimator is content."""
    north = Setpoint(Mode.COURSE, course_rad=0.0)
    windy = estimate(wind=np.array([0.0, 5.0, 0.0]))
    assert DcmAutopilot(heading_reference="nose").update(windy, measurements(), north).bank_demand_rad < -0.1
    assert DcmAutopilot(heading_reference="course").update(windy, measurements(), north).bank_demand_rad == 0.0


def test_return_heading_away_turns_back_at_the_limit_and_heading_home_flies_straight():
    """Return: launch point to the south."""
    home = Setpoint(Mode.RETURN)
    away = DcmAutopilot().update(estimate(0.1), measurements(north_m=300.0), home)
    assert abs(away.bank_demand_rad) == home.bank_limit_rad
    towards = DcmAutopilot().update(estimate(math.pi), measurements(north_m=300.0), home)
    assert towards.bank_demand_rad == pytest.approx(0.0, rel=0, abs=1e-9)


def test_launch_throw_starts_the_motor_after_the_delay():
    """Launch: wings level throughout, no motor during the push of 0.3 s, and soon after its end."""
    autopilot, setpoint = DcmAutopilot(), Setpoint(Mode.LAUNCH)
    thrown, flying = measurements(height_m=1.7, force_x=27.0), measurements(height_m=1.7)
    commands = [autopilot.update(LEVEL, thrown if k < 15 else flying, setpoint) for k in range(40)]
    on = next(k for k, c in enumerate(commands) if c.throttle > 0.0)
    assert 15 < on <= 17
    assert all(c.throttle == 1.0 for c in commands[on:])
    assert all(c.bank_demand_rad == 0.0 for c in commands)


def test_mode_change_back_to_launch_waits_for_a_new_throw():
    """The throw of an earlier launch does not start the motor of the next."""
    autopilot, launch = DcmAutopilot(), Setpoint(Mode.LAUNCH)
    for k in range(20):
        thrown = autopilot.update(LEVEL, measurements(height_m=1.7, force_x=27.0 if k < 15 else 0.0), launch)
    assert thrown.throttle == 1.0
    assert autopilot.update(LEVEL, measurements(), Setpoint(Mode.STABILISE)).mode == Mode.STABILISE
    assert autopilot.update(LEVEL, measurements(), launch).throttle == 0.0


def test_mode_change_out_of_rate_forgets_the_integral_of_the_manoeuvre():
    """After a pull the level flight begins with the elevator of a new autopilot, not with the pull's."""
    autopilot, level = DcmAutopilot(), Setpoint(Mode.STABILISE)
    pull = Setpoint(Mode.RATE, rate_b_rad_s=(0.0, 0.3, 0.0))
    for _ in range(100):
        autopilot.update(LEVEL, measurements(), pull)
    assert autopilot.update(LEVEL, measurements(), level) == DcmAutopilot().update(LEVEL, measurements(), level)


def test_setpoint_throttle_overrides_the_autopilot_where_given():
    """A number is obeyed, NaN leaves the throttle to the autopilot."""
    for mode in (Mode.RATE, Mode.STABILISE, Mode.COURSE, Mode.RETURN):
        assert DcmAutopilot().update(LEVEL, measurements(), Setpoint(mode, throttle=0.25)).throttle == 0.25
        assert DcmAutopilot().update(LEVEL, measurements(), Setpoint(mode)).throttle > 0.25


def test_heading_reference_unknown_is_refused():
    """One line that says what there is."""
    with pytest.raises(ValueError, match="heading_reference 'track': must be 'course' or 'nose'"):
        DcmAutopilot(heading_reference="track")


@pytest.mark.parametrize("mode", [Mode.COURSE, Mode.RETURN, Mode.LAUNCH])
@pytest.mark.parametrize("height_m", [-100.0, 50.0, 1000.0])
def test_sailplane_any_height_wanted_glides_and_never_pulls(mode, height_m):
    """Without a motor no height is worth a slower flight: the pitch is that of the glide, the motor is off."""
    sailplane = DcmAutopilot(aircraft="gentle_lady")
    wanted = Setpoint(mode, course_rad=2.0, height_m=height_m, throttle=1.0)
    glide_rad = params_of("gentle_lady").energy.pitch_trim_rad
    for sink_m_s in (-3.0, 0.5, 3.0):
        m = measurements(north_m=300.0, force_x=27.0)
        m.rows["gps_v_e_m_s"][0, 2] = sink_m_s
        for _ in range(200):
            command = sailplane.update(LEVEL, m, wanted)
        assert command.pitch_demand_rad == glide_rad
        assert command.throttle == 0.0
    assert glide_rad < 0.0


def test_bank_demand_upside_down_is_told_as_the_bank_that_it_is():
    """30 degrees asked for on its back are 150 to the left: what is recorded lies beside the true bank."""
    on_its_back = Setpoint(Mode.STABILISE, bank_rad=math.radians(30.0), inverted=True)
    command = DcmAutopilot().update(estimate(roll=math.radians(-150.0)), measurements(), on_its_back)
    assert math.degrees(command.bank_demand_rad) == pytest.approx(-150.0, rel=0, abs=1e-9)
    assert abs(command.aileron) < 0.1  # there already


def test_sailplane_turns_by_rudder_within_its_own_bank_limit():
    """The set-point allows 60 degrees, the aeroplane not; right is right rudder, and there is no aileron."""
    sailplane = DcmAutopilot(aircraft="gentle_lady")
    east = Setpoint(Mode.COURSE, course_rad=0.6 * math.pi, bank_limit_rad=math.radians(60.0))
    command = sailplane.update(LEVEL, measurements(), east)
    assert 0.0 < command.bank_demand_rad <= params_of("gentle_lady").guidance.bank_limit_rad
    assert command.rudder > 0.1
    assert command.aileron == 0.0
    gentler = Setpoint(Mode.COURSE, course_rad=0.6 * math.pi, bank_limit_rad=0.1)
    assert sailplane.update(LEVEL, measurements(), gentler).bank_demand_rad == 0.1


def test_params_of_an_aircraft_that_nobody_has_tuned_for_is_refused():
    """One line that says which there are."""
    with pytest.raises(ValueError, match=r"aircraft 'kite': .* only for endurance, gentle_lady$"):
        DcmAutopilot(aircraft="kite")


def test_params_there_are_gains_for_every_aircraft():
    """Whatever `sim` can fly, the autopilot can steer."""
    for airframe in Path(sim.aircraft.__file__).parent.glob("*/airframe.toml"):
        assert isinstance(params_of(airframe.parent.name), AutopilotParams)


def test_params_reach_the_kernel():
    """Every group of parameters is packed where the kernel reads it."""
    params = AutopilotParams(StabiliseParams(roll_control_per_rate_s=0.0, roll_control_per_rate_error_s=0.0))
    banked = estimate(roll=0.5)
    setpoint = Setpoint(Mode.STABILISE)
    assert DcmAutopilot(params).update(banked, measurements(), setpoint).aileron == 0.0
    trimmed = AutopilotParams(mixer=MixerParams(aileron_trim=0.125))
    assert DcmAutopilot(trimmed).update(LEVEL, measurements(), setpoint).aileron == 0.125


def mixed(control, **params):
    p = np.zeros(1, _PARAMS["mixer"])
    p[0] = astuple(MixerParams(**params))
    return mix(*control, p[0])


@pytest.mark.parametrize("limits", [(1.0, 1.0, 1.0, 1.0), (0.5, 0.6, 0.7, 0.8), (0.0, 1.0, 1.0, 0.0)])
def test_mix_beyond_the_limits_is_held(limits):
    """Each surface stays within its share of the travel, the throttle between 0 and its own; 0 is not fitted."""
    names = ("aileron_limit", "elevator_limit", "rudder_limit", "throttle_limit")
    params = dict(zip(names, limits, strict=True))
    aileron, elevator, rudder, throttle = limits
    assert mixed((9.0, -9.0, 9.0, 9.0), **params) == (aileron, -elevator, rudder, throttle)
    assert mixed((-9.0, 9.0, -9.0, -9.0), **params) == (-aileron, elevator, -rudder, 0.0)


def test_mix_without_ailerons_roll_control_is_rudder_to_the_same_side():
    """Nose right slips to the left, and the dihedral rolls out of the slip, to the right."""
    assert mixed((0.4, 0.0, 0.1, 0.0), aileron_limit=0.0, rudder_per_roll=1.0) == (0.0, 0.0, 0.5, 0.0)


@pytest.mark.parametrize(
    "wrong",
    [
        {"aileron": 1.5}, {"elevator": math.nan}, {"rudder": -2.0}, {"bank_rad": 3.0}, {"pitch_rad": math.inf},
        {"course_rad": math.nan}, {"height_m": math.nan}, {"bank_limit_rad": -0.1}, {"throttle": 1.1},
        {"rate_b_rad_s": (0.0, math.nan, 0.0)}, {"rate_b_rad_s": (0.0, 0.0)},
    ],
)  # fmt: skip
def test_setpoint_out_of_range_is_refused_by_name(wrong):
    """What no aeroplane can be asked is refused before the flight, naming the field."""
    with pytest.raises(ValueError, match=f"Setpoint.{next(iter(wrong))}: "):
        Setpoint(Mode.STABILISE, **wrong)


def test_script_gives_the_setpoint_in_force():
    """From its time on, exactly; the first also before, the last for ever; the same object, not a copy."""
    first, second = Setpoint(Mode.LAUNCH), Setpoint(Mode.RETURN)
    script = Script([Timed(0.0, first), Timed(20.0, second)])
    assert [script.at(t) for t in (-9.0, 0.0, 19.99)] == [first] * 3
    assert script.at(20.0) is script.at(1e9) is second
    assert list(script) == [Timed(0.0, first), Timed(20.0, second)]


@pytest.mark.parametrize("times", [(), (0.0, 0.0), (1.0, 0.5), (0.0, math.nan)])
def test_script_without_order_is_refused(times):
    """No set-point, equal times, decreasing times, no time."""
    with pytest.raises(ValueError, match=r"^Script: "):
        Script([(t, Setpoint(Mode.RETURN)) for t in times])


def test_reversals_alternate_between_the_course_and_its_opposite():
    """Three reversals of a northerly course: south, north, south."""
    turns = reversals(20.0, 40.0, 3, Setpoint(Mode.COURSE, course_rad=0.0, height_m=60.0))
    assert [t.t_s for t in turns.timed] == [20.0, 60.0, 100.0]
    north = [math.cos(t.setpoint.course_rad) for t in turns.timed]
    np.testing.assert_allclose(north, [-1.0, 1.0, -1.0], rtol=0, atol=1e-12)
    assert all(t.setpoint.height_m == 60.0 for t in turns.timed)
    with pytest.raises(ValueError, match="COURSE"):
        reversals(0.0, 40.0, 3, Setpoint(Mode.RETURN))
