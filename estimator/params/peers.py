"""Parameters of `estimator.peers`; the defaults are those of the packages."""

from dataclasses import dataclass

from estimator.params.shared import MagnetometerParams


@dataclass(frozen=True, slots=True)
class PeerParams(MagnetometerParams):
    """What the peers have in common; the packages are given calibrated samples.

    use_magnetometer : switch  use the magnetometer where the package can
        on: magnetic heading; off: for a magnetometer that is not calibrated
    """

    use_magnetometer: bool = True


@dataclass(frozen=True, slots=True)
class MadgwickParams(PeerParams):
    """Gains of `peer_madgwick`.

    gain_imu : rad/s  size of the correction without a magnetometer sample
        higher: tilt errors fade sooner, but accelerations get in; lower: smoother, a faster gyro drift is not corrected
    gain_marg : rad/s  size of the correction with one
        higher: tilt and heading errors fade sooner, but disturbances get in; lower: smoother, slower
    """

    gain_imu: float = 0.033
    gain_marg: float = 0.041


@dataclass(frozen=True, slots=True)
class MahonyParams(PeerParams):
    """Gains of `peer_mahony`.

    k_p : 1/s  proportional gain
        higher: errors fade sooner, but accelerations get in; lower: smoother, slower
    k_i : 1/s^2  integral gain
        higher: gyro bias is learnt sooner, but manoeuvres are learnt as bias; lower: steadier, slower
    """

    k_p: float = 1.0
    k_i: float = 0.3


@dataclass(frozen=True, slots=True)
class VqfParams(PeerParams):
    """Time constants of `peer_vqf`.

    tau_acc_s : s  time constant of the accelerometer's correction
        higher: accelerations get in less, drift stays longer; lower: tilt errors fade sooner
    tau_mag_s : s  time constant of the magnetometer's correction
        higher: disturbances of the field get in less; lower: heading errors fade sooner
    """

    tau_acc_s: float = 3.0
    tau_mag_s: float = 9.0


@dataclass(frozen=True, slots=True)
class ImufusionParams(PeerParams):
    """Settings of `peer_imufusion` and `peer_imufusion_9d`, as in the package's own examples.

    gain : rad/s  correction by accelerometer and heading, per unit of error
        higher: errors fade sooner, but accelerations get in; lower: smoother, slower
    gyroscope_range_deg_s : deg/s  a faster rate counts as out of range and restarts the package's start-up
        higher: fast rotations are followed; lower: the package restarts more often (0: never)
    acceleration_rejection_deg : deg  a larger tilt error is ignored
        higher: accelerations get in more often; lower: real errors are ignored for longer (0: nothing is ignored)
    magnetic_rejection_deg : deg  a larger heading error is ignored
        higher: disturbances get in more often; lower: real errors are ignored for longer (0: nothing is ignored)
    rejection_timeout_s : s  errors that last this long are no longer ignored
        higher: long manoeuvres are ridden out; lower: a wrong attitude recovers sooner
    """

    gain: float = 0.5
    gyroscope_range_deg_s: float = 2000.0
    acceleration_rejection_deg: float = 10.0
    magnetic_rejection_deg: float = 10.0
    rejection_timeout_s: float = 5.0
