"""The frame of a compiled estimator: its state is one record, its step one kernel.

An estimator module has a kernel ``step(rows, k, state) -> Health``: `rows` of `MEASURED_DTYPE` are read at row `k`,
`state`, shape (1,), is read and written.  A kernel ``_replay`` calls it for a whole log.  `Compiled` does the rest: it
holds the state, puts the parameters into it, and speaks the `AttitudeEstimator` protocol.
"""

from dataclasses import fields
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from estimator.blocks.magnetometer import write_calibration
from estimator.blocks.screening import SCREEN, attitude_at_rest, offset_at_rest, refusals
from estimator.compiler.jit import inlined
from estimator.interface import AttitudeEstimate, Column, Health, ImuSample, Instrument, Measurements, dtype_of
from estimator.params.shared import RANGES, MagnetometerParams, Params, numbers_of

BELIEF = (
    Column("R_eb", (3, 3), "estimated body-to-earth rotation"),
    Column("omega_b_rad_s", (3,), "drift-corrected rate"),
    Column("gyro_bias_b_rad_s", (3,), "estimated gyro bias: reading minus true rate"),
    Column("calibrated_offset_b_rad_s", (3,), "gyro bias measured at power-up"),
    Column("wind_e_m_s", (3,), "estimated velocity of the air over the ground"),
    Column("wind_known", (), "1 once the wind is estimated", integer=True),
)
ESTIMATE = (
    *BELIEF[:3],
    Column("wind_e_m_s", (3,), "estimated wind, NaN where not estimated"),
    Column("health", (), "0 starting, 1 good, 2 poor", integer=True),
)
ESTIMATE_DTYPE = dtype_of(ESTIMATE)

_HEALTH = tuple(Health)  # an index into a tuple costs a tenth of a call of the enumeration

P = TypeVar("P", bound=Params | None, covariant=True)


def state_dtype(params: type[Params], *columns: Column) -> np.dtype[Any]:
    """Record type of a state: `BELIEF`, `SCREEN`, the numbers and switches of `params`, and `columns`."""
    of_params = (
        Column(f.name, (), f"see {params.__name__}", integer=isinstance(f.default, int))
        for f in fields(params)
        if f.name in numbers_of(params) and f.name not in RANGES  # those are columns of SCREEN and FIELD
    )
    return dtype_of((*BELIEF, *SCREEN, *of_params, *columns))


@inlined
def write_estimate(s, health, estimate):  # type: ignore[no-untyped-def]
    """Copy the belief of the state record `s` into a record of `ESTIMATE`."""
    estimate.health = health
    for i in range(3):
        estimate.wind_e_m_s[i] = s.wind_e_m_s[i] if s.wind_known else np.nan
        estimate.omega_b_rad_s[i] = s.omega_b_rad_s[i]
        estimate.gyro_bias_b_rad_s[i] = s.gyro_bias_b_rad_s[i]
        for j in range(3):
            estimate.R_eb[i, j] = s.R_eb[i, j]


class Compiled(Generic[P]):
    """An estimator around a state record and the kernels `_step` and `_replay`.

    A subclass names its kernels, the type of its state, its default parameters, and in `_begin` sets the columns of its
    own that do not start at zero.

    Parameters
    ----------
    params : see the parameter class; the defaults where none are given

    Attributes
    ----------
    uses : measurements that the estimator can use
    """

    uses: ClassVar[tuple[Instrument, ...]] = ("gyro", "accelerometer", "gps")
    _step: ClassVar[Any]
    _replay: ClassVar[Any]
    _dtype: ClassVar[np.dtype[Any]]
    _default: ClassVar[Any] = None

    def __init__(self, params: P | None = None) -> None:
        self.params: P = self._default if params is None else params
        self._state = np.zeros(1, self._dtype)
        belief = ("R_eb", "omega_b_rad_s", "gyro_bias_b_rad_s", "wind_e_m_s")
        self._belief = tuple(self._state[name][0] for name in belief)  # views: looking up a field takes microseconds
        self._wind_known = self._state["wind_known"]
        self.reset()

    def reset(self, on_ground: ImuSample | None = None) -> None:
        """Power up: gyro offset and tilt from the mean sample `on_ground`, taken at rest; heading north.

        Without a sample (a start in the air), or with one that is not of something at rest: offset zero, level.
        """
        self._state.fill(0)
        s = self._state[0]
        params = self.params if isinstance(self.params, Params) else Params()
        for name in numbers_of(type(params)):
            s[name] = getattr(params, name)
        if isinstance(params, MagnetometerParams):
            write_calibration(self._state, params.calibration)
        s["R_eb"] = np.eye(3) if on_ground is None else attitude_at_rest(on_ground)
        s["calibrated_offset_b_rad_s"] = 0.0 if on_ground is None else offset_at_rest(on_ground)
        s["gyro_bias_b_rad_s"] = s["calibrated_offset_b_rad_s"]
        self._begin(s, on_ground)

    def _begin(self, s: np.void, on_ground: ImuSample | None) -> None:
        """Set further columns of the state record `s` at power-up."""

    def update(self, m: Measurements) -> AttitudeEstimate:
        """Take one tick's measurements, return the attitude at its end; the arrays are the caller's to keep."""
        health = self._step(m.rows, m.k, self._state)
        R_eb, omega_b_rad_s, gyro_bias_b_rad_s, wind_e_m_s = self._belief
        return AttitudeEstimate(
            R_eb.copy(),
            omega_b_rad_s.copy(),
            gyro_bias_b_rad_s.copy(),
            wind_e_m_s.copy() if self._wind_known[0] else None,
            _HEALTH[health],
        )

    def replay(self, rows: NDArray[Any]) -> NDArray[Any]:
        """Run over a whole log in one call, from the present state on: bit for bit as `update` row by row.

        Parameters
        ----------
        rows : shape (N,), MEASURED_DTYPE

        Returns
        -------
        shape (N,), ESTIMATE_DTYPE: R_eb, omega_b_rad_s, gyro_bias_b_rad_s, wind_e_m_s, health
        """
        estimates = np.empty(len(rows), ESTIMATE_DTYPE)
        self._replay(rows, self._state, estimates)
        return estimates

    def snapshot(self) -> NDArray[Any]:
        """Everything that changes, and the parameters, as one record of shape (1,)."""
        return self._state.copy()

    def restore(self, snapshot: NDArray[Any]) -> None:
        """Continue from a `snapshot`."""
        self._state[:] = snapshot

    @property
    def rejected(self) -> int:
        """Ticks since the reset in which something was rejected."""
        return int(self._state["rejected"][0])

    @property
    def refused(self) -> dict[str, int]:
        """Samples rejected since the reset, by instrument; instruments without any are left out."""
        return refusals(self._state)
