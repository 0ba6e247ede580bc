"""ArduPilot's DCM estimator."""

from estimator.ap_dcm.ap_dcm import STATE_DTYPE, ApDcm, ApDcm2013, spin_gain
from estimator.ap_dcm.params import JULY_2013, ApDcmParams, Quirk

__all__ = [
    "JULY_2013",
    "STATE_DTYPE",
    "ApDcm",
    "ApDcm2013",
    "ApDcmParams",
    "Quirk",
    "spin_gain",
]
