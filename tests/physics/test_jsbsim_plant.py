"""The JSBSim plant against physics that JSBSim does not work out: rest, fall, energy, Galileo; and its contract."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from autopilot.interface import NEUTRAL, ActuatorCommand
from sim.aeroplane.jsbsim_model import Model
from sim.aeroplane.jsbsim_plant import FlightBox, JsbsimPlant
from sim.air import Air
from sim.clock import Rates
from sim.log import Log, Outcome, Phase
from sim.place import LATITUDE_DEG
from sim.plant import HandThrow, InFlight, SimulationDiverged
from sim.truth import gravity_m_s2

G_M_S2 = gravity_m_s2(math.radians(LATITUDE_DEG))
LEVEL = InFlight(heading_rad=0.6, height_m=100.0)
THROW = HandThrow(
    heading_rad=2.0,
    pitch_rad=0.2,
    sway_rad_s=(0.05, 0.04, 0.03),
    sway_hz=(0.5, 0.7, 0.3),
    sway_phase_rad=(1.0, 2.0, 3.0),
    release_rate_b_rad_s=(0.26, -0.2, 0.1),
    hold_s=1.0,
)


def flown(plant, seconds, pilot, read=None):
    """Truth rows of `seconds` under `pilot(t_s)`, the outcome, and what `read(model)` gave before each physics step."""
    log = Log.empty(round(seconds / plant.dt_s))
    plant.reset(log)
    seen, run = [], plant.model.run

    def spy():
        seen.append(read(plant.model))
        return run()

    if read is not None:
        plant.model.run = spy
    for k in range(len(log)):
        outcome = plant.advance(k, pilot(k * plant.dt_s))
        if outcome is not None:
            return log.truth[: k + 1], outcome, np.array(seen)
    return log.truth, None, np.array(seen)


def cruise(plant):
    """A pilot that leaves everything in trim."""
    return lambda _t_s: plant.trimmed.command


def stirring(plant):
    """A pilot that moves all controls, to some 2 rad/s and 3 g."""
    elevator = plant.trimmed.elevator
    return lambda t: ActuatorCommand(
        0.4 * math.sin(3.0 * t), elevator + 0.3 * math.sin(2.0 * t), 0.3 * math.sin(4.0 * t), 0.8
    )


def test_inertial_means_held_still_read_gravity_and_earth_rate():
    """A hand that does not move feels 1 g along the plumb line and the earth's rotation, nothing else."""
    still = HandThrow(0.9, 0.3, (0.0,) * 3, (0.5,) * 3, (0.0,) * 3, (0.0,) * 3, hold_s=0.5)
    rows, _, _ = flown(JsbsimPlant(start=still), 0.5, lambda _t: NEUTRAL)
    R_eb = Rotation.from_euler("ZYX", [0.9, 0.3, 0.0]).as_matrix()
    latitude = math.radians(LATITUDE_DEG)
    earth_rate_e = 7.292115e-5 * np.array([math.cos(latitude), 0.0, -math.sin(latitude)])
    # Round-off: 1e-15 of attitude over a tick of 0.02 s.
    np.testing.assert_allclose(rows["imu_force_b_m_s2"], [R_eb.T @ [0, 0, -G_M_S2]] * len(rows), rtol=0, atol=1e-12)
    np.testing.assert_allclose(rows["imu_omega_b_rad_s"], [R_eb.T @ earth_rate_e] * len(rows), rtol=0, atol=1e-12)


def test_sway_in_the_hand_gyro_integrates_to_the_attitude():
    """In the hand the mean rates, chained as rotation vectors, carry the first attitude to the last."""
    rows, _, _ = flown(JsbsimPlant(start=THROW), 1.0, lambda _t: NEUTRAL)
    assert set(rows["phase"]) == {Phase.HELD}
    latitude = math.radians(LATITUDE_DEG)
    earth_rate_e = 7.292115e-5 * np.array([math.cos(latitude), 0.0, -math.sin(latitude)])
    attitude = Rotation.from_matrix(rows["R_eb"][0])
    for row in rows[1:]:
        relative = row["imu_omega_b_rad_s"] - row["R_eb"].T @ earth_rate_e
        attitude = attitude * Rotation.from_rotvec(relative * 0.02)
    # Discretisation: the earth's rotation is seen half a tick late, 7e-5 rad/s x 0.06 rad/s x 0.02 s x 1 s.
    np.testing.assert_allclose(attitude.as_matrix(), rows["R_eb"][-1], rtol=0, atol=1e-6)
    assert np.ptp(rows["omega_b_rad_s"], axis=0).min() > 0.03


def test_inertial_means_dropped_from_rest_read_only_drag():
    """Let go at rest and level, the accelerometer reads no more than the drag of a falling plate."""
    plant = JsbsimPlant(start=LEVEL)
    log = Log.empty(20)
    plant.reset(log)
    plant.begin((0.0, 0.0, -100.0), (0.0, 0.0, 0.0), np.zeros(3))
    for k in range(20):
        plant.advance(k, NEUTRAL)
    rows = log.truth
    area, mass, cd_max = 0.37, 1.4, 1.6
    drag_m_s2 = 0.5 * 1.225 * rows["airspeed_m_s"] ** 2 * area * cd_max / mass
    force = np.linalg.norm(rows["imu_force_b_m_s2"], axis=1)
    # 1e-3 m/s2 is what JSBSim's gravity at 100 m differs from the ellipsoid's.
    assert (force <= drag_m_s2 + 1e-3).all()
    # One more or less step of AB2 at the start: g x 5 ms / 2.
    np.testing.assert_allclose(rows["v_e_m_s"][4, 2], G_M_S2 * 0.1, rtol=0, atol=0.03)


@pytest.mark.parametrize("w20_m_s", [0.0, 3.0])
def test_mean_specific_force_in_manoeuvres_equals_jsbsims_own(w20_m_s):
    """The force from the change of velocity is JSBSim's force over mass, averaged as its integrator weighs it."""
    plant = JsbsimPlant(start=LEVEL, air=Air((2.0, 0.0, 0.0), w20_m_s), seed=1)
    rows, _, force = flown(plant, 6.0, stirring(plant), lambda m: m.force_and_moment()[0] / m.mass_kg())
    # Adams-Bashforth 2: a step adds 1.5 of the acceleration at its start less 0.5 of that a step before.
    weighed = 1.5 * force - 0.5 * np.concatenate([force[:1], force[:-1]])
    mean = weighed.reshape(len(rows), plant.steps, 3).mean(axis=1)
    error = np.linalg.norm(rows["imu_force_b_m_s2"] - mean, axis=1)
    # The attitude turns within the tick, by up to 0.04 rad: (0.04^2 / 24) x 40 m/s2 = 3e-3; measured 1.5e-3.
    assert np.sqrt(np.mean(error**2)) <= 3e-3
    assert np.ptp(force[:, 2]) > 10.0


def test_mean_gyro_in_manoeuvres_equals_the_rates_that_were_integrated():
    """The rotation vector over a tick is the mean inertial rate of its steps, up to coning within the tick."""
    plant = JsbsimPlant(start=LEVEL)
    names = [f"velocities/{a}i-rad_sec" for a in "pqr"]
    rows, _, rates = flown(plant, 6.0, stirring(plant), lambda m: m.get(*names))
    mean = rates.reshape(len(rows), plant.steps, 3).mean(axis=1)
    # Coning over dt: w x dw dt / 12 = 1.6 rad/s x 0.2 rad/s x 0.02 s / 12 = 5e-4 at most; measured 1e-4.
    np.testing.assert_allclose(rows["imu_omega_b_rad_s"], mean, rtol=0, atol=5e-4)
    assert np.abs(rates).max() > 1.0


def energy_gap(physics_hz):
    """Energy that appears from nowhere in a stirred flight of 4 s, J/kg, largest over the flight."""
    plant = JsbsimPlant(start=LEVEL, rates=Rates(physics_hz=physics_hz))

    def state(m):
        force = m.force_and_moment()[0] / m.mass_kg()
        u, v, w = 0.3048 * m.get("velocities/u-fps", "velocities/v-fps", "velocities/w-fps")
        height = 0.3048 * m.get("position/h-agl-ft")[0]
        return [force @ (u, v, w), 0.5 * (u * u + v * v + w * w) + G_M_S2 * height]

    _, _, seen = flown(plant, 4.0, stirring(plant), state)
    power, energy = seen.T
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1])) / physics_hz])
    return np.abs(energy - energy[0] - work).max()


def test_energy_stirred_flight_balances_to_the_order_of_the_integrator():
    """Kinetic and potential energy change by the work of the forces; the gap falls with the step."""
    coarse, fine = energy_gap(200), energy_gap(400)
    assert coarse < 0.01  # J/kg, of about 100 exchanged; measured 0.0036
    assert 2.5 < coarse / fine < 5.0  # trapezoids on Adams-Bashforth 2: second order, 4


@pytest.mark.parametrize(
    "wind_e", [(6.0, 0.0, 0.0), (-6.0, 0.0, 0.0), (0.0, 6.0, 0.0), (0.0, -6.0, 0.0), (0.0, 0.0, -2.0)]
)
def test_steady_wind_carries_the_flight_along_unchanged(wind_e):
    """Galileo: seen from the moving air the flight is that of still air."""
    still = JsbsimPlant(start=LEVEL)
    windy = JsbsimPlant(start=LEVEL, air=Air(wind_e))
    a, _, _ = flown(still, 4.0, stirring(still))
    b, _, _ = flown(windy, 4.0, stirring(windy))
    # The earth turns: Coriolis 1.5e-4 x 6 m/s x 4 s; and the air is thinner where the wind has lifted it.
    np.testing.assert_allclose(b["v_e_m_s"] - wind_e, a["v_e_m_s"], rtol=0, atol=6e-3)
    np.testing.assert_allclose(b["wind_e_m_s"], [wind_e] * len(b), rtol=0, atol=1e-12)
    drift = b["p_e_m"] - a["p_e_m"]
    np.testing.assert_allclose(drift, b["t_s"][:, None] * np.array(wind_e), rtol=0, atol=0.02)


def test_air_data_in_turbulence_agrees_with_jsbsim():
    """Airspeed, angle of attack and sideslip from our own axes are JSBSim's."""
    plant = JsbsimPlant(start=LEVEL, air=Air((0.0, 3.0, 0.0), 4.0), seed=3)
    rows, _, _ = flown(plant, 3.0, stirring(plant))
    speed_fps, alpha, beta = plant.model.get("velocities/vt-fps", "aero/alpha-rad", "aero/beta-rad")
    last = rows[-1]
    np.testing.assert_allclose(
        [last["airspeed_m_s"], last["alpha_rad"], last["beta_rad"]],
        [0.3048 * speed_fps, alpha, beta],
        rtol=0,
        atol=1e-9,
    )


def test_position_and_velocity_of_the_truth_belong_together():
    """The position is the integral of the velocity, from where the start was asked to be."""
    plant = JsbsimPlant(start=InFlight(heading_rad=-2.0, height_m=80.0, north_m=250.0, east_m=-40.0))
    rows, _, _ = flown(plant, 8.0, stirring(plant))
    v = rows["v_e_m_s"]
    p = rows["p_e_m"][0] + np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (v[1:] + v[:-1]), axis=0)]) * plant.dt_s
    # Discretisation: trapezoids are off by dt^2 / 12 x the change of acceleration, some 100 m/s2: 3e-3; and half
    # a physics step of the change of velocity.
    np.testing.assert_allclose(rows["p_e_m"], p, rtol=0, atol=0.01)
    np.testing.assert_allclose(rows["p_e_m"][0], [250.0, -40.0, -80.0], rtol=0, atol=0.3)


def test_turbulence_strength_follows_the_military_specification():
    """MIL-F-8785C: deviation 0.1 W20 vertically, along the wind that over (0.177 + 0.000823 h_ft)^0.4."""
    gusts = []
    for flight in range(4):
        plant = JsbsimPlant(start=InFlight(0.0, 60.0), air=Air(turbulence_w20_m_s=8.0), seed=5, flight=flight)
        rows, _, _ = flown(plant, 12.0, cruise(plant))
        gusts.append(rows["wind_e_m_s"])
    std = np.concatenate(gusts).std(axis=0)
    vertical = 0.8
    along = vertical / (0.177 + 0.000823 * 197.0) ** 0.4
    # 48 s hold about 10 independent waves along and 30 vertical ones: +-50 % is about three sigma.
    assert 0.5 * vertical < std[2] < 1.5 * vertical
    assert 0.5 * along < std[0] < 1.5 * along


@pytest.mark.parametrize("start", [LEVEL, THROW], ids=["in_flight", "thrown"])
def test_truth_same_seed_is_bit_equal_and_a_reset_plant_equals_a_fresh_one(start):
    """Nothing survives a reset, and the seed is all there is to chance."""
    air = Air((3.0, -2.0, 0.0), 4.0)

    def rows(plant):
        return flown(plant, 4.0, stirring(plant))[0].tobytes()

    plant = JsbsimPlant(start=start, air=air, seed=7)
    first = rows(plant)
    assert rows(plant) == first
    assert rows(JsbsimPlant(start=start, air=air, seed=7)) == first
    assert rows(JsbsimPlant(start=start, air=air, seed=8)) != first
    assert rows(JsbsimPlant(start=start, air=air, seed=7, flight=1)) != first


@pytest.mark.parametrize("wind_e", [(0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (0.0, 5.0, 0.0), (-4.0, 3.0, 0.0)])
@pytest.mark.parametrize("throttle", [0.0, 1.0])
def test_throw_any_wind_and_throttle_releases_at_the_planned_speed_and_rates(wind_e, throttle):
    """27 m/s2 for 0.3 s is 8.1 m/s over the ground along the nose, with the rates that the hand imparts."""
    plant = JsbsimPlant(start=THROW, air=Air(wind_e, 2.0), seed=2)
    rows, outcome, _ = flown(plant, 1.5, lambda _t: ActuatorCommand(0.0, 0.0, 0.0, throttle))
    assert outcome is None
    assert plant.release_s == pytest.approx(1.3, rel=0, abs=1e-12)
    release = rows[round(plant.release_s / plant.dt_s) - 1]
    assert release["phase"] == Phase.THROWN
    # The hand answers to the air and the motor of one step before: 5 ms x the change of their force.
    assert abs(np.linalg.norm(release["v_e_m_s"]) - 8.1) < 0.05  # measured 0.007
    np.testing.assert_allclose(release["omega_b_rad_s"], THROW.release_rate_b_rad_s, rtol=0, atol=0.02)
    nose = release["R_eb"][:, 0] @ release["v_e_m_s"] / np.linalg.norm(release["v_e_m_s"])
    assert nose > math.cos(math.radians(4.0))


def test_truth_across_hold_push_and_flight_is_continuous():
    """No step in attitude, rate, velocity or position where the closed form, the hand and free flight meet."""
    plant = JsbsimPlant(start=THROW, air=Air((0.0, 3.0, 0.0)))
    rows, _, _ = flown(plant, 2.0, lambda _t: ActuatorCommand(0.0, 0.1, 0.0, 0.7))
    assert [int(p) for p in np.unique(rows["phase"])] == [0, 1, 2]
    assert (np.diff(rows["phase"]) >= 0).all()
    turn = [
        np.linalg.norm(Rotation.from_matrix(a.T @ b).as_rotvec())
        for a, b in zip(rows["R_eb"][:-1], rows["R_eb"][1:], strict=True)
    ]
    speed = np.linalg.norm(rows["omega_b_rad_s"], axis=1)
    # A turn over a tick is the rate of one of its ends, within the angular acceleration of 20 rad/s2 at most.
    assert (np.array(turn) <= (np.maximum(speed[1:], speed[:-1]) + 20 * 0.02) * 0.02).all()
    assert np.abs(np.diff(rows["omega_b_rad_s"], axis=0)).max() < 20 * 0.02
    assert np.abs(np.diff(rows["v_e_m_s"], axis=0)).max() < 30 * 0.02
    middle = 0.5 * (rows["v_e_m_s"][1:] + rows["v_e_m_s"][:-1]) * 0.02
    # Half a physics step of the largest acceleration: 0.5 x 27 x 0.005 x 0.02.
    np.testing.assert_allclose(np.diff(rows["p_e_m"], axis=0), middle, rtol=0, atol=2e-3)


def test_accelerometer_in_the_push_reads_the_push_and_gravity():
    """Along the nose: 27 m/s2 plus g times the sine of the pitch angle."""
    rows, _, _ = flown(JsbsimPlant(start=THROW), 1.3, lambda _t: NEUTRAL)
    pushed = rows[rows["phase"] == Phase.THROWN]
    expected = 27.0 - G_M_S2 * pushed["R_eb"][:, 2, 0]
    np.testing.assert_allclose(pushed["imu_force_b_m_s2"][:, 0], expected, rtol=0, atol=0.03)


def test_push_brings_the_speed_and_the_rates_evenly_from_rest_to_release():
    """After the time t of the push: t times 27 m/s2 along the nose, and the part t / 0.3 s of the way to its rates."""
    throw = replace(THROW, release_rate_b_rad_s=(1.5, -1.0, 0.8), sway_rad_s=(0.0, 0.0, 0.0))
    rows, _, _ = flown(JsbsimPlant(start=throw), 1.3, lambda _t: NEUTRAL)
    pushed = rows[rows["phase"] == Phase.THROWN]
    assert len(pushed) == 15
    into_s = 0.02 * np.arange(1, 16)
    # The hand answers to forces and moments of one step before, and what they have changed by is left over.
    np.testing.assert_allclose(
        pushed["omega_b_rad_s"], np.outer(into_s / 0.3, throw.release_rate_b_rad_s), rtol=0, atol=0.01
    )
    # The gyro's mean is that of four steps of a straight line, each with the rate that it ends with: half a step ahead.
    np.testing.assert_allclose(
        pushed["imu_omega_b_rad_s"],
        np.outer((into_s - 0.01) / 0.3, throw.release_rate_b_rad_s),
        rtol=0,
        atol=0.5 * 0.005 / 0.3 * 1.5 + 0.01,
    )
    np.testing.assert_allclose(np.linalg.norm(pushed["v_e_m_s"], axis=1), 27.0 * into_s, rtol=5e-3, atol=0.01)


def test_stirred_flight_finer_physics_converges():
    """The place after 5 s draws nearer to that at 1000 Hz with every finer step."""
    ends = {}
    for hz in (100, 200, 400, 1000):
        plant = JsbsimPlant(start=LEVEL, rates=Rates(physics_hz=hz))
        ends[hz] = flown(plant, 5.0, stirring(plant))[0]["p_e_m"][-1]
    gaps = [np.linalg.norm(ends[hz] - ends[1000]) for hz in (100, 200, 400)]
    assert gaps[0] > 1.5 * gaps[1] > 1.5 * 1.5 * gaps[2]
    assert gaps[1] < 0.5  # m


def test_outcome_glide_into_the_ground_is_ground_contact():
    """With the motor off at 3 m the flight ends on the ground, at a height of less than the wing's reach."""
    plant = JsbsimPlant(start=InFlight(0.0, 3.0))
    rows, outcome, _ = flown(plant, 20.0, lambda _t: NEUTRAL)
    assert outcome is Outcome.GROUND_CONTACT
    assert -0.3 < -rows["p_e_m"][-1, 2] < 0.5


def test_outcome_flying_out_of_the_box_is_left_box():
    """The flight ends where the box does."""
    plant = JsbsimPlant(start=InFlight(0.0, 60.0), box=FlightBox(radius_m=50.0))
    rows, outcome, _ = flown(plant, 20.0, cruise(plant))
    assert outcome is Outcome.LEFT_BOX
    assert 50.0 < np.hypot(*rows["p_e_m"][-1, :2]) < 50.3


def test_outcome_not_a_number_is_diverged():
    """A motion that is no number ends the flight with the time and what it was."""
    plant = JsbsimPlant(start=LEVEL)
    plant.reset(Log.empty(2))
    plant.begin((0.0, 0.0, -100.0), (0.0, 0.0, 0.0), np.array([math.nan, 0.0, 0.0]))
    with pytest.raises(SimulationDiverged, match=r"diverged at 0\.02 s: nan m/s"):
        plant.advance(0, NEUTRAL)
    _, outcome, _ = flown(plant, 1.0, cruise(plant))
    assert outcome is None  # and a reset brings it back


def test_unknown_aircraft_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match="unknown aircraft 'endurence': choose endurance"):
        JsbsimPlant("endurence", start=LEVEL)


def test_missing_property_is_refused_by_name():
    with pytest.raises(ValueError, match="no property 'aero/typo'"):
        Model("endurance", 200).getter("aero/typo")


@pytest.mark.parametrize(
    ("field", "value"), [("sway_hz", (0.5, 0.0, 0.5)), ("push_m_s2", 0.0), ("push_s", math.nan), ("height_m", 0.0)]
)
def test_impossible_throw_is_refused_naming_the_field(field, value):
    values = {name: getattr(THROW, name) for name in THROW.__dataclass_fields__} | {field: value}
    with pytest.raises(ValueError, match=field):
        JsbsimPlant(start=HandThrow(**values))


@pytest.mark.parametrize("wind", [(math.nan, 0.0, 0.0), (0.0, 80.0, 0.0), (1.0, 2.0)])
def test_air_that_is_no_wind_is_refused(wind):
    with pytest.raises(ValueError, match="m/s"):
        Air(wind)


def test_airspeed_without_a_trim_is_refused():
    with pytest.raises(ValueError, match=r"airspeed_m_s 40\.0 m/s: no level trim"):
        JsbsimPlant(start=InFlight(0.0, airspeed_m_s=40.0))
