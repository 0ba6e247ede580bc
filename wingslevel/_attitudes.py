"""What `estimate` returns."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wingslevel._html import metric_table, number, page, text
from wingslevel._tables import require_pandas

if TYPE_CHECKING:
    import pandas as pd

    from scenarios.harness.replay import Replayed

Array = NDArray[np.float64]


class Attitudes:
    """What an estimator made of N inertial samples; every array has a row for each.

    With a calibration, the rows before `first` were averaged for the power-up; they repeat the first estimate.
    """

    def __init__(self, replayed: "Replayed") -> None:
        flown, first = replayed.log.flown.copy(), replayed.first
        for name in ("R_eb", "omega_b_rad_s", "gyro_bias_b_rad_s", "wind_e_m_s"):
            flown[name][:first] = flown[name][first]
        self._replayed, self._flown = replayed, flown

    @property
    def estimator(self) -> str:
        """Its name."""
        return self._replayed.estimator

    @property
    def first(self) -> int:
        """The first row that the estimator was given; those before were averaged for its power-up."""
        return self._replayed.first

    @property
    def calibration_b_rad_s(self) -> Array | None:
        """Shape (3,), gyro offset taken as the mean of the samples before `first`; None without a calibration."""
        return (
            np.asarray(self._replayed.log.measured["gyro_b_rad_s"][: self.first].mean(axis=0)) if self.first else None
        )

    @property
    def t_s(self) -> Array:
        """Shape (N,), end of each sample."""
        return np.asarray(self._replayed.log.measured["t_s"])

    @property
    def R_eb(self) -> Array:
        """Shape (N, 3, 3), body-to-earth rotations: ``v_e = R_eb @ v_b``; earth is north, east, down."""
        return np.asarray(self._flown["R_eb"])

    @property
    def euler_deg(self) -> Array:
        """Shape (N, 3), roll (right wing down), pitch (nose up) and heading (from north over east, 0..360)."""
        from estimator.rotation import to_euler

        angles = np.degrees(np.column_stack(to_euler(self.R_eb)))
        angles[:, 2] %= 360.0
        return angles

    @property
    def quaternion_eb(self) -> Array:
        """Shape (N, 4), the same rotations as unit quaternions, scalar first and not negative."""
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_matrix(self.R_eb).as_quat(canonical=True)[:, [3, 0, 1, 2]])

    @property
    def omega_b_rad_s(self) -> Array:
        """Shape (N, 3), angular rate without the estimated offset of the gyros."""
        return np.asarray(self._flown["omega_b_rad_s"])

    @property
    def gyro_bias_b_rad_s(self) -> Array:
        """Shape (N, 3), what the gyros read too much, as estimated."""
        return np.asarray(self._flown["gyro_bias_b_rad_s"])

    @property
    def wind_e_m_s(self) -> Array:
        """Shape (N, 3), velocity of the air over the ground; NaN where it is not estimated."""
        return np.asarray(self._flown["wind_e_m_s"])

    @property
    def health(self) -> NDArray[np.int64]:
        """Shape (N,), values of `Health`: 0 starting, 1 good, 2 poor."""
        return np.asarray(self._flown["health"])

    @property
    def heading_reference(self) -> str:
        """What the heading converges to: "course" over the ground, or "nose"."""
        return self._replayed.heading_reference

    @property
    def known(self) -> Mapping[str, Any]:
        """What the estimator was given of the instruments, or learnt: each with `value` and `source`."""
        return dict(self._replayed.known)

    @property
    def rejected(self) -> int | None:
        """Samples in which it did not believe something; None where it does not say."""
        return self._replayed.rejected

    @property
    def ns_per_update(self) -> float:
        """Time that an update took, nanoseconds."""
        return self._replayed.ns_per_update

    def __len__(self) -> int:
        return len(self._flown)

    def to_pandas(self) -> "pd.DataFrame":
        """Time, Euler angles, offset of the gyros, wind and health, a row for each sample; requires pandas."""
        require_pandas()
        import pandas as pd

        from estimator.interface import Health

        columns: dict[str, Any] = {"t_s": self.t_s}
        columns |= dict(zip(("roll_deg", "pitch_deg", "heading_deg"), self.euler_deg.T, strict=True))
        for name, axes in (("omega_b_rad_s", "xyz"), ("gyro_bias_b_rad_s", "xyz"), ("wind_e_m_s", "ned")):
            columns |= {f"{name}.{axis}": getattr(self, name)[:, i] for i, axis in enumerate(axes)}
        columns["health"] = self.health
        names = [member.name.lower() for member in Health]
        columns["health_name"] = pd.Categorical.from_codes(self.health.tolist(), categories=names)
        return pd.DataFrame(columns)

    def __repr__(self) -> str:
        taken = self.calibration_b_rad_s
        offset = "" if taken is None else ", ".join(f"{rate + 0.0:.3g}" for rate in np.degrees(taken))
        calibrated = f", calibrated over {self.first} samples: gyro offset ({offset}) deg/s" if offset else ""
        return f"<Attitudes of {self.estimator}, {len(self)} samples, {self.t_s[-1] - self.t_s[0]:.1f} s{calibrated}>"

    def _repr_html_(self) -> str:
        roll, pitch, heading = self.euler_deg[-1]
        about = f"{len(self)} samples, {number(float(self.t_s[-1] - self.t_s[0]))} s"
        last = {"roll at the end, deg": roll, "pitch at the end, deg": pitch, "heading at the end, deg": heading}
        last |= {"good, % of the samples": 100.0 * float(np.mean(self.health == 1))}
        return page(f"<b>attitude</b> &middot; {text(self.estimator)}", about, metric_table(last))
