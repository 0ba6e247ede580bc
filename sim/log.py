"""The log of a flight: three preallocated structured arrays, a row per tick, defined by one table of columns.

``truth``     known only to the simulator
``measured``  sensor outputs; the only rows flight code sees, read-only
``flown``     estimates and commands

Row k is both working memory and record of tick k: recording is free, and history (such as GPS latency) is read from
earlier rows.  The same tables name the Parquet columns.
"""

from dataclasses import dataclass, field
from enum import IntEnum, StrEnum
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from estimator.interface import MEASURED, MEASURED_DTYPE, Column, HeadingReference, dtype_of


class Phase(IntEnum):
    """Phase of a flight."""

    HELD = 0  # in the hand
    THROWN = 1  # being pushed
    FLYING = 2
    RESTING = 3  # on a table; judged like flying


TRUTH = (
    Column("t_s", (), "time since power-up, end of the tick"),
    Column("R_eb", (3, 3), "body-to-earth rotation"),
    Column("omega_b_rad_s", (3,), "angular rate against inertial space, at the end of the tick"),
    Column("p_e_m", (3,), "position from the launch point on the ground, north, east, down"),
    Column("v_e_m_s", (3,), "velocity over the ground"),
    Column("imu_omega_b_rad_s", (3,), "mean angular rate over the tick: what a perfect gyro reports"),
    Column("imu_force_b_m_s2", (3,), "mean specific force over the tick: what a perfect accelerometer reports"),
    Column("wind_e_m_s", (3,), "velocity of the air over the ground, turbulence included"),
    Column("airspeed_m_s", (), "true airspeed"),
    Column("alpha_rad", (), "angle of attack"),
    Column("beta_rad", (), "sideslip, positive with the wind from the right"),
    Column("aileron", (), "aileron position, -1..1, positive rolls right"),
    Column("elevator", (), "elevator position, -1..1, positive pitches up"),
    Column("rudder", (), "rudder position, -1..1, positive yaws right"),
    Column("throttle", (), "throttle position, 0..1"),
    Column("rotor_rpm", (), "propeller speed, revolutions per minute"),
    Column("thrust_n", (), "propeller thrust"),
    Column("phase", (), "0 held, 1 thrown, 2 flying, 3 resting", integer=True),
    Column("gyro_bias_b_rad_s", (3,), "what the gyro reads without rotation and without noise, at this tick"),
    Column("force_bias_b_m_s2", (3,), "what the accelerometer reads without force and without noise"),
    Column("gps_p_e_m", (3,), "position inside the receiver, after its filter, before its latency"),
    Column("gps_v_e_m_s", (3,), "velocity inside the receiver, after its filter, before its latency"),
)
FLOWN = (
    Column("R_eb", (3, 3), "estimated body-to-earth rotation"),
    Column("omega_b_rad_s", (3,), "drift-corrected rate"),
    Column("gyro_bias_b_rad_s", (3,), "estimated gyro bias"),
    Column("wind_e_m_s", (3,), "estimated wind, NaN where not estimated"),
    Column("health", (), "0 starting, 1 good, 2 poor", integer=True),
    Column("aileron", (), "command, -1..1"),
    Column("elevator", (), "command, -1..1"),
    Column("rudder", (), "command, -1..1"),
    Column("throttle", (), "command, 0..1"),
    Column("mode", (), "autopilot mode", integer=True),
    Column("bank_demand_rad", (), "bank the autopilot tries to hold, NaN where none"),
    Column("pitch_demand_rad", (), "pitch the autopilot tries to hold, NaN where none"),
)
TRUTH_DTYPE = dtype_of(TRUTH)
FLOWN_DTYPE = dtype_of(FLOWN)
TABLES = {"truth": TRUTH, "measured": MEASURED, "flown": FLOWN}


@dataclass(frozen=True, slots=True)
class Log:
    """The three arrays of one flight, each with the same number of rows."""

    truth: NDArray[Any]
    measured: NDArray[Any]
    flown: NDArray[Any]

    @classmethod
    def empty(cls, n_ticks: int) -> "Log":
        """A log of `n_ticks` zeroed rows; attitudes are the identity, wind and demands NaN."""
        log = cls(np.zeros(n_ticks, TRUTH_DTYPE), np.zeros(n_ticks, MEASURED_DTYPE), np.zeros(n_ticks, FLOWN_DTYPE))
        log.flown["R_eb"] = np.eye(3)
        log.flown["wind_e_m_s"] = log.flown["bank_demand_rad"][:, None] = np.nan
        log.flown["pitch_demand_rad"] = np.nan
        return log

    def __len__(self) -> int:
        return len(self.truth)

    def until(self, n_ticks: int) -> "Log":
        """The first `n_ticks` rows, as views."""
        return Log(self.truth[:n_ticks], self.measured[:n_ticks], self.flown[:n_ticks])


class Outcome(StrEnum):
    """How a flight ended; the flight up to then is recorded and judged in every case."""

    COMPLETED = "completed"
    GROUND_CONTACT = "ground_contact"
    LEFT_BOX = "left_box"
    DIVERGED = "diverged"
    ESTIMATOR_FAILED = "estimator_failed"
    AUTOPILOT_FAILED = "autopilot_failed"
    SCENARIO_FAILED = "scenario_failed"  # its script raised; nothing was flown
    TIMED_OUT = "timed_out"  # took longer than the wall-clock limit
    WORKER_DIED = "worker_died"  # the process that flew it ended; nothing is recorded
    INTERRUPTED = "interrupted"


@dataclass(frozen=True, slots=True)
class Event:
    """An event of a flight; `t_s` since power-up."""

    t_s: float
    text: str
    level: Literal["info", "warn", "error"] = "info"


@dataclass(frozen=True, slots=True)
class Flight:
    """A completed flight, to be recorded, judged and shown.

    log : rows up to the end            dt_s : tick length            release_s : judged times count from here
    outcome, message : how it ended, and one line if not as planned
    manifest : seed, resolved configuration, versions; JSON-serialisable
    late : ticks in which the estimator took longer than the tick; depends on the machine, so not recorded
    """

    log: Log
    dt_s: float
    release_s: float
    outcome: Outcome
    heading_reference: HeadingReference
    message: str = ""
    events: tuple[Event, ...] = ()
    manifest: dict[str, Any] = field(default_factory=dict)
    late: int = 0
