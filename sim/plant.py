"""The seam between the loop and what flies: the Plant protocol, and how a flight starts."""

from dataclasses import dataclass
from typing import Protocol

from autopilot.interface import ActuatorCommand
from sim.log import Log, Outcome


class SimulationDiverged(RuntimeError):
    """The simulation blew up: a state is not finite or far outside anything that flies."""


@dataclass(frozen=True, slots=True)
class InFlight:
    """Start in the air in trimmed level flight, heading as given.

    north_m, east_m, height_m : where, from the launch point    airspeed_m_s : None is the aeroplane's cruise
    """

    heading_rad: float
    height_m: float = 60.0
    north_m: float = 0.0
    east_m: float = 0.0
    airspeed_m_s: float | None = None


@dataclass(frozen=True, slots=True)
class HandThrow:
    """Start in a hand at the launch point, moved a little, then pushed along the body axis and let go.

    heading_rad, pitch_rad : attitude of the throw          height_m : of the hand
    hold_s : time in the hand since power-up                push_m_s2, push_s : acceleration and length of the push
    sway_rad_s, sway_hz, sway_phase_rad : (3,) roll, pitch and yaw of the hand, a_i sin(2 pi f_i t + phase_i) in rate
    release_rate_b_rad_s : (3,) body rates that the hand imparts by the end of the push
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


Start = InFlight | HandThrow


class Plant(Protocol):
    """What flies.  A plant owns the truth rows: `advance` fills row k, nothing else writes motion there."""

    dt_s: float  # length of a tick
    release_s: float  # judged times count from here: time of the release; 0 where it starts in the air

    def reset(self, log: Log) -> None:
        """Put the aeroplane at its start; the rows of `log` are filled from tick 0 on."""
        ...

    def advance(self, k: int, command: ActuatorCommand) -> Outcome | None:
        """Fly tick `k` under `command` (actuators, physics, truth row k); an Outcome where the flight ended in it."""
        ...
