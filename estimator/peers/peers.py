"""Published estimators from other packages behind our interface, for comparison with ours.

They need the optional extra ``pip install "wingslevel[peers]"``.  An adapter screens the samples like every estimator
here, subtracts the gyro offset measured at power-up, converts to the axes and units of the package, and converts the
result back.  It adds no correction of its own.

=================  =====================================  ===========================  ==============================
name               package                                earth axes, body axes        also takes
=================  =====================================  ===========================  ==============================
peer_madgwick      ahrs, `Madgwick`                       north-west-up, fwd-left-up   magnetometer, where fitted
peer_mahony        ahrs, `Mahony`                         east-north-up, fwd-left-up   magnetometer, where fitted
peer_vqf           vqf, `VQF`: 6D, or 9D                  east-north-up, fwd-left-up   magnetometer, where fitted (9D)
peer_imufusion     imufusion, `update_external_heading`   north-east-down              GPS course as heading
peer_imufusion_9d  imufusion, `update`                    north-east-down              magnetometer, where fitted
=================  =====================================  ===========================  ==============================

None of them models centrifugal acceleration, speed or wind.  Without a magnetometer the heading of the first three is
that of the gyros.

All start with the heading of the first plausible field, or of the first course: from north their corrections would take
minutes.  VQF does this itself with its first field.

Peculiarities of the packages
-----------------------------
*ahrs 0.4* returns the attitude uncorrected if the gyro reads exactly zero on all three axes.

*imufusion 1.3* ignores ``AhrsSettings(convention=...)``; the attribute works.  Its external heading assumes a body that
rolls and does not pitch: at the pitch theta it settles where ``tan(yaw) = tan(heading) / cos(theta)``.
``update_no_magnetometer`` resets the heading to zero at every call of its first 3 s; ``update`` with a zero field is
the same without that.  It computes in single precision, and its state can neither be read nor set: no `snapshot`.

*vqf 2.1* takes one sample interval, and one of the magnetometer, at construction: those of the first sample, and
between the first two of the magnetometer.  A sample after lost ones is repeated to cover them; if the
interval jitters the rate is scaled, so that the angle is right.

References
----------
S. O. H. Madgwick, A. J. L. Harrison and R. Vaidyanathan, "Estimation of IMU and MARG orientation using a gradient
descent algorithm", ICORR 2011.  R. Mahony, T. Hamel and J.-M. Pflimlin, "Nonlinear complementary filters on the
special orthogonal group", IEEE TAC 53(5), 2008.  D. Laidig and T. Seel, "VQF: Highly accurate IMU orientation
estimation with bias estimation and magnetic disturbance rejection", Information Fusion 91, 2023.
"""

import math
from typing import Any, ClassVar

import numpy as np

from estimator.interface import G_M_S2, Array, HeadingReference, Instrument
from estimator.params.peers import ImufusionParams, MadgwickParams, MahonyParams, VqfParams
from estimator.peers.peer import EAST_NORTH_UP, LEFT_UP, NORTH_WEST_UP, Heard, Keeping, Peer, package

NO_FORCE, NO_FIELD = np.zeros(3), np.zeros(3)
SHORTEST_S = 5e-4  # shortest sample interval that a package is given


class _Ahrs(Keeping):
    """The two of the package ahrs: the caller holds the quaternion; MARG if a field arrived, else IMU."""

    _body = LEFT_UP

    def _start(self, q: Array, *, settled: bool) -> None:  # noqa: ARG002 - they have no start-up
        self._q = q
        self._make()

    def _turn(self, q: Array) -> None:
        self._q = q

    def _make(self) -> None:
        raise NotImplementedError

    def _advance(self, heard: Heard) -> Array:
        # Zero force means "no accelerometer" to them: they integrate then.
        force = NO_FORCE if heard.force_m_s2 is None else heard.force_m_s2
        self._magnetic |= heard.field_ut is not None
        self._q = np.array(self._step(heard.gyro_rad_s, force, heard.field_ut, heard.dt_s), np.float64)
        return self._q

    def _step(self, gyro: Array, force: Array, field: Array | None, dt_s: float) -> Any:
        raise NotImplementedError


class Madgwick(_Ahrs):
    """Madgwick's gradient descent, from the package ahrs."""

    _earth = NORTH_WEST_UP
    params: MadgwickParams

    def __init__(self, params: MadgwickParams | None = None) -> None:
        self._filters = package("ahrs.filters")
        super().__init__(params or MadgwickParams())

    def _make(self) -> None:
        self._imu = self._filters.Madgwick(gain=self.params.gain_imu)
        self._marg = self._filters.Madgwick(gain=self.params.gain_marg)

    def _step(self, gyro: Array, force: Array, field: Array | None, dt_s: float) -> Any:
        if field is None:
            return self._imu.updateIMU(self._q, gyro, force, dt_s)
        return self._marg.updateMARG(self._q, gyro, force, field, dt_s)

    def _kept(self) -> Array:
        return self._q.copy()

    def _keep(self, kept: Array) -> None:
        self._q = kept.copy()


class Mahony(_Ahrs):
    """Mahony's complementary filter with bias estimation, from the package ahrs."""

    _earth = EAST_NORTH_UP
    params: MahonyParams

    def __init__(self, params: MahonyParams | None = None) -> None:
        self._filters = package("ahrs.filters")
        super().__init__(params or MahonyParams())

    def _make(self) -> None:
        self._filter = self._filters.Mahony(k_P=self.params.k_p, k_I=self.params.k_i)

    def _step(self, gyro: Array, force: Array, field: Array | None, dt_s: float) -> Any:
        if field is None:
            return self._filter.updateIMU(self._q, gyro, force, dt_s)
        return self._filter.updateMARG(self._q, gyro, force, field, dt_s)

    def _learnt(self) -> Array:
        return np.asarray(self._filter.b)

    def _kept(self) -> tuple[Array, Array]:
        return self._q.copy(), self._filter.b.copy()

    def _keep(self, kept: tuple[Array, Array]) -> None:
        self._q, self._filter.b = kept[0].copy(), kept[1].copy()


class Vqf(Keeping):
    """VQF of Laidig and Seel, from the package vqf: 6D, and 9D from the second magnetometer sample on."""

    _earth, _body = EAST_NORTH_UP, LEFT_UP
    _limit_rad_s = math.radians(2.0)  # its parameter biasClip, which stays at its default
    _finds_heading = True
    params: VqfParams

    def __init__(self, params: VqfParams | None = None) -> None:
        self._vqf = package("vqf")
        super().__init__(params or VqfParams())

    def _start(self, q: Array, *, settled: bool) -> None:  # noqa: ARG002 - it averages its first seconds itself
        self._filter: Any = None  # its interval is unknown before the first sample
        self._q = q
        self._intervals_s = (0.0, 0.0)  # of gyro and accelerometer, of the magnetometer
        self._clock_s, self._field_at_s = 0.0, -1.0
        self._magnetic = False

    def _make(self, imu_s: float, mag_s: float) -> None:
        """A filter for these intervals, in the state of the previous one."""
        p, before = self.params, self._filter
        options = {"tauAcc": p.tau_acc_s, "tauMag": p.tau_mag_s}
        self._filter = self._vqf.VQF(imu_s, imu_s, mag_s or imu_s, **options)
        self._filter.state = {**self._filter.state, "gyrQuat": self._q} if before is None else before.state
        self._intervals_s = (imu_s, mag_s)

    def _advance(self, heard: Heard) -> Array:
        self._clock_s += heard.dt_s
        if self._filter is None:
            self._make(max(heard.dt_s, SHORTEST_S), 0.0)
        each_s = self._intervals_s[0]
        times = max(1, round(heard.dt_s / each_s))
        gyro = heard.gyro_rad_s * (heard.dt_s / (times * each_s))
        for _ in range(times):
            self._filter.updateGyr(gyro)
            if heard.force_m_s2 is not None:
                self._filter.updateAcc(heard.force_m_s2)
        if heard.field_ut is not None:
            self._take_field(heard.field_ut)
        return np.asarray(self._filter.getQuat9D() if self._magnetic else self._filter.getQuat6D())

    def _take_field(self, field_ut: Array) -> None:
        """Pass on the magnetometer's sample, from the second one on: then their interval is known."""
        imu_s, mag_s = self._intervals_s
        if not mag_s and self._field_at_s >= 0.0:
            self._make(imu_s, max(self._clock_s - self._field_at_s, imu_s))
            self._magnetic = True
        self._field_at_s = self._clock_s
        if self._magnetic:
            self._filter.updateMag(field_ut)

    def _learnt(self) -> Array:
        return np.asarray(self._filter.getBiasEstimate()[0])

    def _kept(self) -> tuple[Any, ...]:
        state = None if self._filter is None else self._filter.state
        return self._q.copy(), self._intervals_s, self._clock_s, self._field_at_s, state

    def _keep(self, kept: tuple[Any, ...]) -> None:
        self._q, self._intervals_s, self._clock_s, self._field_at_s, state = kept
        self._filter = None
        if state is not None:
            self._make(*self._intervals_s)
            self._filter.state = state


class Imufusion(Peer):
    """x-io's Fusion, from the package imufusion, with the GPS course as its external heading."""

    heading_reference: HeadingReference = "course"
    uses: ClassVar[tuple[Instrument, ...]] = ("gyro", "accelerometer", "gps")
    params: ImufusionParams

    def __init__(self, params: ImufusionParams | None = None) -> None:
        self._fusion = package("imufusion")
        super().__init__(params or ImufusionParams())

    def _start(self, q: Array, *, settled: bool) -> None:
        self._filter, self._has_interval = self._fusion.Ahrs(), False
        if settled:
            self._filter.skip_startup()  # else it corrects hard for its first seconds
        self._filter.set_quaternion(q)

    def _turn(self, q: Array) -> None:
        self._filter.set_quaternion(q)

    def _set(self, sample_hz: float) -> None:
        p, settings = self.params, self._fusion.AhrsSettings()
        settings.convention = self._fusion.CONVENTION_NED  # as a keyword argument it is ignored
        settings.sample_rate, settings.gain = sample_hz, p.gain
        settings.gyroscope_range = p.gyroscope_range_deg_s
        settings.acceleration_rejection = p.acceleration_rejection_deg
        settings.magnetic_rejection = p.magnetic_rejection_deg
        settings.rejection_timeout = p.rejection_timeout_s
        self._filter.set_settings(settings)
        self._has_interval = True

    def _advance(self, heard: Heard) -> Array:
        if not self._has_interval:
            self._set(1.0 / max(heard.dt_s, SHORTEST_S))
        self._filter.set_sample_period(heard.dt_s)
        force_g = NO_FORCE if heard.force_m_s2 is None else heard.force_m_s2 / G_M_S2  # NED: level is (0, 0, -1)
        self._give(np.degrees(heard.gyro_rad_s), force_g, heard)
        return np.asarray(self._filter.get_quaternion(), np.float64)

    def _give(self, gyro_deg_s: Array, force_g: Array, heard: Heard) -> None:
        if heard.course_rad is None:
            self._filter.update(gyro_deg_s, force_g, NO_FIELD)
        else:
            self._filter.update_external_heading(gyro_deg_s, force_g, math.degrees(heard.course_rad))


class Imufusion9D(Imufusion):
    """x-io's Fusion, from the package imufusion, with a magnetometer."""

    heading_reference: HeadingReference = "nose"
    uses: ClassVar[tuple[Instrument, ...]] = ("gyro", "accelerometer", "magnetometer")

    def _give(self, gyro_deg_s: Array, force_g: Array, heard: Heard) -> None:
        if heard.field_ut is None:
            self._filter.update(gyro_deg_s, force_g, NO_FIELD)
        else:
            self._magnetic = True
            self._filter.update(gyro_deg_s, force_g, heard.field_ut)
