"""Trimmed flight by root finding: attitude and commands at zero acceleration.

A steady flight is ten numbers (`Trim`): speed, flow angles, bank, climb, turn rate and four commands.  JSBSim gives
six accelerations.  Four of the ten numbers are given and Newton's method finds the other six; level flight, climb,
glide and steady turn differ only in the choice.

JSBSim's trim is not used: it needs throttle to balance the drag, which a glider lacks, and integrates a propeller this
small with an unstable step.

References
----------
Stevens, B. L. and Lewis, F. L., "Aircraft Control and Simulation", 2nd ed., 2003, section 3.6: steady-state flight,
the rate-of-climb constraint and the kinematics of the steady turn.
Broyden, C. G., "A class of methods for solving nonlinear simultaneous equations", Math. Comp. 19, 1965.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from autopilot.interface import ActuatorCommand
from estimator.interface import Array
from sim.air import STILL

if TYPE_CHECKING:
    from sim.aeroplane.jsbsim_model import Model

TOLERANCE = 1e-10  # of the accelerations, m/s2 and rad/s2; JSBSim's round-off leaves about 1e-12
G_M_S2 = 9.81  # for first guesses only

# Possible unknowns: minimum, maximum, and largest change in one step of the search.
BOUNDS: dict[str, tuple[float, float, float]] = {
    "airspeed_m_s": (0.5, 100.0, 2.0),
    "alpha_rad": (-0.6, 1.2, 0.05),
    "beta_rad": (-0.5, 0.5, 0.05),
    "roll_rad": (-1.5, 1.5, 0.2),
    "climb_rad": (-1.5, 1.5, 0.2),
    "turn_rate_rad_s": (-20.0, 20.0, 0.5),
    "aileron": (-1.0, 1.0, 0.3),
    "elevator": (-1.0, 1.0, 0.3),
    "rudder": (-1.0, 1.0, 0.3),
    "throttle": (0.0, 1.0, 0.3),
}


@dataclass(frozen=True, slots=True)
class Trim:
    """A steady flight; speed and angles relative to the air, commands in -1..1, throttle in 0..1.

    alpha_rad, beta_rad : angles of attack and sideslip         roll_rad : bank angle (Euler)
    climb_rad : angle of the path through the air, + upwards    turn_rate_rad_s : rate of change of heading
    """

    airspeed_m_s: float
    alpha_rad: float
    elevator: float
    throttle: float
    aileron: float = 0.0
    rudder: float = 0.0
    beta_rad: float = 0.0
    roll_rad: float = 0.0
    climb_rad: float = 0.0
    turn_rate_rad_s: float = 0.0

    @classmethod
    def of(cls, cruise: dict[str, Any]) -> "Trim":
        """From the table `cruise` of an airframe.toml; a glide without a motor."""
        alpha_rad, climb_rad = math.radians(cruise["alpha_deg"]), math.radians(cruise.get("flight_path_deg", 0.0))
        return cls(cruise["airspeed_m_s"], alpha_rad, cruise["elevator"], cruise["throttle"], climb_rad=climb_rad)

    @property
    def command(self) -> ActuatorCommand:
        return ActuatorCommand(self.aileron, self.elevator, self.rudder, self.throttle)

    @property
    def climb_m_s(self) -> float:
        """Rate of climb through the air."""
        return self.airspeed_m_s * math.sin(self.climb_rad)

    @property
    def pitch_rad(self) -> float:
        """Pitch angle for the climb angle (Stevens & Lewis, section 3.6, rate-of-climb constraint)."""
        a = math.cos(self.alpha_rad) * math.cos(self.beta_rad)
        b = math.sin(self.roll_rad) * math.sin(self.beta_rad)
        b += math.cos(self.roll_rad) * math.sin(self.alpha_rad) * math.cos(self.beta_rad)
        sine = math.sin(self.climb_rad)
        return math.atan2(a * b + sine * math.sqrt(max(a * a - sine * sine + b * b, 0.0)), a * a - sine * sine)

    def euler_rad(self, heading_rad: float = 0.0) -> tuple[float, float, float]:
        return self.roll_rad, self.pitch_rad, heading_rad

    @property
    def air_velocity_b_m_s(self) -> Array:
        """Velocity through the air, body axes, shape (3,)."""
        across = math.cos(self.beta_rad)
        forward, down = across * math.cos(self.alpha_rad), across * math.sin(self.alpha_rad)
        return self.airspeed_m_s * np.array([forward, math.sin(self.beta_rad), down])

    @property
    def omega_b_rad_s(self) -> tuple[float, float, float]:
        """Body rates of a turn about the vertical (Stevens & Lewis, section 3.6)."""
        rate, roll, pitch = self.turn_rate_rad_s, self.roll_rad, self.pitch_rad
        return (
            -rate * math.sin(pitch),
            rate * math.sin(roll) * math.cos(pitch),
            rate * math.cos(roll) * math.cos(pitch),
        )


def earth_to_body(vector_e: Sequence[float] | Array, euler_rad: tuple[float, float, float]) -> Array:
    """Body components of a vector given in earth axes, for roll, pitch and yaw (Stevens & Lewis, section 1.3)."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(euler_rad), np.cos(euler_rad)
    n, e, d = vector_e
    along, across = cy * n + sy * e, cy * e - sy * n
    ahead, below = cp * along - sp * d, sp * along + cp * d
    return np.array([ahead, cr * across + sr * below, cr * below - sr * across])


def accelerations(
    model: "Model", t: Trim, height_m: float, heading_rad: float = 0.0, wind_e_m_s: Sequence[float] = STILL.wind_e_m_s
) -> Array:
    """Accelerations at `t` with the propeller turning steadily, shape (6,).

    Rates of change of the velocity through the air, in body axes [m/s2], and of the body rates [rad/s2].  In a turn
    the body components of the wind change, and so does the velocity over the ground; that part is removed.
    """
    euler_rad, omega_b = t.euler_rad(heading_rad), t.omega_b_rad_s
    wind_b = earth_to_body(wind_e_m_s, euler_rad)
    settled(model, height_m, euler_rad, t.air_velocity_b_m_s + wind_b, omega_b, t.command, wind_e_m_s)
    a = model.accelerations()
    p, q, r = omega_b
    u, v, w = wind_b
    a[:3] += (q * w - r * v, r * u - p * w, p * v - q * u)
    return a


def settled(
    model: "Model", height_m: float, euler_rad: tuple[float, float, float], v_b_m_s: Array,
    omega_b_rad_s: tuple[float, float, float], command: ActuatorCommand,
    wind_e_m_s: Sequence[float] = STILL.wind_e_m_s,
) -> None:  # fmt: skip
    """Put `model` into a state (velocity over the ground) with the propeller at its steady speed."""
    n, e, d = wind_e_m_s
    air = replace(STILL, wind_e_m_s=(float(n), float(e), float(d)))
    model.place(height_m, euler_rad, v_b_m_s, omega_b_rad_s, command, air, 1)
    model.settle()


@dataclass(slots=True)
class Search:
    """Newton's method for six numbers of a trim, with Broyden updates of the Jacobian between evaluations.

    model, height_m, heading_rad, wind_e_m_s : aeroplane, place and air
    free : names of the six unknown fields of `Trim`
    """

    model: "Model"
    free: tuple[str, ...]
    height_m: float = 60.0
    heading_rad: float = 0.0
    wind_e_m_s: Sequence[float] = STILL.wind_e_m_s

    def at(self, guess: Trim, x: Array) -> Trim:
        return replace(guess, **{name: float(v) for name, v in zip(self.free, x, strict=True)})

    def remaining(self, t: Trim) -> Array:
        return accelerations(self.model, t, self.height_m, self.heading_rad, self.wind_e_m_s)

    def jacobian(self, t: Trim, f: Array) -> Array:
        """Forward differences of the accelerations `f` at `t`, inwards from a bound, shape (6, 6)."""
        columns = []
        for name in self.free:
            _, high, most = BOUNDS[name]
            here = getattr(t, name)
            h = 1e-5 * most if here + 1e-5 * most <= high else -1e-5 * most
            columns.append((self.remaining(replace(t, **{name: here + h})) - f) / h)
        return np.array(columns).T

    def run(self, guess: Trim) -> tuple[Trim, Array, Array]:
        """Result of the search: the trim, its accelerations, and the target of the last step, in order of `free`."""
        low, high, most = np.array([BOUNDS[name] for name in self.free]).T
        x = np.clip([getattr(guess, name) for name in self.free], low, high)
        f = self.remaining(self.at(guess, x))
        J, fresh, wanted, stuck = np.zeros((6, 6)), False, x, 0
        for _ in range(80):
            if np.max(np.abs(f)) < TOLERANCE or stuck > 3 or not np.all(np.isfinite(f)):
                break
            if not fresh:
                J = self.jacobian(self.at(guess, x), f)
            step = _newton(J, f)
            wanted = x + step
            step *= min(1.0, 1.0 / float(np.max(np.abs(step / most))))
            x_new = np.clip(x + step, low, high)
            f_new = self.remaining(self.at(guess, x_new))
            taken, better = (x_new - x) / most, np.linalg.norm(f_new) < 0.5 * np.linalg.norm(f)
            stuck = 0 if np.max(np.abs(taken)) > 1e-3 or better else stuck + 1
            # Broyden: the smallest change of the Jacobian consistent with this step.
            if better:
                J = J + np.outer(f_new - f - J @ (x_new - x), taken / most) / max(float(taken @ taken), 1e-300)
            x, f, fresh = x_new, f_new, bool(better)
        return self.at(guess, x), f, wanted


def _newton(J: Array, f: Array) -> Array:
    """The Newton step; the shortest least-squares step if the Jacobian is singular."""
    try:
        return np.asarray(np.linalg.solve(J, -f), np.float64)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(J, -f, rcond=1e-12)[0], np.float64)


def trim(
    model: "Model", airspeed_m_s: float, height_m: float = 60.0, *, climb_rad: float | None = None,
    throttle: float | None = None, bank_rad: float = 0.0, heading_rad: float = 0.0,
    wind_e_m_s: Sequence[float] = STILL.wind_e_m_s, guess: Trim | None = None,
) -> Trim:  # fmt: skip
    """Find the steady flight at `airspeed_m_s`; by default level, or gliding without a motor.

    Parameters
    ----------
    model : the aeroplane               airspeed_m_s, height_m : through the air, above the ground
    climb_rad : climb angle through the air; the throttle is found
    throttle : 0..1, 0 is a glide; the climb angle is found
    bank_rad : of a steady turn, + to the right; 0 is straight flight, with the tiny bank due to the earth's rotation
    heading_rad, wind_e_m_s : of the nose and of the air; they matter only through the earth's rotation
    guess : a trim nearby, to start from

    The sideslip is zero.  An aeroplane without ailerons is controlled in roll by sideslip and dihedral: for it the
    sideslip is found instead of the aileron.

    Raises
    ------
    ValueError    there is no such flight; the message says why
    """
    if climb_rad is not None and throttle is not None:
        raise ValueError(f"climb_rad {climb_rad} and throttle {throttle}: give one, the other follows from it")
    if throttle is None and climb_rad is None and not model.powered:
        throttle = 0.0
    _check(model, airspeed_m_s, climb_rad, throttle, bank_rad)
    start = _guess(model, airspeed_m_s, bank_rad) if guess is None else replace(guess, airspeed_m_s=airspeed_m_s)
    if throttle is None:
        start, along = replace(start, climb_rad=climb_rad or 0.0), "throttle"
    else:
        start, along = replace(start, throttle=throttle), "climb_rad"
    if bank_rad == 0.0:
        start, turning = replace(start, turn_rate_rad_s=0.0), "roll_rad"
    else:
        start, turning = replace(start, roll_rad=bank_rad), "turn_rate_rad_s"
    free = ("alpha_rad", along, turning, *surfaces(model))
    search = Search(model, free, height_m, heading_rad, wind_e_m_s)
    found, left, wanted = search.run(start)
    problem = _problem(search, found, left, wanted)
    if problem and along == "throttle":
        problem = _power(search, start) or problem
    if problem:
        path = _path(start.climb_rad, throttle) + (" turn" if bank_rad else "")
        raise ValueError(f"airspeed_m_s {airspeed_m_s} m/s: no {path} trim at {height_m:g} m, {problem}")
    return found


def _path(climb_rad: float, throttle: float | None) -> str:
    """The kind of flight, in a word."""
    if throttle is None:
        return "level" if climb_rad == 0.0 else "climbing" if climb_rad > 0.0 else "descending"
    return "gliding" if throttle == 0.0 else "powered"


def _power(search: Search, start: Trim) -> str:
    """Why no throttle gives the climb angle: it is compared with those at full throttle and motor off."""
    along = replace(search, free=tuple("climb_rad" if name == "throttle" else name for name in search.free))
    for throttle, sign, stop in ((1.0, 1.0, "full throttle"), (0.0, -1.0, "the motor off")):
        t, left, _ = along.run(replace(start, throttle=throttle))
        if np.max(np.abs(left)) < 1e-9 and sign * (start.climb_rad - t.climb_rad) > 0.0:
            wanted, found = math.degrees(start.climb_rad), math.degrees(t.climb_rad)
            return f"the throttle would exceed {throttle:g}: the path is {found:.1f} deg with {stop}, not {wanted:.1f}"
    return ""


def surfaces(model: "Model") -> tuple[str, str, str]:
    """Unknowns for roll, pitch and yaw: aileron, elevator, rudder; sideslip if the aileron has no effect."""
    t = Trim.of(model.airframe["cruise"])
    deflected = accelerations(model, replace(t, aileron=0.5), 60.0) - accelerations(model, t, 60.0)
    return "aileron" if abs(deflected[3]) > 1e-6 else "beta_rad", "elevator", "rudder"


def _check(
    model: "Model", airspeed_m_s: float, climb_rad: float | None, throttle: float | None, bank_rad: float
) -> None:
    """Reject invalid arguments of `trim`: ValueError."""
    low, high, _ = BOUNDS["airspeed_m_s"]
    if not low <= airspeed_m_s <= high:
        raise ValueError(f"airspeed_m_s {airspeed_m_s} m/s: choose {low:g} to {high:g} m/s")
    if climb_rad is not None and not abs(climb_rad) <= 1.4:
        raise ValueError(f"climb_rad {climb_rad} rad: choose -1.4 to 1.4")
    if throttle is not None and not 0.0 <= throttle <= 1.0:
        raise ValueError(f"throttle {throttle}: choose 0 to 1")
    if not abs(bank_rad) <= 1.4:
        raise ValueError(f"bank_rad {bank_rad} rad: choose -1.4 to 1.4")
    if not model.powered and throttle != 0.0:
        given = f"climb_rad {climb_rad}" if throttle is None else f"throttle {throttle}"
        raise ValueError(f"{given}: '{model.folder.name}' has no motor, choose throttle 0 for a glide")


def _guess(model: "Model", airspeed_m_s: float, bank_rad: float) -> Trim:
    """The cruise at another speed: angle of attack above zero lift roughly proportional to load / V^2."""
    cruise = Trim.of(model.airframe["cruise"])
    load = 1.0 / math.cos(bank_rad)
    alpha_rad = cruise.alpha_rad + 0.07 * (load * (cruise.airspeed_m_s / airspeed_m_s) ** 2 - 1.0)
    rate = G_M_S2 * math.tan(bank_rad) / airspeed_m_s
    return replace(cruise, airspeed_m_s=airspeed_m_s, alpha_rad=min(alpha_rad, 0.18), turn_rate_rad_s=rate)


def _problem(search: Search, t: Trim, left: Array, wanted: Array) -> str:
    """Why `t` is not a steady flight; empty if it is."""
    solved = bool(np.max(np.abs(left)) < 1e-9)
    if solved and lift_slope(search.model, t, search.height_m) > 0.0:
        return ""
    carried = most_lift(search.model, t, search.height_m)
    needed = math.cos(t.climb_rad) / math.cos(t.roll_rad)
    if carried < needed:
        slowest = t.airspeed_m_s * math.sqrt(needed / carried)
        return (
            f"below the stall: the wing carries {carried:.2f} of the {needed:.2f} g needed, fly above {slowest:.1f} m/s"
        )
    for name, target in zip(search.free, wanted, strict=True):
        low, high, _ = BOUNDS[name]
        if name in ("throttle", "elevator", "aileron", "rudder") and not low - 1e-9 <= target <= high + 1e-9:
            return f"the {name} has to go beyond {high if target > high else low:g}"
    return f"the search ended at {np.max(np.abs(left)):.2g} m/s2 or rad/s2, choose one between stall and top speed"


def lift_slope(model: "Model", t: Trim, height_m: float) -> float:
    """Change of the upward acceleration across the path with the angle of attack, m/s2 per rad; < 0 is stalled."""

    def lift(alpha_rad: float) -> float:
        forward, _, down = accelerations(model, replace(t, alpha_rad=alpha_rad), height_m)[:3]
        return float(forward * math.sin(alpha_rad) - down * math.cos(alpha_rad))

    h = 1e-4
    return (lift(t.alpha_rad + h) - lift(t.alpha_rad - h)) / (2.0 * h)


def most_lift(model: "Model", t: Trim, height_m: float) -> float:
    """The greatest lift at the speed of `t`, elevator as there, in units of the weight."""
    alphas = np.radians(np.arange(0.0, 26.0))
    straight = Trim(t.airspeed_m_s, 0.0, t.elevator, 0.0)
    lifts = []
    for alpha in alphas:
        accelerations(model, replace(straight, alpha_rad=float(alpha)), height_m)
        x, _, z = model.force_and_moment()[0]
        lifts.append(x * math.sin(alpha) - z * math.cos(alpha))
    return max(lifts) / (model.mass_kg() * G_M_S2)
