"""Aeroplanes that differ from their drawing: each difference, with its sign, against a closed form."""

import math
from dataclasses import replace

import numpy as np
import pytest

from autopilot.interface import ActuatorCommand
from sim.aeroplane.built import AsBuilt, drawn_inertia_kg_m2, require_flyable, static_margin
from sim.aeroplane.derivatives import Airframe, coefficients
from sim.aeroplane.jsbsim_model import Model
from sim.aeroplane.jsbsim_plant import JsbsimPlant
from sim.aeroplane.linear import linearise, modes
from sim.aeroplane.performance import Glides
from sim.aeroplane.trim import accelerations, trim
from sim.air import STILL
from sim.log import Log
from sim.plant import HandThrow, InFlight

HZ = 200
NAMES = ("endurance", "gentle_lady")


def model_of(aircraft, **differences):
    return Model(aircraft, HZ, AsBuilt(**differences))


def cruise(model):
    return trim(model, model.airframe["cruise"]["airspeed_m_s"])


def linear_of(model):
    return linearise(model, cruise(model))


@pytest.mark.parametrize("aircraft", NAMES)
def test_stall_speed_grows_with_the_root_of_the_mass(aircraft):
    """The lift at the stall is the weight: V = sqrt(2 m g / rho S CL), and only the mass differs."""

    def slowest_m_s(model):
        polar, by = Glides(model, 60.0).polar(cruise(model))
        assert by == "lift" or aircraft == "gentle_lady"
        return min(t.airspeed_m_s for t in polar)

    drawn, heavy = model_of(aircraft), model_of(aircraft, mass_factor=1.3)
    assert slowest_m_s(heavy) == pytest.approx(math.sqrt(1.3) * slowest_m_s(drawn), rel=0.01)
    assert heavy.mass_kg() == pytest.approx(1.3 * drawn.mass_kg(), rel=1e-12)


@pytest.mark.parametrize("aircraft", NAMES)
def test_centre_of_gravity_aft_moves_the_margin_by_as_much_and_needs_the_nose_pushed_down(aircraft):
    """Etkin, 2.3: the margin is the distance to the neutral point; the lift, CL chord behind, gives CL times the shift.

    The elevator that balances it is CL shift / Cm_elevator, to 15 % as the elevator lifts, too.
    """
    drawn, aft = model_of(aircraft), model_of(aircraft, cg_aft=0.05)
    one, other = (coefficients(m_linear, Airframe.of(m, m_linear)) for m in (drawn, aft) for m_linear in [linear_of(m)])
    margin, less = (-c["Cm_alpha"] / c["CL_alpha"] for c in (one, other))
    assert margin - less == pytest.approx(0.05, abs=0.002)
    assert static_margin(drawn, cruise(drawn)) == pytest.approx(margin, abs=0.005)
    frame = Airframe.of(drawn, linear_of(drawn))
    moment = 0.05 * frame.lift_n / frame.pressure_force_n
    assert cruise(drawn).elevator - cruise(aft).elevator == pytest.approx(moment / one["Cm_elevator"], rel=0.15)


@pytest.mark.parametrize(
    "factors", [{"roll_inertia_factor": 1.2}, {"pitch_inertia_factor": 1.1}, {"yaw_inertia_factor": 0.9}]
)
def test_surfaces_turn_the_aeroplane_by_euler_with_its_inertia(factors):
    """The same moments, the same trim, other accelerations: I dw = M, with I scaled here."""
    drawn, other = model_of("endurance"), model_of("endurance", **factors)
    t = cruise(drawn)  # JSBSim works out the masses in its first step
    factor = np.array([factors.get(f"{axis}_inertia_factor", 1.0) for axis in ("roll", "pitch", "yaw")])
    inertia = drawn.inertia_tensor_kg_m2()
    scaled = inertia * np.sqrt(np.outer(factor, factor))
    for surface in ("aileron", "elevator", "rudder"):
        deflected = replace(t, **{surface: getattr(t, surface) + 0.2})
        before = accelerations(drawn, deflected, 60.0)[3:]
        after = accelerations(other, deflected, 60.0)[3:]
        np.testing.assert_allclose(scaled @ after, inertia @ before, rtol=0, atol=1e-6)


def test_time_constant_of_the_roll_grows_with_the_inertia_and_with_the_mass():
    """The roll subsidence is -Lp / Ixx (Nelson, 5.4); parts that are heavier alike have moments in proportion."""

    def constant_s(**differences):
        model = model_of("endurance", **differences)
        by_name = {mode.name: mode for mode in modes(linear_of(model))}
        return 1.0 / by_name["roll"].omega_rad_s

    drawn_s = constant_s()
    assert constant_s(roll_inertia_factor=1.2) == pytest.approx(1.2 * drawn_s, rel=0.03)
    assert constant_s(mass_factor=1.2) == pytest.approx(1.2 * drawn_s, rel=0.03)


@pytest.mark.parametrize(("surface", "axis"), [("aileron", 0), ("elevator", 1), ("rudder", 2)])
def test_trim_of_a_surface_is_a_command_that_is_always_there(surface, axis):
    """At the command of the drawing it turns as a drawn aeroplane at 0.1 of command more does, but for round-off."""
    off = model_of("endurance", **{f"{surface}_trim": 0.1})
    drawn = model_of("endurance")
    t = cruise(drawn)
    turning = accelerations(off, t, 60.0)
    assert turning[3 + axis] > 0.5
    commanded = accelerations(drawn, replace(t, **{surface: getattr(t, surface) + 0.1}), 60.0)
    np.testing.assert_allclose(turning, commanded, rtol=0, atol=1e-9)
    assert getattr(cruise(off), surface) == pytest.approx(getattr(t, surface) - 0.1, abs=1e-6)


@pytest.mark.parametrize("aircraft", NAMES)
def test_warped_wing_rolls_to_the_right_at_three_quarters_of_its_twist(aircraft):
    """Strips of a wing of one chord: halves at +w/2 and -w/2 turn until the helix angle p b / 2V is 3/4 w."""
    warp_deg = 2.0
    drawn, warped = Model(aircraft, HZ), model_of(aircraft, warp_deg=warp_deg)
    t = cruise(drawn)

    def roll_moment(model, p=0.0):
        model.place(60.0, t.euler_rad(), t.air_velocity_b_m_s, (p, 0.0, 0.0), t.command, STILL, 1)
        model.settle()
        return model.force_and_moment()[1][0]

    from_twist = roll_moment(warped) - roll_moment(drawn)  # the motor's torque is in both
    damping = (roll_moment(warped, 0.02) - roll_moment(warped)) / 0.02
    p_hat = 2.0 * t.airspeed_m_s / warped.wing()[1]
    assert -from_twist / damping / p_hat == pytest.approx(0.75 * math.radians(warp_deg), rel=0.03)


def test_thrust_is_less_at_the_same_propeller_speed():
    """All of the motor's torque and speed are as drawn, so the thrust is the factor's."""

    def full(model):
        t = replace(cruise(Model("endurance", HZ)), throttle=1.0)
        accelerations(model, t, 60.0)
        return model.thrust_n(), model.getter("propulsion/engine/propeller-rpm")()

    (drawn_n, drawn_rpm), (weak_n, weak_rpm) = (
        full(model_of("endurance")),
        full(model_of("endurance", thrust_factor=0.8)),
    )
    assert weak_n == pytest.approx(0.8 * drawn_n, rel=1e-9)
    assert weak_rpm == pytest.approx(drawn_rpm, rel=1e-9)


def flown(plant, ticks, command):
    log = Log.empty(ticks)
    plant.reset(log)
    for k in range(ticks):
        plant.advance(k, command)
    return log.truth


def test_flight_starts_trimmed_for_the_aeroplane_that_flies():
    """Its own trim holds a heavy, tail-heavy, crooked aeroplane straight and level for a second."""
    built = AsBuilt(mass_factor=1.2, cg_aft=0.04, aileron_trim=0.05, elevator_trim=-0.05, rudder_trim=0.05)
    plant = JsbsimPlant(start=InFlight(heading_rad=0.0, height_m=60.0), built=built)
    drawn = JsbsimPlant(start=InFlight(heading_rad=0.0, height_m=60.0))
    held, left = (flown(plant, 50, each.trimmed.command) for each in (plant, drawn))
    assert np.abs(held["omega_b_rad_s"]).max() < 1e-3
    assert np.abs(left["omega_b_rad_s"][:, 0]).max() > 0.1
    assert held["aileron"][-1] == pytest.approx(plant.trimmed.aileron + 0.05, abs=1e-9)


def test_hand_gives_any_aeroplane_the_throw_that_was_asked_for():
    """The hand pushes at the centre of gravity: speed and rates at the release are those of the throw."""
    built = AsBuilt(mass_factor=1.3, cg_aft=0.08, roll_inertia_factor=0.9, elevator_trim=0.1, warp_deg=2.0)
    throw = HandThrow(0.0, 0.2, (0.0,) * 3, (1.0,) * 3, (0.0,) * 3, (0.1, 0.2, -0.1), 1.7, 1.0, 27.0, 0.3)
    plant = JsbsimPlant(start=throw, built=built)
    truth = flown(plant, 65, ActuatorCommand(0.0, 0.0, 0.0, 0.0))
    k = round(plant.release_s / plant.dt_s) - 1
    assert np.linalg.norm(truth["v_e_m_s"][k]) == pytest.approx(27.0 * 0.3, rel=0.01)
    np.testing.assert_allclose(truth["omega_b_rad_s"][k], (0.1, 0.2, -0.1), rtol=0, atol=2e-3)


@pytest.mark.parametrize("aircraft", NAMES)
def test_moments_of_the_drawing_are_those_of_the_model(aircraft):
    model = Model(aircraft, HZ)
    accelerations(model, cruise(model), 60.0)
    np.testing.assert_allclose(drawn_inertia_kg_m2(aircraft), model.inertia_kg_m2(), rtol=2e-4, atol=0)


@pytest.mark.parametrize(
    ("aircraft", "differences", "words"),
    [
        ("endurance", {"mass_factor": 4.0}, "airframe.mass_factor = 4: cannot fly at its cruise speed of 12.6 m/s, b"),
        ("endurance", {"thrust_factor": 0.1}, "airframe.thrust_factor = 0.1: cannot fly at its cruise speed"),
        ("endurance", {"cg_aft": 0.2}, "static margin is -2.8 % of the mean chord; airframe.cg_aft must be below 0.17"),
        ("endurance", {"elevator_trim": -0.9, "cg_aft": -0.9}, "airframe.cg_aft = -0.9, airframe.elevator_trim = -0.9"),
        ("gentle_lady", {"cg_aft": -0.6}, "m/s, the elevator has to go beyond 1"),
        ("endurance", {"yaw_inertia_factor": 1.2}, "airframe.yaw_inertia_factor = 1.2: no body has a moment"),
        ("gentle_lady", {"cg_aft": 0.17, "mass_factor": 1.1}, "airframe.mass_factor = 1.1, airframe.cg_aft = 0.17: d"),
        ("gentle_lady", {"thrust_factor": 0.8}, "airframe.thrust_factor = 0.8: 'gentle_lady' has no motor"),
    ],
)  # fmt: skip
def test_what_cannot_fly_is_refused_in_one_line(aircraft, differences, words):
    with pytest.raises(ValueError, match="airframe") as refused:
        require_flyable(model_of(aircraft, **differences))
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_aeroplane_just_inside_the_limit_of_stability_flies():
    """At most 0.17 chords aft is what the refusal says: 0.16 has a margin of 1 %."""
    require_flyable(model_of("endurance", cg_aft=0.16))
