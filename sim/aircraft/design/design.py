"""The design of an aeroplane: shape, masses and figures, from which its JSBSim model is made."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from sim.aircraft.design.lattice import Attached, Lattice, Sections
from sim.aircraft.design.masses import Balance, Part, balance
from sim.aircraft.design.shape import Shape
from sim.aircraft.design.stall import Polars

PROFILE_DEG = np.arange(-12.0, 15.0, 1.0)


@dataclass(frozen=True)
class Surfaces:
    """effectiveness : relative to theory; aileron_stalled : fraction left on a stalled wing."""

    effectiveness: float = 0.8
    aileron_stalled: float = 0.4


@dataclass(frozen=True)
class Servos:
    """lag_rad_s : bandwidth; rate_per_s : full deflections per second; throttle_per_s : soft start."""

    lag_rad_s: float = 30.0
    rate_per_s: float = 8.0
    throttle_per_s: float = 2.0


@dataclass(frozen=True)
class Drive:
    """Motor and propeller.

    propeller : rows of advance ratio J = V / (n D), thrust and power coefficients
    folding : the blades fold instead of windmilling: no drag
    stopped_area_m2 : drag area of a stopped propeller that does not fold
    tail_in_wash, fin_in_wash : fractions of tailplane and fin in the slipstream
    roll_rig : rolling moment coefficient of a slight wing warp against the motor torque in cruise
    """

    volts: float
    kv: float
    ohm: float
    no_load_a: float
    rotor_kg_m2: float
    propeller: tuple[tuple[float, float, float], ...]
    folding: bool
    stopped_area_m2: float
    tail_in_wash: float
    fin_in_wash: float
    roll_rig: float


@dataclass(frozen=True)
class Ground:
    """Ground contact; stiffer springs would bounce the aeroplane at 200 Hz."""

    spring_n_m: float = 400.0
    damping_n_s_m: float = 10.0
    friction: float = 0.5


@dataclass(frozen=True)
class Design:
    """An aeroplane; its shape is in the airframe.toml of `folder`.

    cruise_m_s, cruise_rad : speed of the Reynolds number and angle of attack of the linearisation
    stall_m_s : speed of the Reynolds number at the stall
    cd_extra : drag not in the outline: gaps, pushrods, rubber bands, rough covering
    cd_lift : the part of it that grows with CL^2: wing-body interference, separation bubbles
    """

    folder: Path
    about: str
    sections: Sections
    parts: tuple[Part, ...]
    cruise_m_s: float
    cruise_rad: float
    stall_m_s: float
    cd_extra: float
    cd_lift: float
    drive: Drive | None = None
    surfaces: Surfaces = Surfaces()
    servos: Servos = Servos()
    ground: Ground = Ground()

    @property
    def name(self) -> str:
        return self.folder.name

    @cached_property
    def shape(self) -> Shape:
        return Shape.of(self.folder / "airframe.toml")

    @cached_property
    def balance(self) -> Balance:
        return balance(self.parts, self.shape)

    @cached_property
    def _lattice(self) -> Lattice:
        return Lattice(self.shape, self.sections, self.cruise_m_s, self.cruise_rad)

    @property
    def attached(self) -> Attached:
        return self._lattice.attached

    @cached_property
    def polars(self) -> Polars:
        drag, limits = self._lattice.profile_drag(PROFILE_DEG), self._lattice.section_limits(self.stall_m_s)
        return Polars(self.shape, self.attached, PROFILE_DEG, drag, self.cd_extra, self.cd_lift, limits)
