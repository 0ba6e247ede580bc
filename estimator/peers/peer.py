"""Base classes of the adapters to other packages: screening, calibration, axes; see `estimator.peers.peers`."""

import importlib
import math
from typing import Any, ClassVar, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.blocks.compiled import BELIEF
from estimator.blocks.magnetometer import FIELD as FIELD_COLUMNS
from estimator.blocks.magnetometer import take_field, turn_to_north, write_calibration
from estimator.blocks.screening import (
    AT_LIMIT_S,
    FORCE_GOOD,
    GPS,
    SCREEN,
    attitude_at_rest,
    fix_came,
    offset_at_rest,
    refusals,
    refuse,
    screen,
    take_rate,
    watch_limit,
)
from estimator.compiler.jit import kernel
from estimator.interface import (
    Array,
    AttitudeEstimate,
    Column,
    HeadingReference,
    Health,
    ImuSample,
    Instrument,
    Measurements,
    dtype_of,
)
from estimator.params.peers import PeerParams
from estimator.params.shared import RANGES
from estimator.rotation import heading_rad

# In this order, because numba warns about records that begin with all columns of another.
STATE_DTYPE = dtype_of(
    (
        *SCREEN,
        *BELIEF,
        *FIELD_COLUMNS,
        Column("force_b_m_s2", (3,), "the accelerometer's last sample"),
        Column("course_rad", (), "the last plausible course"),
        Column("course_age_s", (), "time since it arrived"),
    )
)
FIELD, COURSE = 8, 16  # bits besides those of `screen`: a magnetometer sample arrived, the course is fresh
FIX_LIFE_S = 2.0  # an older course is not used
MIN_SPEED_M_S = 3.0  # slowest ground speed with a course

NORTH_EAST_DOWN, NORTH_WEST_UP = np.eye(3), np.diag([1.0, -1.0, -1.0])
EAST_NORTH_UP = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # from north-east-down, and back
RIGHT_DOWN, LEFT_UP = np.ones(3), np.array([1.0, -1.0, -1.0])  # forward-left-up is forward-right-down times this


@kernel
def _screen(rows, k, uses_field, uses_course, state):  # type: ignore[no-untyped-def]
    """Screen row `k` and copy the accepted samples into the state; returns their bits."""
    row, s = rows[k], state[0]
    good = screen(row, s)
    if not good:
        return good
    take_rate(row, s, good)
    for i in range(3):
        s.force_b_m_s2[i] = row.force_b_m_s2[i]
    if uses_field and take_field(row, s):
        good |= FIELD
    s.course_age_s += s.dt_s
    if uses_course and fix_came(row, s):
        if not (abs(row.gps_course_rad) < 100.0 and 0.0 <= row.gps_speed_m_s < 1000.0):
            refuse(s, GPS)
        elif row.gps_speed_m_s >= MIN_SPEED_M_S:
            s.course_rad, s.course_age_s = row.gps_course_rad, 0.0
    return good | COURSE if s.course_age_s <= FIX_LIFE_S else good


@kernel
def _watch_limit(learnt, limit, state):  # type: ignore[no-untyped-def]
    watch_limit(learnt, limit, state[0])


def package(name: str) -> Any:
    """The module `name`; ImportError in one line if it is not installed."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name.partition(".")[0]:
            raise
        raise ImportError(f'the package {error.name} is not installed: pip install "wingslevel[peers]"') from None


def to_quaternion(R: Array) -> Array:
    """Unit quaternion (w, x, y, z) of a rotation matrix, shape (4,)."""
    return np.asarray(Rotation.from_matrix(R).as_quat(scalar_first=True))


def _about_down(angle_rad: float) -> Array:
    """Rotation about the vertical, shape (3, 3), that turns the nose to the right by `angle_rad`."""
    c, z = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[c, -z, 0.0], [z, c, 0.0], [0.0, 0.0, 1.0]])


@kernel
def _take_quaternion(q, earth, body, declination_rad, state):  # type: ignore[no-untyped-def]
    """Set the attitude from the package's quaternion in its own axes; False if it is not a rotation."""
    s = state[0]
    w, x, y, z = q[0], q[1], q[2], q[3]
    squared = w * w + x * x + y * y + z * z
    if not 0.01 < squared < 100.0:  # nor is NaN
        return False
    n = 2.0 / squared
    R = np.empty((3, 3))
    R[0, 0], R[0, 1], R[0, 2] = 1.0 - n * (y * y + z * z), n * (x * y - w * z), n * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = n * (x * y + w * z), 1.0 - n * (x * x + z * z), n * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = n * (x * z - w * y), n * (y * z + w * x), 1.0 - n * (x * x + y * y)
    for j in range(3):
        north = earth[0, 0] * R[0, j] + earth[1, 0] * R[1, j]  # the vertical stays
        east = earth[0, 1] * R[0, j] + earth[1, 1] * R[1, j]
        c, sine = np.cos(declination_rad), np.sin(declination_rad)
        s.R_eb[0, j] = (c * north - sine * east) * body[j]
        s.R_eb[1, j] = (sine * north + c * east) * body[j]
        s.R_eb[2, j] = earth[2, 2] * R[2, j] * body[j]
    return True


NOTHING_LEARNT = np.zeros(3)


class Heard(NamedTuple):
    """Input of a package in one tick, in our units and its own body axes; None if rejected or missing.

    gyro_rad_s : less the offset measured at power-up      course_rad : of the GPS, at most 2 s old
    """

    gyro_rad_s: Array
    force_m_s2: Array | None
    field_ut: Array | None
    course_rad: float | None
    dt_s: float


class Peer:
    """Base class of the adapters: screening, calibration, axes, initial heading.

    A subclass defines `_start`, `_turn`, `_advance` and `_learnt`.
    """

    heading_reference: HeadingReference = "nose"
    uses: ClassVar[tuple[Instrument, ...]] = ("gyro", "accelerometer", "magnetometer")
    _earth: ClassVar[Array] = NORTH_EAST_DOWN  # the package's earth axes from ours
    _body: ClassVar[Array] = RIGHT_DOWN  # its body components are ours times this
    _limit_rad_s: ClassVar[float] = math.inf  # largest gyro bias that the package learns, per axis
    _finds_heading: ClassVar[bool] = False  # whether the package itself takes its heading from the first field

    def __init__(self, params: PeerParams) -> None:
        self.params = params
        self._uses = ("magnetometer" in self.uses and bool(params.use_magnetometer), "gps" in self.uses)
        self._state = np.zeros(1, STATE_DTYPE)
        # Views: looking up a field of a record takes microseconds.
        (
            self._R_eb, self._omega_b_rad_s, self._bias_b_rad_s, self._force_b_m_s2, self._field_b_ut,
        ) = (
            self._state[name][0]
            for name in ("R_eb", "omega_b_rad_s", "gyro_bias_b_rad_s", "force_b_m_s2", "field_b_ut")
        )  # fmt: skip
        self._dt_s, self._rejected, self._course_rad, self._at_limit_s = (
            self._state[name] for name in ("dt_s", "rejected", "course_rad", "at_limit_s")
        )
        self._offset_b_rad_s = np.zeros(3)
        self._magnetic = False  # whether the package's north is the magnetic one
        self._aligned = False  # whether a field or a course has set the heading
        self.reset()

    def reset(self, on_ground: ImuSample | None = None) -> None:
        """Power up: gyro offset and tilt from a mean sample at rest; without one, zero and level.

        The heading is north until the first field, or course, sets it.
        """
        s = self._state[0]
        self._state.fill(0)
        for name in RANGES:
            s[name] = getattr(self.params, name)
        s["course_age_s"] = math.inf
        write_calibration(self._state, self.params.calibration)
        self._offset_b_rad_s = np.zeros(3) if on_ground is None else offset_at_rest(on_ground)
        s["gyro_bias_b_rad_s"] = self._offset_b_rad_s
        s["R_eb"] = np.eye(3) if on_ground is None else attitude_at_rest(on_ground)
        self._magnetic, self._aligned = False, self._finds_heading
        self._start(self._theirs(s["R_eb"]), settled=on_ground is not None)

    def update(self, m: Measurements) -> AttitudeEstimate:
        """Take one tick's measurements, return the attitude at its end."""
        before = self.rejected
        good = _screen(m.rows, m.k, *self._uses, self._state)
        if good:
            tells_heading = 0 if self._aligned else good & (FIELD | COURSE)
            q = self._advance(self._heard(good & ~tells_heading))
            if _take_quaternion(q, self._earth, self._body, self._declination_rad, self._state):
                learnt = self._learnt()
                self._bias_b_rad_s[:] = self._offset_b_rad_s + self._body * learnt
                if self._limit_rad_s < math.inf:
                    _watch_limit(learnt, self._limit_rad_s, self._state)
                if tells_heading:
                    self._align(tells_heading)
            else:  # the package diverged: it restarts from the previous attitude
                self._rejected += 1
                self._start(self._theirs(self._R_eb), settled=True)
        return AttitudeEstimate(
            self._R_eb.copy(),
            self._omega_b_rad_s.copy(),
            self._bias_b_rad_s.copy(),
            None,
            Health.POOR if self.rejected != before or self._at_limit_s[0] >= AT_LIMIT_S else Health.GOOD,
        )

    @property
    def rejected(self) -> int:
        """Ticks since the reset in which something was rejected."""
        return int(self._rejected[0])

    @property
    def refused(self) -> dict[str, int]:
        """Samples rejected since the reset, by instrument."""
        return refusals(self._state)

    @property
    def _declination_rad(self) -> float:
        """Declination of the package's north from ours."""
        return self.params.declination_rad if self._magnetic else 0.0

    def _theirs(self, R_eb: Array) -> Array:
        """Quaternion in the axes of the package."""
        return to_quaternion(self._earth @ _about_down(-self._declination_rad) @ R_eb * self._body)

    def _align(self, by: int) -> None:
        """Set the heading from the field or the course that arrived; the tilt stays."""
        if by & FIELD:
            self._aligned = self._magnetic = bool(
                turn_to_north(self._R_eb, self._field_b_ut, self.params.declination_rad)
            )
        else:
            self._aligned = True
            self._R_eb[:] = _about_down(float(self._course_rad[0] - heading_rad(self._R_eb))) @ self._R_eb
        if self._aligned:
            self._turn(self._theirs(self._R_eb))

    def _heard(self, good: int) -> Heard:
        body = self._body
        # omega_b is less the whole estimated bias; the package subtracts its own part itself.
        gyro_b_rad_s = self._omega_b_rad_s + (self._bias_b_rad_s - self._offset_b_rad_s)
        return Heard(
            body * gyro_b_rad_s,
            body * self._force_b_m_s2 if good & FORCE_GOOD else None,
            body * self._field_b_ut if good & FIELD else None,
            float(self._course_rad[0]) if good & COURSE else None,
            float(self._dt_s[0]),
        )

    def _start(self, q: Array, *, settled: bool) -> None:
        """Start the package at the attitude `q` in its own axes, accurate if `settled`."""
        raise NotImplementedError

    def _turn(self, q: Array) -> None:
        """Set the package's attitude; its learnt state stays."""
        raise NotImplementedError

    def _advance(self, heard: Heard) -> Array:
        """One sample.  Returns the package's quaternion (w, x, y, z), float64."""
        raise NotImplementedError

    def _learnt(self) -> Array:
        """Gyro offset learnt by the package, beyond the calibration, shape (3,), its body axes."""
        return NOTHING_LEARNT


class Keeping(Peer):
    """A peer whose state can be read and set."""

    def snapshot(self) -> tuple[Any, ...]:
        """Everything that changes."""
        return (self._state.copy(), self._offset_b_rad_s.copy(), self._magnetic, self._aligned, self._kept())

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Continue from a `snapshot`."""
        state, offset, self._magnetic, self._aligned, kept = snapshot
        self._state[:], self._offset_b_rad_s = state, offset.copy()
        self._keep(kept)

    def _kept(self) -> Any:
        raise NotImplementedError

    def _keep(self, kept: Any) -> None:
        raise NotImplementedError
