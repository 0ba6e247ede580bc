"""An error-state Kalman filter: the accuracy that the other estimators are compared with."""

from estimator.ins_ekf.ins_ekf import STATE_DTYPE, InsEkf
from estimator.params.ins_ekf import InsEkfParams

__all__ = [
    "STATE_DTYPE",
    "InsEkf",
    "InsEkfParams",
]
