"""JSBSim as a Plant.

A tick consists of four writes, a few physics steps without reads, and one packed read that a kernel converts to the
truth row in SI units.  The inertial means of the row come from the change of attitude and velocity over the tick
(`sim.truth.integrate_imu`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from struct import Struct

import numpy as np

from autopilot.interface import NEUTRAL, ActuatorCommand
from estimator.blocks.air import true_over_equivalent
from estimator.compiler.jit import kernel
from estimator.interface import Array
from sim.aeroplane import hand
from sim.aeroplane.actuators import Actuators
from sim.aeroplane.battery import BatteryParams
from sim.aeroplane.built import AS_DRAWN, AsBuilt
from sim.aeroplane.jsbsim_model import FT_TO_M, LB_TO_N, WIND, Model
from sim.aeroplane.trim import Trim, trim
from sim.air import STILL, Air, MovingAir
from sim.clock import Rates
from sim.faults import Fault
from sim.log import Log, Outcome, Phase
from sim.place import LAUNCH_PLACE, Place
from sim.plant import HandThrow, InFlight, SimulationDiverged, Start
from sim.terrain import ground_height_m, moved_m
from sim.truth import earth_rate_e_rad_s, gravity_m_s2, integrate_imu

# Read after each tick: field of the state record, JSBSim properties.
READ: dict[str, tuple[str, ...]] = {
    "euler_rad": ("attitude/phi-rad", "attitude/theta-rad", "attitude/psi-rad"),
    "omega_b_rad_s": ("velocities/pi-rad_sec", "velocities/qi-rad_sec", "velocities/ri-rad_sec"),
    "place": ("position/lat-geod-rad", "position/long-gc-rad", "position/geod-alt-ft"),
    "v_e_fps": ("velocities/v-north-fps", "velocities/v-east-fps", "velocities/v-down-fps"),
    "wind_e_fps": tuple(f"atmosphere/total-wind-{d}-fps" for d in ("north", "east", "down")),
    "surfaces": ("servo/aileron", "servo/elevator", "servo/rudder", "fcs/throttle-pos-norm"),
    "motor": ("propulsion/engine/propeller-rpm", "propulsion/engine/thrust-lbs"),
    "contact": ("forces/fbz-gear-lbs",),
}
# Rates of the air, subtracted in the damping terms of the models (those of JSBSim's turbulence cannot be set).
AIR_RATES = tuple(f"gust/{a}-rad_sec" for a in "pqr")
STATE_DTYPE = np.dtype(
    [
        *((name, "f8", (len(properties),)) for name, properties in READ.items()),  # packed into the first bytes
        ("R_eb", "f8", (3, 3)),  # at the end of the previous tick
        ("v_e_m_s", "f8", (3,)),
        ("p_e_m", "f8", (3,)),
        ("latitude_rad", "f8"),  # there
        ("longitude_rad", "f8"),
        ("elevation_m", "f8"),  # of the launch point
        ("ground_m", "f8"),  # see `sim.place.Place`
        ("ground_from_m", "f8"),
        ("earth_rate_e", "f8", (3,)),
        ("g_m_s2", "f8"),
        ("dt_s", "f8"),
        ("box_radius_m", "f8"),
        ("box_height_m", "f8"),
    ],
    align=True,
)
MOVING_PARTS = ("aileron", "elevator", "rudder", "throttle", "rotor_rpm", "thrust_n")  # at rest in the hand
OUTCOMES = (None, Outcome.GROUND_CONTACT, Outcome.LEFT_BOX, Outcome.DIVERGED)


@dataclass(frozen=True, slots=True)
class FlightBox:
    """A cylinder around the launch point; leaving it ends the flight."""

    radius_m: float = 3000.0
    height_m: float = 1000.0


@kernel
def rotation_of(roll_rad, pitch_rad, yaw_rad, R_eb):  # type: ignore[no-untyped-def]
    """Write into `R_eb` the body-to-earth rotation of the Euler angles (Etkin & Reid, section 4.4)."""
    cr, sr = np.cos(roll_rad), np.sin(roll_rad)
    cp, sp = np.cos(pitch_rad), np.sin(pitch_rad)
    cy, sy = np.cos(yaw_rad), np.sin(yaw_rad)
    R_eb[0, 0], R_eb[0, 1], R_eb[0, 2] = cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy
    R_eb[1, 0], R_eb[1, 1], R_eb[1, 2] = cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy
    R_eb[2, 0], R_eb[2, 1], R_eb[2, 2] = -sp, sr * cp, cr * cp


@kernel
def complete(truth, k, state):  # type: ignore[no-untyped-def]
    """Compute inertial means, airspeed, alpha, beta and time of row k from its attitude, velocity and wind."""
    row, s = truth[k], state[0]
    integrate_imu(s.R_eb, s.v_e_m_s, row, s.dt_s, s.g_m_s2, s.earth_rate_e)
    R = row.R_eb
    v_e, wind_e = row.v_e_m_s, row.wind_e_m_s
    an, ae, ad = v_e[0] - wind_e[0], v_e[1] - wind_e[1], v_e[2] - wind_e[2]
    u = R[0, 0] * an + R[1, 0] * ae + R[2, 0] * ad
    v = R[0, 1] * an + R[1, 1] * ae + R[2, 1] * ad
    w = R[0, 2] * an + R[1, 2] * ae + R[2, 2] * ad
    row.t_s = (k + 1) * s.dt_s
    row.airspeed_m_s = np.sqrt(u * u + v * v + w * w)
    row.alpha_rad = np.arctan2(w, u)
    row.beta_rad = np.arctan2(v, np.sqrt(u * u + w * w))
    for i in range(3):
        s.v_e_m_s[i] = row.v_e_m_s[i]
        for j in range(3):
            s.R_eb[i, j] = R[i, j]


@kernel
def move(s, row):  # type: ignore[no-untyped-def]
    """Set the position of `row`: the integral of the local velocity, see `sim.place`; down is from the altitude."""
    altitude_m = FT_TO_M * s.place[2]
    middle_rad = 0.5 * (s.latitude_rad + s.place[0])
    north_m, east_m = moved_m(middle_rad, s.place[0] - s.latitude_rad, s.place[1] - s.longitude_rad, altitude_m)
    row.p_e_m[0], row.p_e_m[1] = s.p_e_m[0] + north_m, s.p_e_m[1] + east_m
    row.p_e_m[2] = s.elevation_m - altitude_m
    s.latitude_rad, s.longitude_rad = s.place[0], s.place[1]
    for i in range(3):
        s.p_e_m[i] = row.p_e_m[i]


@kernel
def observe(truth, k, state):  # type: ignore[no-untyped-def]
    """Convert the JSBSim state to truth row k, in SI; returns the index of the outcome in OUTCOMES, 0 to continue."""
    row, s = truth[k], state[0]
    rotation_of(s.euler_rad[0], s.euler_rad[1], s.euler_rad[2], row.R_eb)
    rate2 = speed2 = 0.0
    for i in range(3):
        row.omega_b_rad_s[i] = s.omega_b_rad_s[i]
        row.v_e_m_s[i] = FT_TO_M * s.v_e_fps[i]
        row.wind_e_m_s[i] = FT_TO_M * s.wind_e_fps[i]
        rate2 += row.omega_b_rad_s[i] ** 2
        speed2 += row.v_e_m_s[i] ** 2
    move(s, row)
    row.aileron, row.elevator, row.rudder, row.throttle = s.surfaces[0], s.surfaces[1], s.surfaces[2], s.surfaces[3]
    row.phase = 2  # flying
    row.rotor_rpm, row.thrust_n = s.motor[0], LB_TO_N * s.motor[1]
    complete(truth, k, state)
    n, e, d = row.p_e_m[0], row.p_e_m[1], row.p_e_m[2]
    if not (rate2 < 1e4 and speed2 < 4e4 and abs(d) < 1e6 and abs(s.euler_rad[0]) < 10.0):  # NaN fails too
        return 3
    if s.contact[0] != 0.0 or (s.ground_m != 0.0 and -d < ground_height_m(n, e, s.ground_m, s.ground_from_m)):
        return 1
    if n * n + e * e > s.box_radius_m**2 or -d > s.box_height_m:
        return 2
    return 0


class JsbsimPlant:
    """An aeroplane flown by JSBSim.

    Parameters
    ----------
    aircraft : name of a folder of `sim/aircraft`
    start : in the air or thrown by hand
    air : wind, gusts, turbulence, thermals
    rates : physics and inertial rates
    seed, flight : of the random streams (used here only by turbulence)
    box : limits of the flight; a start outside is rejected
    place : launch place, and the ground around it
    faults : of surfaces and motor (`sim.aeroplane.actuators`)
    battery : None gives a constant voltage
    built : how the aeroplane differs from its drawing

    Raises ValueError for an unknown aircraft, an impossible start or fault, or a battery without a motor.
    """

    def __init__(
        self, aircraft: str = "endurance", *, start: Start, air: Air = STILL, rates: Rates | None = None,
        seed: int = 0, flight: int = 0, box: FlightBox | None = None, place: Place = LAUNCH_PLACE,
        faults: Sequence[Fault] = (), battery: BatteryParams | None = None, built: AsBuilt = AS_DRAWN,
    ) -> None:  # fmt: skip
        rates = rates or Rates()
        box = box or FlightBox()
        self.start, self.air = start, air
        self.dt_s, self.steps = rates.dt_s, rates.steps_per_tick
        self._physics_hz, self._aircraft, self._built, self.place = rates.physics_hz, aircraft, built, place
        self._hold_ticks = self._release_tick = self._hand_ticks = 0
        if isinstance(start, HandThrow):
            hand.check(start)
            self._hold_ticks = rates.ticks(start.hold_s)
            self._release_tick = self._hold_ticks + max(1, rates.ticks(start.push_s))
            self._hand_ticks = self._release_tick + 1  # the first tick of the flight restores the integrator
        self.release_s = self._release_tick * self.dt_s
        self._faults, self._battery = tuple(faults), battery
        self._load()
        span_m = FT_TO_M * float(self.model.get("metrics/bw-ft")[0])
        self._moving_air = MovingAir(air, span_m, self.dt_s, self.release_s, seed, flight, place)
        self._air_moves = not air.is_steady
        self.airframe = self.model.airframe
        self.trimmed = Trim.of(self.airframe["cruise"])
        if isinstance(start, InFlight):
            if not (math.isfinite(start.heading_rad) and 0.0 < start.height_m < 10_000.0):
                raise ValueError(
                    f"height_m {start.height_m} m: must be above 0 and below 10000 m, with a finite heading"
                )
            out_m = math.hypot(start.north_m, start.east_m)
            if not (out_m < box.radius_m and start.height_m < box.height_m):
                raise ValueError(
                    f"start {out_m:g} m out and {start.height_m:g} m high: must be inside the flight box, "
                    f"box_radius_m {box.radius_m:g} m and box_height_m {box.height_m:g} m"
                )
            airspeed_m_s = start.airspeed_m_s
            if airspeed_m_s is None:  # the same pressure on the wing
                airspeed_m_s = self.trimmed.airspeed_m_s * true_over_equivalent(place.elevation_m)
            self.trimmed = trim(self.model, airspeed_m_s, start.height_m, heading_rad=start.heading_rad)
        self._state = np.zeros(1, STATE_DTYPE)
        self._buffer = self._state.data
        s = self._state[0]
        s["earth_rate_e"] = earth_rate_e_rad_s(place.latitude_rad)
        s["g_m_s2"] = gravity_m_s2(place.latitude_rad, place.elevation_m)
        s["elevation_m"], s["ground_m"], s["ground_from_m"] = place.elevation_m, place.ground_m, place.ground_from_m
        s["dt_s"], s["box_radius_m"], s["box_height_m"] = self.dt_s, box.radius_m, box.height_m

    def _load(self) -> None:
        """A new JSBSim for each flight: a diverged state survives any reset."""
        self.model = Model(self._aircraft, self._physics_hz, self._built, self.place)
        self._getters = [self.model.getter(p) for properties in READ.values() for p in properties]
        self._aileron, self._elevator, self._rudder, self._throttle = self.model.servo_setters()
        self._wind = tuple(self.model.setter(p) for p in WIND)
        self._air_rates = tuple(self.model.setter(p) for p in AIR_RATES if self.model.has(p))
        self._terrain = self.model.setter("position/terrain-elevation-asl-ft")
        self._pack = Struct(f"{len(self._getters)}d").pack_into
        self.actuators: Actuators | None = None
        if self._faults or self._battery is not None:
            self.actuators = Actuators(self.model, self._faults, self._battery, self.release_s, self.dt_s)

    def reset(self, log: Log) -> None:
        """Put the aeroplane at its start; the rows of `log` are filled from tick 0."""
        self._load()
        self._truth = log.truth
        s = self._state[0]
        start = self.start
        if isinstance(start, HandThrow):
            self._moving_air.start(len(log), (0.0, 0.0, -start.height_m))
            rotation_of(*hand.sway(start, 0.0)[0], s["R_eb"])
            s["v_e_m_s"] = 0.0
        else:
            self._moving_air.start(len(log), (start.north_m, start.east_m, -start.height_m))
            self._start_in_flight(start)

    def _start_in_flight(self, start: InFlight) -> None:
        """Trimmed relative to the moving air, heading as in the start; servos and propeller as in the trim."""
        t = self.trimmed
        euler_rad = t.euler_rad(start.heading_rad)
        R_eb = np.empty((3, 3))
        rotation_of(*euler_rad, R_eb)
        v_b = t.air_velocity_b_m_s + R_eb.T @ self._moving_air.wind_e_m_s
        self.begin((start.north_m, start.east_m, -start.height_m), euler_rad, v_b, command=t.command)

    def begin(
        self, p_e_m: tuple[float, float, float], euler_rad: tuple[float, float, float], v_b_m_s: Array,
        omega_b_rad_s: tuple[float, float, float] = (0.0, 0.0, 0.0), command: ActuatorCommand = NEUTRAL,
        settle_s: float = 1.0,
    ) -> None:  # fmt: skip
        """Put the aeroplane into any state, from which it continues.

        p_e_m : (north, east, down) from the launch point       euler_rad : roll, pitch, yaw
        v_b_m_s : (3,) velocity over the ground, body axes      omega_b_rad_s : body rates relative to the earth
        command : servo positions                               settle_s : time for the propeller speed to settle
        """
        s = self._state[0]
        rotation_of(*euler_rad, s["R_eb"])
        s["v_e_m_s"] = s["R_eb"] @ v_b_m_s
        settle = max(1, round(settle_s / self.model.dt_s))
        ground_m = self.place.ground_at_m(p_e_m[0], p_e_m[1])
        self.model.place(-p_e_m[2], euler_rad, v_b_m_s, omega_b_rad_s, command, self.air, settle, ground_m)
        self._anchor(p_e_m)
        if self._air_moves:
            self._blow(*self._moving_air.now)

    def _anchor(self, p_e_m: tuple[float, float, float]) -> None:
        """Define the current position of JSBSim as `p_e_m`."""
        s = self._state[0]
        s["p_e_m"], (s["latitude_rad"], s["longitude_rad"], _) = p_e_m, self.model.get(*READ["place"])

    def advance(self, k: int, command: ActuatorCommand) -> Outcome | None:
        """Fly tick `k` with `command` and fill truth row k; an Outcome if the flight ended in it."""
        if self._air_moves:
            self._blow(*self._moving_air.blow(self._truth, k))
        if k < self._hand_ticks:
            return self._in_hand(k, command)
        self._command(k, command)
        if self.place.ground_m:
            self._raise_ground()
        run = self.model.run
        try:
            for _ in range(self.steps):
                run()
        except RuntimeError as error:  # raised by JSBSim, which cannot continue
            raise SimulationDiverged(f"JSBSim failed at {k * self.dt_s:.2f} s: {error}") from error
        return self._observe(k)

    def _blow(self, *air: float) -> None:
        """Set the wind (3) and the rates of the air (3), constant over the tick."""
        for write, speed_m_s in zip(self._wind, air[:3], strict=True):
            write(speed_m_s / FT_TO_M)
        for write, rate_rad_s in zip(self._air_rates, air[3:], strict=False):  # optional in a model
            write(rate_rad_s)

    def _raise_ground(self) -> None:
        """Put the ground of JSBSim at its height below the aeroplane, where that does not reach it."""
        north_m, east_m, down_m = self._state[0]["p_e_m"].tolist()
        ground_m = min(self.place.ground_at_m(north_m, east_m), -down_m)
        self._terrain((self.place.elevation_m + ground_m) / FT_TO_M)

    def _command(self, k: int, command: Sequence[float]) -> None:
        if self.actuators is not None:
            command = self.actuators.move(k, command)
        self._aileron(command[0])
        self._elevator(command[1])
        self._rudder(command[2])
        self._throttle(command[3])

    def _observe(self, k: int) -> Outcome | None:
        self._pack(self._buffer, 0, *[read() for read in self._getters])
        ended = OUTCOMES[observe(self._truth, k, self._state)]
        if ended is Outcome.DIVERGED:
            speed_m_s, rate_rad_s = (np.linalg.norm(self._truth[name][k]) for name in ("v_e_m_s", "omega_b_rad_s"))
            raise SimulationDiverged(
                f"the simulation diverged at {(k + 1) * self.dt_s:.2f} s: {speed_m_s:.3g} m/s, {rate_rad_s:.3g} rad/s"
            )
        return ended

    def run_bare(self, n_ticks: int) -> None:
        """Run the physics of `n_ticks` only, with constant commands, as the reference of benchmarks."""
        run = self.model.run
        for _ in range(n_ticks * self.steps):
            run()

    def _in_hand(self, k: int, command: ActuatorCommand) -> Outcome | None:
        """Tick k of a throw, up to and including the first tick of the flight."""
        start = self.start
        if not isinstance(start, HandThrow):
            raise TypeError("only a thrown aeroplane is held in the hand")
        if k < self._hold_ticks:
            self._hold(start, k)
            return None
        if k == self._hold_ticks:
            self._begin_push(start)
        self._command(k, command)
        first = (k - self._hold_ticks) * self.steps
        last = (self._release_tick - self._hold_ticks) * self.steps
        for step in range(first + 1, first + self.steps + 1):
            # A force set before a run acts in the next one; none may remain for the first step of the flight.
            if step < last:
                self._push(start, (step + 1) / last)
            elif step == last:
                self._set_hand(np.zeros(3), np.zeros(3))
            self.model.run()
        outcome = self._observe(k)
        if k < self._release_tick:
            self._truth[k]["phase"] = Phase.THROWN
        else:
            self.model.remember(True)
        return outcome

    def _hold(self, start: HandThrow, k: int) -> None:
        """Truth row k in the hand: at rest at the launch point except for the sway."""
        euler_rad, rates = hand.sway(start, (k + 1) * self.dt_s)
        row = self._truth[k]
        for name in MOVING_PARTS:
            row[name] = 0.0
        rotation_of(*euler_rad, row["R_eb"])
        row["omega_b_rad_s"] = np.array(rates) + row["R_eb"].T @ self._state[0]["earth_rate_e"]
        row["p_e_m"] = (0.0, 0.0, -start.height_m)
        row["v_e_m_s"] = 0.0
        row["wind_e_m_s"] = self._moving_air.wind_e_m_s
        row["phase"] = Phase.HELD
        complete(self._truth, k, self._state)

    def _begin_push(self, start: HandThrow) -> None:
        """JSBSim takes over from the closed form, with the hand already pushing."""
        euler_rad, rates = hand.sway(start, self._hold_ticks * self.dt_s)
        self._rates_at_push = np.array(rates)
        self.begin((0.0, 0.0, -start.height_m), euler_rad, np.zeros(3), rates, settle_s=0.0)
        self._set_hand(np.zeros(3), np.zeros(3))
        self._push(start, 1.0 / ((self._release_tick - self._hold_ticks) * self.steps))
        self.model.frozen(1)
        self._anchor((0.0, 0.0, -start.height_m))
        self.model.remember(False)

    def _push(self, start: HandThrow, part: float) -> None:
        """Set force and moment of the hand for the rates wanted after the fraction `part` of the push."""
        force, moment = self.model.force_and_moment()
        others = force - self._hand[0], moment - self._hand[1]
        wanted = (1.0 - part) * self._rates_at_push + part * np.array(start.release_rate_b_rad_s)
        R_eb = np.empty((3, 3))
        rotation_of(*self.model.get(*READ["euler_rad"]), R_eb)
        self._set_hand(
            *hand.guide(
                R_eb, self.model.coming_rates(), wanted, others, start.push_m_s2,
                float(self._state[0]["g_m_s2"]), self.model.mass_kg(), self.model.inertia_kg_m2(), self.model.dt_s,
            )
        )  # fmt: skip

    def _set_hand(self, force_b_n: Array, moment_b_nm: Array) -> None:
        self._hand = force_b_n, moment_b_nm
        self.model.push(force_b_n, moment_b_nm)
