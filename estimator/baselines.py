"""Two baselines for comparison: gyros alone, and tilt from the accelerometer alone.

`GyroOnly` shows what drift correction is worth: it is Eqns 16-21 of the paper without feedback.  `AccelerometerOnly`
takes every specific force for gravity.  One of the paper's authors tried that in a hand launch: the push looked like a
climb, and the controls dived.

References
----------
W. Premerlani and P. Bizard, "Direction Cosine Matrix IMU: Theory", 2009, section "Accelerometers".
"""

from typing import ClassVar

import numpy as np

from estimator.blocks.compiled import Compiled, state_dtype, write_estimate
from estimator.blocks.kernels import cross, dot, plus, put
from estimator.blocks.screening import FORCE_GOOD, health_of, screen, screen_gyro, take_rate
from estimator.compiler.jit import kernel
from estimator.interface import Column, ImuSample, Instrument
from estimator.params.shared import Params
from estimator.rotation import integrate, level, renormalise

STATE_DTYPE = state_dtype(Params, Column("tilt_from_force", (), "1 if the accelerometer sets the tilt", integer=True))


@kernel
def lean_on_force(R_eb, f):  # type: ignore[no-untyped-def]
    """Turn `R_eb`, in place, until its down axis is opposite to the specific force; the nose keeps its heading."""
    length = np.sqrt(dot(f, f))
    if length < 1e-3:  # free fall: no direction
        return
    down = (-f[0] / length, -f[1] / length, -f[2] / length)
    # The north row without its part along down, then east = down x north; north along down gives no heading.
    along = dot(R_eb[0], down)
    if abs(along) > 0.999:
        return
    put(R_eb[0], 1.0, plus(R_eb[0], -along, down))
    put(R_eb[1], 1.0, cross(down, R_eb[0]))
    if not renormalise(R_eb):
        level(R_eb)


@kernel
def step(rows, k, state):  # type: ignore[no-untyped-def]
    """One sample: integrate the gyros, set the tilt from the accelerometer if wanted; returns the `Health`."""
    row, s = rows[k], state[0]
    good = screen(row, s) if s.tilt_from_force else screen_gyro(row, s)
    if good:
        take_rate(row, s, good)
        integrate(s.R_eb, s.omega_b_rad_s, s.dt_s)
        if good & FORCE_GOOD:
            lean_on_force(s.R_eb, row.force_b_m_s2)
    return health_of(s, True, True)


@kernel
def _replay(rows, state, estimates):  # type: ignore[no-untyped-def]
    for k in range(rows.shape[0]):
        write_estimate(state[0], step(rows, k, state), estimates[k])


class GyroOnly(Compiled[None]):
    """Gyros alone, less the offset measured at power-up (Eqns 16-21): a baseline."""

    heading_reference = "nose"
    uses: ClassVar[tuple[Instrument, ...]] = ("gyro",)
    _step, _replay, _dtype = staticmethod(step), staticmethod(_replay), STATE_DTYPE
    _tilt_from_force = False

    def _begin(self, s: np.void, on_ground: ImuSample | None) -> None:  # noqa: ARG002
        s["tilt_from_force"] = self._tilt_from_force


class AccelerometerOnly(GyroOnly):
    """Tilt from the accelerometer alone, heading from the gyros: a baseline."""

    uses = ("gyro", "accelerometer")
    _tilt_from_force = True
