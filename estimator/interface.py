"""What an estimator receives and returns.

`MEASURED` is the table of all measurement columns; the log row of a tick is the measurement.  A kernel works on the
rows (`kernel(rows, k, state)`), any other estimator on `Measurements`, a view of the same row:

>>> m.imu.gyro_b_rad_s, m.imu.dt_s          # in every tick
>>> m.gps                                   # the fix that arrived in this tick, or None
"""

from enum import IntEnum
from typing import Any, Literal, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
G_M_S2 = 9.80665  # standard gravity: what 1 g means on a data sheet


class Column(NamedTuple):
    """One column of a log: its name (quantity, frame, unit), shape, and meaning; `integer` for flags and counts."""

    name: str
    shape: tuple[int, ...]
    meaning: str
    integer: bool = False


def dtype_of(columns: tuple[Column, ...]) -> np.dtype[Any]:
    """Structured dtype of `columns`, every element 8 bytes wide, so that rows are aligned for the kernels."""
    return np.dtype([(c.name, "i8" if c.integer else "f8", c.shape) for c in columns], align=True)


MEASURED = (
    Column("t_s", (), "end of the sample interval, since power-up, by the clock aboard"),
    Column("dt_s", (), "length of the sample interval; may jitter"),
    Column("gyro_b_rad_s", (3,), "mean angular rate over the interval, as the gyro reports it"),
    Column("force_b_m_s2", (3,), "mean specific force over the interval; level at rest (0, 0, -9.8)"),
    Column("gps_new", (), "1 where a fix arrived in this tick", integer=True),
    Column("gps_valid", (), "1 while the last fix is usable; the columns below hold the last one", integer=True),
    Column("gps_t_s", (), "time at which the fix was true, as stamped by the receiver; NaN without a stamp"),
    Column("gps_p_e_m", (3,), "reported position, relative to the launch point"),
    Column("gps_v_e_m_s", (3,), "reported velocity over the ground"),
    Column("gps_course_rad", (), "reported course over ground, from north over east, 0..2 pi"),
    Column("gps_speed_m_s", (), "reported ground speed, horizontal"),
    Column("mag_new", (), "1 where a magnetometer sample arrived in this tick", integer=True),
    Column("mag_b_ut", (3,), "magnetic field of the last sample, microtesla"),
    Column("air_new", (), "1 where an airspeed or a barometric height arrived in this tick", integer=True),
    Column(
        "equivalent_airspeed_m_s", (), "last airspeed, of the pitot pressure; NaN without a tube or before a report"
    ),
    Column("baro_height_m", (), "last barometric height above the launch point; NaN likewise"),
)
MEASURED_DTYPE = dtype_of(MEASURED)


class ImuSample(NamedTuple):
    """One inertial sample: means over the interval of `dt_s` that ends at `t_s`.

    gyro_b_rad_s : shape (3,)   force_b_m_s2 : shape (3,), specific force (acceleration minus gravity)
    """

    t_s: float
    dt_s: float
    gyro_b_rad_s: Array
    force_b_m_s2: Array


class GpsFix(NamedTuple):
    """One GPS report as it arrives, filtered and late; `t_s` is the time at which it was true.

    p_e_m, v_e_m_s : shape (3,), north-east-down   course_rad : 0..2 pi   speed_m_s : horizontal
    """

    t_s: float
    p_e_m: Array
    v_e_m_s: Array
    course_rad: float
    speed_m_s: float


class MagSample(NamedTuple):
    """One magnetometer sample, shape (3,), microtesla, body axes."""

    field_b_ut: Array


class AirData(NamedTuple):
    """The last air data; NaN where an instrument is not fitted.

    equivalent_airspeed_m_s : from the pitot pressure q, sqrt(2 q / 1.225 kg/m3); the true airspeed is higher in thinner
        air, see `estimator.blocks.air`
    height_m : barometric, above the launch point
    """

    equivalent_airspeed_m_s: float
    height_m: float


class Measurements(NamedTuple):
    """All measurements of one tick: a read-only view of row `k` of the measured log.

    A compiled estimator passes `rows` and `k` to its kernel; others read `imu`, `gps`, `mag`, `air`.
    """

    rows: NDArray[np.void]
    k: int

    @classmethod
    def of(
        cls, imu: ImuSample, gps: GpsFix | None = None, mag: MagSample | None = None, air: AirData | None = None
    ) -> "Measurements":
        """Measurements from single samples: for tests, notebooks and your own logs."""
        rows = np.zeros(1, MEASURED_DTYPE)
        row = rows[0]
        row["t_s"], row["dt_s"], row["gyro_b_rad_s"], row["force_b_m_s2"] = imu
        if gps is not None:
            row["gps_new"] = row["gps_valid"] = 1
            row["gps_t_s"], row["gps_p_e_m"], row["gps_v_e_m_s"] = gps[:3]
            row["gps_course_rad"], row["gps_speed_m_s"] = gps[3:]
        if mag is not None:
            row["mag_new"], row["mag_b_ut"] = 1, mag.field_b_ut
        if air is not None:
            row["air_new"], row["equivalent_airspeed_m_s"], row["baro_height_m"] = 1, *air
        rows.flags.writeable = False
        return cls(rows, 0)

    @property
    def imu(self) -> ImuSample:
        row = self.rows[self.k]
        return ImuSample(float(row["t_s"]), float(row["dt_s"]), row["gyro_b_rad_s"], row["force_b_m_s2"])

    @property
    def gps(self) -> GpsFix | None:
        row = self.rows[self.k]
        if not row["gps_new"]:
            return None
        return GpsFix(
            float(row["gps_t_s"]),
            row["gps_p_e_m"],
            row["gps_v_e_m_s"],
            float(row["gps_course_rad"]),
            float(row["gps_speed_m_s"]),
        )

    @property
    def mag(self) -> MagSample | None:
        row = self.rows[self.k]
        return MagSample(row["mag_b_ut"]) if row["mag_new"] else None

    @property
    def air(self) -> AirData | None:
        row = self.rows[self.k]
        if not row["air_new"]:
            return None
        return AirData(float(row["equivalent_airspeed_m_s"]), float(row["baro_height_m"]))


class Health(IntEnum):
    """An estimator's own judgement of its attitude."""

    STARTING = 0  # before power-up ended, or heading not yet found
    GOOD = 1
    POOR = 2  # coasting on gyros, samples being rejected


STARTING, GOOD, POOR = (int(health) for health in Health)  # for kernels: numba is slow with enumerations


NO_RATE = np.zeros(3)
NO_RATE.flags.writeable = False


class AttitudeEstimate(NamedTuple):
    """What an estimator returns for each tick; only `R_eb` is required.

    A named tuple, because a frozen dataclass takes a microsecond longer to create in every tick.

    R_eb : shape (3, 3)               body-to-earth rotation
    omega_b_rad_s : shape (3,)        drift-corrected rate (used for damping by the autopilot)
    gyro_bias_b_rad_s : shape (3,)    reading minus true rate
    wind_e_m_s : shape (3,) or None   velocity of the air over the ground, None where not estimated
    health : Health
    """

    R_eb: Array
    omega_b_rad_s: Array = NO_RATE
    gyro_bias_b_rad_s: Array = NO_RATE
    wind_e_m_s: Array | None = None
    health: Health = Health.GOOD


HeadingReference = Literal["course", "nose"]
Instrument = Literal["gyro", "accelerometer", "gps", "magnetometer", "airspeed"]


@runtime_checkable
class AttitudeEstimator(Protocol):
    """The protocol of estimators; only `update` is required.

    Optional: ``heading_reference``, "course" (default) or "nose", what the heading converges to;
    ``reset(on_ground)``, called at power-up with the mean inertial sample of the calibration window, or with None where
    the flight starts in the air; ``uses``, names of the instruments that it uses; and ``replay(rows)``, a whole log in
    one call, see `estimator.blocks.compiled`.
    """

    def update(self, m: Measurements) -> AttitudeEstimate:
        """Take one tick's measurements, return the attitude at its end.  Called once per IMU sample."""
        ...
