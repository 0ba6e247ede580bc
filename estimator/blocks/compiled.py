"""The Python side of a compiled estimator: its state is one record, its step one kernel.

An estimator module owns its kernel ``step(rows, k, state) -> Health``, runs it over a log in a kernel ``replay``,
and lets `Compiled` speak the `AttitudeEstimator` protocol.  Its state starts with the columns of `BELIEF`, and has
those of `WIND` if it estimates the wind; its replay then calls `write_wind` as well.
"""

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.blocks.screening import refusals
from estimator.compiler.jit import inlined
from estimator.interface import AttitudeEstimate, Column, Health, Instrument, Measurements, dtype_of

BELIEF = (
    Column("R_eb", (3, 3), "estimated body-to-earth rotation"),
    Column("omega_b_rad_s", (3,), "drift-corrected rate"),
    Column("gyro_bias_b_rad_s", (3,), "what the gyro is believed to read too much"),
)
WIND = (
    Column("wind_e_m_s", (3,), "estimated velocity of the air over the ground"),
    Column("wind_known", (), "1 once there is an estimate of it", integer=True),
)
ESTIMATE = (
    *BELIEF,
    Column("wind_e_m_s", (3,), "estimated wind, NaN where not estimated"),
    Column("health", (), "0 starting, 1 good, 2 poor", integer=True),
)
ESTIMATE_DTYPE = dtype_of(ESTIMATE)

_HEALTH = tuple(Health)  # an index into a tuple costs a tenth of a call of the enumeration


@inlined
def write_estimate(s, health, estimate):  # type: ignore[no-untyped-def]
    """Copy the belief of the state record `s` into a record of ESTIMATE, all of it; no wind (see `write_wind`)."""
    estimate.health = health
    for i in range(3):
        estimate.wind_e_m_s[i] = np.nan
        estimate.omega_b_rad_s[i] = s.omega_b_rad_s[i]
        estimate.gyro_bias_b_rad_s[i] = s.gyro_bias_b_rad_s[i]
        for j in range(3):
            estimate.R_eb[i, j] = s.R_eb[i, j]


@inlined
def write_wind(s, estimate):  # type: ignore[no-untyped-def]
    """Copy the wind that the state record `s` believes in into a record of ESTIMATE, where it is known."""
    if s.wind_known:
        for i in range(3):
            estimate.wind_e_m_s[i] = s.wind_e_m_s[i]


class Compiled:
    """An estimator around the kernels `_step` and `_replay` and a state record; a subclass brings these and `reset`.

    uses : which measurements it can make something of, for tables that say what each estimator was given
    """

    uses: ClassVar[tuple[Instrument, ...]] = ("gyro", "accelerometer", "gps")
    _step: ClassVar[Any]
    _replay: ClassVar[Any]

    def __init__(self, state_dtype: np.dtype[Any]) -> None:
        self._state = np.zeros(1, state_dtype)
        self._R_eb = self._state["R_eb"][0]
        self._omega_b_rad_s = self._state["omega_b_rad_s"][0]
        self._gyro_bias_b_rad_s = self._state["gyro_bias_b_rad_s"][0]
        estimates_wind = "wind_known" in (state_dtype.names or ())
        self._wind_known = self._state["wind_known"] if estimates_wind else np.zeros(1, np.int64)
        self._wind_e_m_s = self._state["wind_e_m_s"][0] if estimates_wind else np.zeros(3)

    def update(self, m: Measurements) -> AttitudeEstimate:
        """Take one tick's measurements, return the attitude at its end; the arrays are the caller's to keep."""
        health = self._step(m.rows, m.k, self._state)
        wind_e_m_s = self._wind_e_m_s.copy() if self._wind_known[0] else None
        return AttitudeEstimate(
            self._R_eb.copy(), self._omega_b_rad_s.copy(), self._gyro_bias_b_rad_s.copy(), wind_e_m_s, _HEALTH[health]
        )

    def replay(self, rows: NDArray[Any]) -> NDArray[Any]:
        """Run over a whole log in one call, from the present state on: bit for bit what `update` gives row by row.

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
        """Go on from a `snapshot`."""
        self._state[:] = snapshot

    @property
    def rejected(self) -> int:
        """Ticks in which something was not believed, since the reset."""
        return int(self._state["rejected"][0])

    @property
    def refused(self) -> dict[str, int]:
        """Samples not believed since the reset, by the instrument that they are of; those of none are left out."""
        return refusals(self._state)
