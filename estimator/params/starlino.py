"""Parameters of `estimator.starlino`."""

from dataclasses import dataclass
from typing import ClassVar

from estimator.params.shared import MagnetometerParams


@dataclass(frozen=True, slots=True)
class StarlinoParams(MagnetometerParams):
    """Weights per sample; the tutorial's author finds 20 and 1 good in most cases (comment 49) and gives no `s_m`.

    s_g : -  weight of the gyro, per sample; errors fade with a time constant of (s_g + s_a) / s_a samples
        higher: smoother, slower to correct; lower: accelerations tilt the estimate sooner
    s_a : -  weight of the accelerometer, per sample
        higher: tilt errors fade sooner, but accelerations get in; lower: smoother, slower
    s_m : -  weight of the magnetometer, per sample
        higher: heading errors fade sooner, but disturbances of the field get in; lower: smoother, slower
    band : -  the accelerometer's weight falls linearly to zero where its length is off gravity by this share
        higher: it counts in harder manoeuvres too (inf: always fully); lower: it counts near 1 g only
    use_magnetometer : switch  use the magnetometer's samples where they come
        on: 9-DOF, magnetic heading; off: 6-DOF, the heading drifts with the gyros
    """

    _positive: ClassVar = ("s_g",)
    _unlimited: ClassVar = ("band",)
    s_g: float = 20.0
    s_a: float = 1.0
    s_m: float = 1.0
    band: float = 0.2
    use_magnetometer: bool = True
