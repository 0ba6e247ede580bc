"""An estimator that returns the truth: it separates control errors from estimation errors.

Not flight code: the loop gives it the log, and no other estimator.
"""

from estimator.interface import AttitudeEstimate, HeadingReference, Measurements
from sim.log import Log


class Oracle:
    """True attitude, rate, gyro bias and wind, at every tick."""

    heading_reference: HeadingReference = "nose"

    def __init__(self) -> None:
        self._log: Log | None = None

    def watch(self, log: Log) -> None:
        """Read the truth from `log`, the log of the next flight."""
        self._log = log

    def update(self, m: Measurements) -> AttitudeEstimate:
        """The truth of this tick."""
        if self._log is None:
            raise RuntimeError("the oracle has no log: call watch(log) before the flight")
        row = self._log.truth[m.k]
        names = ("R_eb", "omega_b_rad_s", "gyro_bias_b_rad_s", "wind_e_m_s")
        return AttitudeEstimate(*(row[name].copy() for name in names))
