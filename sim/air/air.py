"""The sum of all air motion at the aeroplane, once per tick."""

import math
from dataclasses import dataclass, field

import numpy as np

from estimator.compiler.jit import kernel
from estimator.interface import Array
from sim.air import dryden
from sim.air.gust import Gust, add_gusts
from sim.air.profile import share_of_wind
from sim.air.thermal import Thermals, updraft_m_s
from sim.place import LAUNCH_PLACE, Place
from sim.rng import stream
from sim.terrain import ground_height_m

AIR_DTYPE = np.dtype(
    [
        ("dt_s", "f8"),
        ("release_s", "f8"),
        ("wind_e_m_s", "f8", (3,)),  # the mean, at the reference height
        ("shear", "f8"),
        ("thermal_m_s", "f8"),
        ("inversion_m", "f8"),
        ("thermal_area_m2", "f8"),
        ("p_e_m", "f8", (3,)),  # of the aeroplane
        ("ground_m", "f8"),  # see `sim.place.Place`
        ("ground_from_m", "f8"),
        ("airspeed_m_s", "f8"),
        *dryden.FIELDS,
        ("now", "f8", (6,)),  # wind_e_m_s there, and rates of the air, rate_b_rad_s
    ],
    align=True,
)


@dataclass(frozen=True, slots=True)
class Air:
    """Mean wind, shear, turbulence, gusts and thermals.

    wind_e_m_s : (north, east, down)   velocity of the air over the ground at 10 m: the direction it blows to
    turbulence_w20_m_s : float         wind at 20 ft that sets the strength of low-altitude turbulence, 0: none;
                                       7.7 is light, 15.4 moderate, 23.2 severe in the standard (`sim.air.dryden`)
    shear : float                      exponent of the wind profile over height (`sim.air.profile`), 0: none
    gusts, thermals                    see `sim.air.gust`, `sim.air.thermal`
    """

    wind_e_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turbulence_w20_m_s: float = 0.0
    shear: float = 0.0
    gusts: tuple[Gust, ...] = ()
    thermals: Thermals = field(default_factory=Thermals)

    def __post_init__(self) -> None:
        if len(self.wind_e_m_s) != 3 or not all(math.isfinite(w) and abs(w) <= 50.0 for w in self.wind_e_m_s):
            raise ValueError(f"wind {self.wind_e_m_s} m/s: give three numbers (north, east, down) within +-50 m/s")
        if not 0.0 <= self.turbulence_w20_m_s <= 50.0:
            raise ValueError(f"turbulence {self.turbulence_w20_m_s} m/s (wind at 20 ft): choose 0 to 50 m/s")
        if not 0.0 <= self.shear <= 1.0:
            raise ValueError(f"shear {self.shear}: choose an exponent of 0 (none) to 1; 0.14 is open country")

    @property
    def is_steady(self) -> bool:
        """Whether the wind is the same everywhere and at all times."""
        sheared = self.shear > 0.0 and any(self.wind_e_m_s)
        return not (sheared or self.gusts or self.turbulence_w20_m_s or self.thermals.places_e_m)

    def mean_wind_e_m_s(self, height_m: float) -> Array:
        """The mean wind at a height above the ground, shape (3,)."""
        share = share_of_wind(height_m, self.shear) if self.shear else 1.0
        return share * np.array(self.wind_e_m_s)


STILL = Air()


class MovingAir:
    """The air of one flight, tick by tick.

    Parameters
    ----------
    air : its parameters
    span_m : of the aeroplane, over which turbulence is averaged for its rates
    dt_s : tick          release_s : since power-up; gust times count from it
    seed, flight : of the random streams: turbulence u, v (and r), w (and q), p
    place : the heights of profile, turbulence and thermals are above its ground

    Gusts, thermals and shear draw no random numbers and leave the turbulence unchanged.
    """

    def __init__(
        self, air: Air, span_m: float, dt_s: float, release_s: float, seed: int, flight: int = 0,
        place: Place = LAUNCH_PLACE,
    ) -> None:  # fmt: skip
        self.air, self._seed, self._flight = air, seed, flight
        self.state = np.zeros(1, AIR_DTYPE)
        self._now = self.state["now"][0]
        s, thermals = self.state[0], air.thermals
        s["ground_m"], s["ground_from_m"] = place.ground_m, place.ground_from_m
        s["dt_s"], s["release_s"], s["span_m"] = dt_s, release_s, span_m
        s["wind_e_m_s"], s["shear"], s["w20_m_s"] = air.wind_e_m_s, air.shear, air.turbulence_w20_m_s
        north, east, _ = air.wind_e_m_s
        speed = math.hypot(north, east)
        s["along_wind"] = (north / speed, east / speed) if speed > 0.0 else (1.0, 0.0)
        s["thermal_m_s"], s["inversion_m"] = thermals.strength_m_s, thermals.inversion_m
        s["thermal_area_m2"] = thermals.area_m2
        self._gusts = np.array([(*g.peak_e_m_s, g.start_s, g.length_s) for g in air.gusts]).reshape(-1, 5)
        self._places = np.array(thermals.places_e_m, dtype=float).reshape(-1, 2)
        self._noise = np.zeros((1, 8))

    @property
    def now(self) -> list[float]:
        """At the aeroplane: wind north, east, down [m/s], rates p, q, r [rad/s]."""
        return self._now.tolist()

    @property
    def wind_e_m_s(self) -> Array:
        """The wind at the aeroplane, shape (3,)."""
        return self._now[:3].copy()

    def start(self, n_ticks: int, p_e_m: tuple[float, float, float]) -> None:
        """Begin a flight of at most `n_ticks` at `p_e_m`, at power-up; the turbulence is stationary from the start."""
        s = self.state[0]
        s["p_e_m"], s["airspeed_m_s"] = p_e_m, 0.0
        if self.air.is_steady:
            self._now[:3] = self.air.wind_e_m_s
            return
        # Row 0 is for the start; row k does not depend on the number of rows.
        self._noise = np.hstack(
            [
                stream(self._seed, self._flight, name).standard_normal((n_ticks + 1, width))
                for name, width in dryden.STREAMS.items()
            ]
        )
        begin(self.state, self._noise, self._gusts, self._places)

    def blow(self, truth: Array, k: int) -> list[float]:
        """The air of tick `k` at the position of truth row k - 1, as `now`; call once per tick, in order."""
        blow(truth, k, self.state, self._noise, self._gusts, self._places)
        return self._now.tolist()


@kernel
def _gather(t_s, distance_m, z, s, gusts, places):  # type: ignore[no-untyped-def]
    """Write wind and rates at ``s.p_e_m`` into ``s.now``, `distance_m` further through the air, at `t_s`."""
    height_m = -s.p_e_m[2]
    if s.ground_m != 0.0:
        height_m -= ground_height_m(s.p_e_m[0], s.p_e_m[1], s.ground_m, s.ground_from_m)
    wind_e, rate_b = s.now[:3], s.now[3:]
    share = share_of_wind(height_m, s.shear)
    for i in range(3):
        wind_e[i] = share * s.wind_e_m_s[i]
        rate_b[i] = 0.0
    wind_e[2] -= updraft_m_s(s.p_e_m[0], s.p_e_m[1], height_m, places, s.thermal_m_s, s.inversion_m, s.thermal_area_m2)
    add_gusts(t_s - s.release_s, gusts, wind_e)
    if s.w20_m_s > 0.0:
        dryden.add_turbulence(distance_m, height_m, z, s, wind_e, rate_b)


@kernel
def begin(state, noise, gusts, places):  # type: ignore[no-untyped-def]
    """The air at power-up, with stationary turbulence."""
    _gather(0.0, dryden.FAR_M, noise[0], state[0], gusts, places)


@kernel
def blow(truth, k, state, noise, gusts, places):  # type: ignore[no-untyped-def]
    """The air of tick k at position and airspeed of truth row k - 1."""
    s = state[0]
    if k > 0:
        last = truth[k - 1]
        s.airspeed_m_s = last.airspeed_m_s
        for i in range(3):
            s.p_e_m[i] = last.p_e_m[i]
    _gather((k + 1) * s.dt_s, s.airspeed_m_s * s.dt_s, noise[k + 1], s, gusts, places)
