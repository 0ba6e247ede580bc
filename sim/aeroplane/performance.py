"""Performance from trims of the whole model: stall, glide, climb, top speed, turns and roll.

The glide polar, motor off, is computed by angle of attack, because speed is not monotonic at the stall.
"""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize_scalar  # type: ignore[import-untyped]

from sim.aeroplane.trim import Search, Trim, settled, surfaces, trim

if TYPE_CHECKING:
    from sim.aeroplane.jsbsim_model import Model

STEP_RAD = math.radians(0.25)
FASTEST = 3.0  # times the stall speed, end of the polar
BANKS_DEG = (15.0, 30.0, 45.0, 60.0)
BANKED_ENOUGH_RAD, LONG_ENOUGH_S = math.radians(60.0), 3.0  # end of the roll manoeuvre


@dataclass(frozen=True, slots=True)
class Roll:
    """Roll at full deflection from cruise: surface, maximum roll rate, and time to 45 deg of bank."""

    surface: str
    rate_rad_s: float
    to_45_deg_s: float


@dataclass(frozen=True, slots=True)
class Performance:
    """Trims of one aeroplane at one height.

    polar : glides with the motor off, from fast to slow
    stall : the slowest glide                               stall_by : "lift", or "elevator" if that is at its stop
    best_glide, min_sink : of the polar
    climbs : full throttle, by speed                        levels : level flight, by speed; glides without a motor
    best_climb, steepest, top_speed : None without a motor
    turns : steady turns at BANKS_DEG, as far as possible   turns_end : the limit, empty if all are possible
    """

    height_m: float
    cruise: Trim
    polar: tuple[Trim, ...]
    stall: Trim
    stall_by: str
    best_glide: Trim
    min_sink: Trim
    climbs: tuple[Trim, ...]
    levels: tuple[Trim, ...]
    best_climb: Trim | None
    steepest: Trim | None
    top_speed: Trim | None
    turns: tuple[Trim, ...]
    turns_end: str
    roll: Roll


def measure(model: "Model", height_m: float = 60.0) -> Performance:
    """Compute all trims of `Performance`; takes about a second."""
    cruise = trim(model, model.airframe["cruise"]["airspeed_m_s"], height_m)
    glide = Glides(model, height_m)
    polar, stall_by = glide.polar(cruise)
    stall = glide.best(polar, lambda t: -t.airspeed_m_s) if stall_by == "lift" else polar[-1]
    min_sink = glide.best(polar, lambda t: t.climb_m_s)
    climbs: tuple[Trim, ...] = ()
    levels = tuple(t for t in polar if t.alpha_rad <= stall.alpha_rad)
    best_climb = steepest = top_speed = None
    if model.powered:
        top_speed = _top_speed(model, cruise, height_m)
        speeds = np.linspace(1.03 * stall.airspeed_m_s, 0.999 * top_speed.airspeed_m_s, 30)
        climbs, levels = _sweep(model, speeds, height_m, throttle=1.0), _sweep(model, speeds, height_m, throttle=None)

        def climb(speed_m_s: float, near: Trim) -> Trim:
            return trim(model, speed_m_s, height_m, throttle=1.0, guess=near)

        best_climb = _refined(climbs, climb, lambda t: t.airspeed_m_s, lambda t: t.climb_m_s, 1e-5)
        steepest = _refined(climbs, climb, lambda t: t.airspeed_m_s, lambda t: t.climb_rad, 1e-5)
    return Performance(
        height_m, cruise, polar, stall, stall_by, glide.best(polar, lambda t: t.climb_rad), min_sink, climbs, levels,
        best_climb, steepest, top_speed, *turns(model, min_sink, height_m), roll(model, cruise, height_m),
    )  # fmt: skip


class Glides:
    """Straight glides by angle of attack."""

    def __init__(self, model: "Model", height_m: float) -> None:
        self._search = Search(model, ("airspeed_m_s", "climb_rad", "roll_rad", *surfaces(model)), height_m)

    def at(self, alpha_rad: float, near: Trim) -> Trim | None:
        """The glide at `alpha_rad`, None if there is none; `near` is a glide to start from."""
        found, left, _ = self._search.run(replace(near, alpha_rad=alpha_rad, throttle=0.0))
        return found if np.max(np.abs(left)) < 1e-9 else None

    def polar(self, start: Trim) -> tuple[tuple[Trim, ...], str]:
        """Glides in steps of 0.25 deg, from fast to beyond the slowest, and the limit: lift or elevator."""
        first = self.at(start.alpha_rad, replace(start, climb_rad=-0.1))
        if first is None:
            raise ValueError(f"no glide at the angle of attack of the cruise, {math.degrees(start.alpha_rad):.1f} deg")
        slow, ended = [first], "elevator"
        while (t := self.at(slow[-1].alpha_rad + STEP_RAD, slow[-1])) is not None:
            slow.append(t)
            if t.airspeed_m_s > 1.01 * min(s.airspeed_m_s for s in slow):
                ended = "lift"
                break
        slowest = min(s.airspeed_m_s for s in slow)
        fast = [first]
        while (t := self.at(fast[-1].alpha_rad - STEP_RAD, fast[-1])) is not None:
            if not fast[-1].airspeed_m_s < t.airspeed_m_s < FASTEST * slowest:
                break
            fast.append(t)
        return (*fast[:0:-1], *slow), ended

    def best(self, polar: tuple[Trim, ...], merit: Callable[[Trim], float]) -> Trim:
        """The glide of highest merit, refined between the neighbours of the best of `polar`."""
        return _refined(polar, self.at, lambda t: t.alpha_rad, merit, 1e-6)


def _refined(
    trims: tuple[Trim, ...], at: Callable[[float, Trim], Trim | None], by: Callable[[Trim], float],
    merit: Callable[[Trim], float], within: float,
) -> Trim:  # fmt: skip
    """The trim of highest merit between the neighbours of the best of `trims`, which are sorted by `by`.

    at : the trim at a value of `by`, starting from a trim nearby; None if there is none      within : of that value
    """
    i = max(range(len(trims)), key=lambda k: merit(trims[k]))
    tried = [trims[i]]

    def cost(x: float) -> float:
        t = at(float(x), trims[i])
        if t is None:
            return math.inf
        tried.append(t)
        return -merit(t)

    bounds = by(trims[max(i - 1, 0)]), by(trims[min(i + 1, len(trims) - 1)])
    minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": within})
    return max(tried, key=merit)


def _sweep(model: "Model", speeds_m_s: np.ndarray, height_m: float, throttle: float | None) -> tuple[Trim, ...]:
    """Straight flight at each possible speed, at a throttle or level (None)."""
    found: list[Trim] = []
    for speed in speeds_m_s:
        with suppress(ValueError):
            near = found[-1] if found else None
            found.append(trim(model, float(speed), height_m, throttle=throttle, guess=near))
    return tuple(found)


def _top_speed(model: "Model", cruise: Trim, height_m: float) -> Trim:
    """Level flight at full throttle."""
    search = Search(model, ("airspeed_m_s", "alpha_rad", "roll_rad", *surfaces(model)), height_m)
    guess = replace(cruise, throttle=1.0, climb_rad=0.0, airspeed_m_s=1.5 * cruise.airspeed_m_s)
    found, left, _ = search.run(guess)
    if not np.max(np.abs(left)) < 1e-9:
        raise ValueError(
            f"throttle 1: '{model.folder.name}' has no level flight at full throttle, its motor is too weak"
        )
    return found


def turns(model: "Model", min_sink: Trim, height_m: float) -> tuple[tuple[Trim, ...], str]:
    """Steady right turns and their limit; level with a motor, gliding without.

    Each is flown 5 % above the minimum-sink speed for its load factor, which grows with sqrt(load factor).
    """
    found: list[Trim] = []
    for bank_deg in BANKS_DEG:
        bank_rad = math.radians(bank_deg)
        speed = 1.05 * min_sink.airspeed_m_s / math.sqrt(math.cos(bank_rad))
        try:
            found.append(trim(model, speed, height_m, bank_rad=bank_rad))
        except ValueError as problem:
            return tuple(found), f"{bank_deg:g} deg of bank at {speed:.1f} m/s: {str(problem).partition(' m, ')[2]}"
    return tuple(found), ""


def radius_m(t: Trim) -> float:
    """Radius of a turn in still air."""
    return t.airspeed_m_s * math.cos(t.climb_rad) / abs(t.turn_rate_rad_s)


def roll(model: "Model", cruise: Trim, height_m: float) -> Roll:
    """Hold full aileron, or rudder without ailerons, until 60 deg of bank or for three seconds."""
    surface = "aileron" if surfaces(model)[0] == "aileron" else "rudder"
    euler_rad = cruise.euler_rad()
    settled(model, height_m, euler_rad, cruise.air_velocity_b_m_s, cruise.omega_b_rad_s, cruise.command)
    model.setter(f"fcs/{surface}-cmd-norm")(1.0)
    bank, rate = model.getter("attitude/phi-rad"), model.getter("velocities/p-rad_sec")
    fastest, to_45 = 0.0, math.inf
    for k in range(round(LONG_ENOUGH_S / model.dt_s)):
        model.run()
        fastest = max(fastest, rate())
        if bank() > math.radians(45.0):
            to_45 = min(to_45, (k + 1) * model.dt_s)
        if bank() > BANKED_ENOUGH_RAD:
            break
    return Roll(surface, fastest, to_45)
