"""ArduPilot's DCM estimator."""

from estimator.ap_dcm.ap_dcm import STATE_DTYPE, ApDcm, ApDcm2013
from estimator.ap_dcm.yaw import spin_gain
from estimator.params.ap_dcm import JULY_2013, ApDcmParams, Quirk

__all__ = [
    "JULY_2013",
    "STATE_DTYPE",
    "ApDcm",
    "ApDcm2013",
    "ApDcmParams",
    "Quirk",
    "spin_gain",
]
