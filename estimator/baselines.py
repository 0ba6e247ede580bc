"""Two estimators to measure the others against: gyros alone, and the accelerometer taken at its word.

`GyroOnly` shows what drift correction is worth: it is Eqns 16-21 of the paper without feedback.
`AccelerometerOnly` takes whatever the accelerometer feels for the pull of gravity.  One of the paper's authors
tried that in a hand launch: the push was felt as a climb, and the controls dived.

References
----------
W. Premerlani and P. Bizard, "Direction Cosine Matrix IMU: Theory", 2009, section "Accelerometers".
"""

from typing import Any, ClassVar

import numpy as np

from estimator.blocks.compiled import BELIEF, Compiled, write_estimate
from estimator.blocks.screening import (
    FORCE_GOOD,
    FORCE_RANGE_M_S2,
    GYRO_RANGE_RAD_S,
    SCREEN,
    attitude_at_rest,
    offset_at_rest,
    screen,
    screen_gyro,
    take_rate,
)
from estimator.compiler.jit import kernel
from estimator.interface import Column, HeadingReference, ImuSample, Instrument, dtype_of
from estimator.rotation import integrate, level, renormalise

STATE_DTYPE = dtype_of(
    (*BELIEF, *SCREEN, Column("tilt_from_force", (), "1 where the accelerometer sets the tilt", integer=True))
)


@kernel
def lean_on_force(R_eb, f):  # type: ignore[no-untyped-def]
    """Turn `R_eb`, in place, until its down axis is opposite to the specific force; the nose keeps its heading."""
    length = np.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
    if length < 1e-3:  # falling freely: no direction
        return
    x, y, z = -f[0] / length, -f[1] / length, -f[2] / length
    # The north row less its part along down, then east = down x north; a north row along down is no heading.
    along = R_eb[0, 0] * x + R_eb[0, 1] * y + R_eb[0, 2] * z
    if abs(along) > 0.999:
        return
    R_eb[0, 0] -= along * x
    R_eb[0, 1] -= along * y
    R_eb[0, 2] -= along * z
    R_eb[1, 0] = y * R_eb[0, 2] - z * R_eb[0, 1]
    R_eb[1, 1] = z * R_eb[0, 0] - x * R_eb[0, 2]
    R_eb[1, 2] = x * R_eb[0, 1] - y * R_eb[0, 0]
    if not renormalise(R_eb):
        level(R_eb)


@kernel
def step(rows, k, state):  # type: ignore[no-untyped-def]
    """One sample: integrate the gyros, and lean on the accelerometer where asked; returns the `Health`."""
    row, s = rows[k], state[0]
    good = screen(row, s) if s.tilt_from_force else screen_gyro(row, s)
    if good:
        take_rate(row, s, good)
        integrate(s.R_eb, s.omega_b_rad_s, s.dt_s)
        if good & FORCE_GOOD:
            lean_on_force(s.R_eb, row.force_b_m_s2)
    return 2 if s.spoilt else 1  # Health.POOR, Health.GOOD


@kernel
def _replay(rows, state, estimates):  # type: ignore[no-untyped-def]
    for k in range(rows.shape[0]):
        health = step(rows, k, state)
        write_estimate(state[0], health, estimates[k])


class GyroOnly(Compiled):
    """Eqns 16-21 without drift correction: gyros from power-up on, the offset measured there."""

    heading_reference: HeadingReference = "nose"
    uses: ClassVar[tuple[Instrument, ...]] = ("gyro",)
    _step: ClassVar[Any] = staticmethod(step)
    _replay: ClassVar[Any] = staticmethod(_replay)
    _tilt_from_force = False

    def __init__(self) -> None:
        super().__init__(STATE_DTYPE)
        self.reset()

    def reset(self, on_ground: ImuSample | None = None) -> None:
        """Power up: gyro offset and tilt from the mean sample of something at rest; without, zero and level."""
        s = self._state[0]
        self._state.fill(0)
        s["tilt_from_force"] = self._tilt_from_force
        s["gyro_range_rad_s"], s["force_range_m_s2"] = GYRO_RANGE_RAD_S, FORCE_RANGE_M_S2
        s["R_eb"] = np.eye(3) if on_ground is None else attitude_at_rest(on_ground)
        s["gyro_bias_b_rad_s"] = 0.0 if on_ground is None else offset_at_rest(on_ground)


class AccelerometerOnly(GyroOnly):
    """Tilt straight from the accelerometer at every sample, heading from the gyros."""

    uses: ClassVar[tuple[Instrument, ...]] = ("gyro", "accelerometer")
    _tilt_from_force = True
