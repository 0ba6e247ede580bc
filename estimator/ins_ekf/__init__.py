"""An error-state Kalman filter: the bound that the other estimators are measured against."""

from estimator.ins_ekf.ins_ekf import STATE_DTYPE, InsEkf
from estimator.params.ins_ekf import InsEkfParams

__all__ = [
    "STATE_DTYPE",
    "InsEkf",
    "InsEkfParams",
]
