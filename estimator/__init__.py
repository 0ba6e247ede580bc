"""Attitude estimators for a small aeroplane, and the conventions of the whole project.

Frames
------
``e``     local north-east-down, fixed at the launch point (earth-centred is spelled ``ecef``)
``b``     body, x forward, y along the right wing, z down, origin at the centre of gravity
``s``     a sensor's own axes

``R_eb`` takes body components to earth components, ``v_e = R_eb @ v_b``; adjacent letters cancel:
``R_es = R_eb @ R_bs``.  Its rows are the earth axes seen from the body, the paper's ``r_x*``, ``r_y*``,
``r_z*``: ``r_zx = R_eb[2, 0]`` is minus the sine of the pitch angle, ``r_zy = R_eb[2, 1]`` is the sine of the
bank angle times the cosine of the pitch angle.

Names
-----
A name reads quantity, frame, unit: ``omega_b_rad_s``, ``v_e_m_s``, ``p_e_m``, ``t_s``.  Rotations and
fractions carry no unit.  Code uses SI and radians.  Degrees appear in configuration and output, always with the
suffix; feet and pounds only in ``sim/aeroplane/jsbsim_model.py`` and ``sim/aeroplane/jsbsim_plant.py``.

Signs
-----
* Specific force ``force_b_m_s2`` is acceleration minus gravity: level at rest it is ``(0, 0, -9.8)``.  The
  paper's accelerometer is its negative; each estimator that follows the paper converts once and says where.
* The gyro measures the rate against inertial space, ``omega_b_rad_s``.
* ``gyro_bias_b_rad_s`` is reading minus true rate.  The paper's integral
  correction is its negative.
* ``wind_e_m_s`` is the velocity of the air over the ground: where it blows to.  On the command line wind is the
  direction it blows from.
* Commands ``aileron``, ``elevator``, ``rudder`` in -1..1 have the sign of the rotation they cause: roll right,
  nose up, nose right.  ``throttle`` is 0..1.
* Attitude error is the angle of ``R_est @ R_true.T``, split into inclination (the angle between the two
  ``r_z`` rows) and heading; never a difference of Euler angles.

Time
----
``t_s`` of a sample is the end of its interval.  A log row k holds the interval that ends at
``t_s = (k + 1) * dt_s`` after power-up.
"""

from collections.abc import Callable
from typing import TypeVar

ESTIMATORS: dict[str, str] = {
    "premerlani": "estimator.premerlani:Premerlani",
    "matrixpilot": "estimator.matrixpilot:MatrixPilot",
    "ap_dcm": "estimator.ap_dcm.ap_dcm:ApDcm",
    "ap_dcm_2013": "estimator.ap_dcm.ap_dcm:ApDcm2013",
    "gps_velocity": "estimator.gps_velocity:GpsVelocity",
    "gps_velocity_nose": "estimator.gps_velocity:GpsVelocityNose",
    "gps_velocity_magnetometer": "estimator.gps_velocity:GpsVelocityMagnetometer",
    "ins_ekf": "estimator.ins_ekf.ins_ekf:InsEkf",
    "starlino": "estimator.starlino:Starlino",
    "dilshad": "estimator.dilshad:Dilshad",
    "complementary": "estimator.complementary:Complementary",
    "gyro_only": "estimator.baselines:GyroOnly",
    "accelerometer_only": "estimator.baselines:AccelerometerOnly",
    "peer_madgwick": "estimator.peers.peers:Madgwick",
    "peer_mahony": "estimator.peers.peers:Mahony",
    "peer_vqf": "estimator.peers.peers:Vqf",
    "peer_imufusion": "estimator.peers.peers:Imufusion",
    "peer_imufusion_9d": "estimator.peers.peers:Imufusion9D",
}
"""Every registered estimator: name -> ``module:Class``, imported only when it flies."""

_Class = TypeVar("_Class", bound=type)


def register(name: str) -> Callable[[_Class], _Class]:
    """Class decorator: register your own estimator under `name`.

    Raises
    ------
    ValueError    another class has this name
    """

    def enter(cls: _Class) -> _Class:
        where = f"{cls.__module__}:{cls.__qualname__}"
        if ESTIMATORS.setdefault(name, where) != where:
            raise ValueError(f"estimator {name!r} is already {ESTIMATORS[name]}; choose another name")
        return cls

    return enter
