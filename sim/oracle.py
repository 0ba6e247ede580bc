"""The estimator that returns the truth: it tells a fault of the control from a fault of the estimation.

Not flight code: the loop shows it the log, as it shows it to nobody else.
"""

from estimator.interface import AttitudeEstimate, HeadingReference, Measurements
from sim.log import Log


class Oracle:
    """True attitude, rate, gyro bias and wind, at every tick."""

    heading_reference: HeadingReference = "nose"

    def __init__(self) -> None:
        self._log: Log | None = None

    def watch(self, log: Log) -> None:
        """Be shown the log of the flight to come."""
        self._log = log

    def update(self, m: Measurements) -> AttitudeEstimate:
        """The truth of this tick."""
        if self._log is None:
            raise RuntimeError("the oracle was shown no log: call watch(log) before the flight")
        row = self._log.truth[m.k]
        return AttitudeEstimate(
            row["R_eb"].copy(),
            row["omega_b_rad_s"].copy(),
            row["gyro_bias_b_rad_s"].copy(),
            row["wind_e_m_s"].copy(),
        )
