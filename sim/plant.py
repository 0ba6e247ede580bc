"""The Plant protocol, the interface between the loop and what flies, and the starts of a flight."""

from dataclasses import dataclass
from typing import Protocol

from autopilot.interface import ActuatorCommand
from sim.log import Log, Outcome


class SimulationDiverged(RuntimeError):
    """The simulation diverged: a state is not finite or far beyond the flight envelope."""


@dataclass(frozen=True, slots=True)
class InFlight:
    """Start in the air in trimmed level flight at the given heading.

    north_m, east_m, height_m : from the launch point    airspeed_m_s : None: the aeroplane's cruise speed
    """

    heading_rad: float
    height_m: float = 60.0
    north_m: float = 0.0
    east_m: float = 0.0
    airspeed_m_s: float | None = None


@dataclass(frozen=True, slots=True)
class HandThrow:
    """Start in a swaying hand at the launch point, pushed along the body x axis and released.

    heading_rad, pitch_rad, roll_rad : attitude of the throw    height_m : of the hand
    hold_s : time in the hand since power-up                push_m_s2, push_s : acceleration and duration of the push;
    below 0 it is thrown tail first
    sway_rad_s, sway_hz, sway_phase_rad : (3,) roll, pitch and yaw rates of the hand, a_i sin(2 pi f_i t + phase_i)
    release_rate_b_rad_s : (3,) body rates at the end of the push
    """

    heading_rad: float
    pitch_rad: float
    sway_rad_s: tuple[float, float, float]
    sway_hz: tuple[float, float, float]
    sway_phase_rad: tuple[float, float, float]
    release_rate_b_rad_s: tuple[float, float, float]
    height_m: float = 1.7
    hold_s: float = 8.0
    push_m_s2: float = 27.0
    push_s: float = 0.3
    roll_rad: float = 0.0


Start = InFlight | HandThrow


class Plant(Protocol):
    """What flies.  A plant owns the motion in the truth rows: only `advance` writes it, row by row."""

    dt_s: float  # length of a tick
    release_s: float  # time of the release, from which judged times count; 0 for a start in the air

    def reset(self, log: Log) -> None:
        """Put the aeroplane at its start; the rows of `log` are filled from tick 0."""
        ...

    def advance(self, k: int, command: ActuatorCommand) -> Outcome | None:
        """Fly tick `k` with `command` (actuators, physics, truth row k); an Outcome if the flight ended in it."""
        ...
