"""What the adapters to estimators of others share: screening, calibration, axes; see `estimator.peers`."""

import importlib
import math
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.compiled import BELIEF
from estimator.interface import (
    Array,
    AttitudeEstimate,
    HeadingReference,
    Health,
    ImuSample,
    Instrument,
    Measurements,
    dtype_of,
)
from estimator.jit import kernel
from estimator.screening import (
    ALL_GOOD,
    FORCE_GOOD,
    FORCE_RANGE_M_S2,
    GYRO_RANGE_RAD_S,
    SCREEN,
    attitude_at_rest,
    offset_at_rest,
    screen,
    take_rate,
)

# In this order, because numba takes a record for a subtype of every one that begins like it, and says so aloud.
STATE_DTYPE = dtype_of((*SCREEN, *BELIEF))
WEAKEST_UT, STRONGEST_UT = 1.0, 1000.0  # outside it is no magnetic field of the earth, whatever iron is about

AS_OURS = np.eye(3)
LEFT_UP = np.diag([1.0, -1.0, -1.0])  # forward-left-up from forward-right-down, and back; north-west-up likewise
EAST_NORTH_UP = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # from north-east-down, and back


@kernel
def _screen(rows, k, state):  # type: ignore[no-untyped-def]
    """Judge row `k` and set the rate, less the believed bias; returns what is good."""
    row, s = rows[k], state[0]
    good = screen(row, s)
    if good:
        take_rate(row, s, good)
    return good


def package(name: str) -> Any:
    """The module `name`; ImportError in one line where it is not installed."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name.partition(".")[0]:
            raise
        raise ImportError(f'the package {error.name} is not installed: pip install "wingslevel[peers]"') from None


def to_quaternion(R: Array) -> Array:
    """Unit quaternion (w, x, y, z) of a rotation matrix, shape (4,)."""
    return np.asarray(Rotation.from_matrix(R).as_quat(scalar_first=True))


def to_matrix(q: Array) -> Array:
    """Rotation matrix of a quaternion (w, x, y, z) of any length but zero, shape (3, 3)."""
    w, x, y, z = (float(c) for c in q)
    n = 2.0 / (w * w + x * x + y * y + z * z)
    return np.array(
        [
            [1.0 - n * (y * y + z * z), n * (x * y - w * z), n * (x * z + w * y)],
            [n * (x * y + w * z), 1.0 - n * (x * x + z * z), n * (y * z - w * x)],
            [n * (x * z - w * y), n * (y * z + w * x), 1.0 - n * (x * x + y * y)],
        ]
    )


def _turn(R_eb: Array, angle_rad: float) -> Array:
    """`R_eb` turned about the vertical, to the right."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ R_eb


@dataclass(frozen=True, slots=True)
class PeerParams:
    """What all of them have in common.

    declination_rad : float     of magnetic north from true north, positive to the east; added to a magnetic heading
    """

    declination_rad: float = 0.0

    def __post_init__(self) -> None:
        if not abs(self.declination_rad) <= math.pi:
            raise ValueError(f"declination_rad is {self.declination_rad} rad; it must lie between -pi and pi")
        for f in fields(self):
            value = getattr(self, f.name)
            if f.name != "declination_rad" and not 0.0 <= value < math.inf:
                raise ValueError(f"{f.name} is {value}; it must be a finite number, zero or more")


class Peer:
    """What the adapters share: screening, calibration, axes.  A subclass brings `_start`, `_advance`, `_learnt`."""

    heading_reference: HeadingReference = "nose"
    uses: ClassVar[tuple[Instrument, ...]] = ("gyro", "accelerometer", "magnetometer")
    _earth: ClassVar[Array] = AS_OURS  # the package's earth axes from ours
    _body: ClassVar[Array] = AS_OURS  # its body axes from ours

    def __init__(self, params: PeerParams) -> None:
        self.params = params
        self._state = np.zeros(1, STATE_DTYPE)
        self._offset_b_rad_s = np.zeros(3)
        self._magnetic = False  # whether the heading has come from a magnetometer
        self.reset()

    def reset(self, on_ground: ImuSample | None = None) -> None:
        """Power up: gyro offset and tilt from the mean sample of something at rest; without, zero and level."""
        s = self._state[0]
        self._state.fill(0)
        s["gyro_range_rad_s"], s["force_range_m_s2"] = GYRO_RANGE_RAD_S, FORCE_RANGE_M_S2
        self._offset_b_rad_s = np.zeros(3) if on_ground is None else offset_at_rest(on_ground)
        s["gyro_bias_b_rad_s"] = self._offset_b_rad_s
        s["R_eb"] = np.eye(3) if on_ground is None else attitude_at_rest(on_ground)
        self._magnetic = False
        self._start(self._theirs(s["R_eb"]), settled=on_ground is not None)

    def update(self, m: Measurements) -> AttitudeEstimate:
        """Take one tick's measurements, return the attitude at its end."""
        s = self._state[0]
        before = s["rejected"]
        good = _screen(m.rows, m.k, self._state)
        if good:
            row = m.rows[m.k]
            learnt = s["gyro_bias_b_rad_s"] - self._offset_b_rad_s
            force = row["force_b_m_s2"] if good & FORCE_GOOD else None
            q = self._advance(s["omega_b_rad_s"] + learnt, force, row, float(s["dt_s"]))
            R_eb = self._earth.T @ to_matrix(q) @ self._body if 0.1 < np.linalg.norm(q) < 10.0 else None
            if R_eb is None:  # the package lost itself: it goes on from the attitude before
                s["rejected"] += 1
                self._start(self._theirs(s["R_eb"]), settled=True)
            else:
                s["R_eb"] = _turn(R_eb, self.params.declination_rad) if self._magnetic else R_eb
                s["gyro_bias_b_rad_s"] = self._offset_b_rad_s + self._learnt()
        poor = good != ALL_GOOD or s["rejected"] != before
        return AttitudeEstimate(
            s["R_eb"].copy(),
            s["omega_b_rad_s"].copy(),
            s["gyro_bias_b_rad_s"].copy(),
            None,
            Health.POOR if poor else Health.GOOD,
        )

    @property
    def rejected(self) -> int:
        """Ticks in which something was not believed, since the reset."""
        return int(self._state["rejected"][0])

    def _theirs(self, R_eb: Array) -> Array:
        """Quaternion in the axes of the package."""
        return to_quaternion(self._earth @ R_eb @ self._body.T)

    def _field(self, row: Any) -> Array | None:
        """The magnetometer's sample of this tick in the package's axes, None where there is none to be believed."""
        if not row["mag_new"]:
            return None
        field = row["mag_b_ut"]
        if not WEAKEST_UT < np.linalg.norm(field) < STRONGEST_UT:  # NaN is not either
            self._state["rejected"] += 1
            return None
        self._magnetic = True
        return np.asarray(self._body @ field)

    def _start(self, q: Array, *, settled: bool) -> None:
        """Start the package at the attitude `q` in its own axes, well known where `settled`."""
        raise NotImplementedError

    def _advance(self, gyro_b_rad_s: Array, force_b_m_s2: Array | None, row: Any, dt_s: float) -> Array:
        """One sample, in our axes; force None where it is not believed.  Returns the package's quaternion."""
        raise NotImplementedError

    def _learnt(self) -> Array:
        """Gyro offset that the package has found, beyond that of the calibration, shape (3,), our axes."""
        return np.zeros(3)


class Keeping(Peer):
    """A peer whose state can be read and set."""

    def snapshot(self) -> tuple[Any, ...]:
        """Everything that changes."""
        return (self._state.copy(), self._offset_b_rad_s.copy(), self._magnetic, self._kept())

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Go on from a `snapshot`."""
        state, offset, self._magnetic, kept = snapshot
        self._state[:], self._offset_b_rad_s = state, offset.copy()
        self._keep(kept)

    def _kept(self) -> Any:
        raise NotImplementedError

    def _keep(self, kept: Any) -> None:
        raise NotImplementedError
