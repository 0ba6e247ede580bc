"""Parameters of `estimator.premerlani`."""

import math
from dataclasses import dataclass
from typing import ClassVar

from estimator.interface import G_M_S2
from estimator.params.shared import Params

LEAST_CLIP_M_S2 = 1.5 * G_M_S2  # no accelerometer that flies has a smaller full scale


@dataclass(frozen=True, slots=True)
class PremerlaniParams(Params):
    """Gains and options; `estimator.params.gains.recommended_gains` derives gains from a recovery time.

    The default receiver is what `estimator.instruments` assumes.

    w_rp : -  weight of the roll-pitch correction (Eqn 28)
        higher: tilt errors fade sooner, but unmodelled acceleration tilts the estimate; lower: smoother, slower
    w_y : -  weight of the yaw correction (Eqn 28)
        higher: heading errors fade sooner, but wind and course noise get in; lower: smoother, slower
    w_y_until_lock : -  weight of the yaw correction until yaw is locked, where that is more than `w_y`
        higher: an unknown heading is found sooner, with overshoot; lower: later (0: `w_y` from the start)
    k_p : 1/s  proportional gain (Eqn 29)
        higher: all errors fade sooner, noise gets in; lower: smoother, drift stays longer
    k_i : 1/s^2  integral gain (Eqn 29); k_i / k_p is how fast a gyro offset is learnt
        higher: offsets are learnt sooner, but manoeuvres are learnt as offset; lower: steadier, slower to learn
    offset_limit_rad_s : rad/s  largest gyro offset, per axis, that is learnt after the calibration
        higher: a poor calibration can be recovered; lower: a long wrong correction does less harm
    integrate_below_rad_s : rad/s  the offset is learnt only while the aeroplane turns more slowly than this
        higher: learning goes on in turns and picks up their errors (inf: always); lower: less time to learn
    gps_lag_filter : switch  pass the nose through the receiver's filter and latency before comparing it with the course
        on: the course is compared with an equally late nose; off: a late receiver disturbs yaw and speed in turns
    gps_filter_s : s  time constant of the receiver's velocity filter; a wrong value makes the heading wrong while
        turning
        higher: the nose is filtered more; lower: less (0: not at all)
    gps_latency_s : s  age of a fix on arrival, at most 12.5; a wrong value makes the heading wrong while turning
        higher: a fix is compared with an older nose; lower: with a newer one
    rotate_history : switch  apply yaw corrections to the remembered noses too
        on: no receiver lag in the yaw loop, whatever its gain; off: a large `w_y` makes the heading oscillate
    launch_gate : -  no roll-pitch correction while the reference differs from gravity by more than this share
        higher: corrections also in launches and hard manoeuvres (inf: always); lower: the gyros coast more often
    force_full_scale_m_s2 : m/s^2  largest specific force that the accelerometer can read
        higher: clipped readings count as measured (inf: unknown); lower: sound readings are left out
    clip_m_s2 : m/s^2  an axis that reads this much counts as clipped; inf: 1 % below the full scale
        higher: clipped readings steer the tilt; lower: sound readings are left out
    find_clip : switch  take the largest reading of an axis for its full scale once it occurs twice
        on: clipping is found without a data sheet; off: the full scale must be known
    use_airspeed : switch  use a measured airspeed in Eqn 25 where there is one
        on: the centrifugal term is right in wind; off: ground speed is used
    turn_speed : switch  learn the speed of Eqn 25 in level turns
        on: better tilt in wind without an airspeed sensor; off: ground speed is used
    learn_wind : switch  learn the wind in turns, for Eqns 22 and 25; needs `rotate_history`
        on: the heading converges to the nose; off: to the course
    learn_held_s : s  for how long the offset is learnt quickly, before the model is first moved by a throw or a course
        higher: a long wait in the hand is used; lower: less harm if it flies without any GPS (0: off)
    min_speed_m_s : m/s  slowest speed at which a course is used
        higher: yaw stays uncorrected for longer at low speed; lower: the noisy course of a slow aeroplane is used
    elevation_m : m  elevation of the launch place above the sea, for the density of the air
        higher: a measured airspeed counts as a faster motion; lower: as a slower one
    """

    _unlimited: ClassVar = (
        "offset_limit_rad_s", "integrate_below_rad_s", "launch_gate", "force_full_scale_m_s2", "clip_m_s2",
    )  # fmt: skip
    w_rp: float = 0.3
    w_y: float = 1.2
    w_y_until_lock: float = 0.0
    k_p: float = 1.0
    k_i: float = 0.03
    offset_limit_rad_s: float = math.radians(6.0)
    integrate_below_rad_s: float = math.radians(20.0)
    gps_lag_filter: bool = True
    gps_filter_s: float = 0.0
    gps_latency_s: float = 0.3
    rotate_history: bool = True
    launch_gate: float = 0.2
    force_full_scale_m_s2: float = math.inf
    clip_m_s2: float = math.inf
    find_clip: bool = False
    use_airspeed: bool = True
    turn_speed: bool = False
    learn_wind: bool = False
    learn_held_s: float = 20.0
    min_speed_m_s: float = 3.0
    elevation_m: float = 0.0

    def __post_init__(self) -> None:
        Params.__post_init__(self)
        if self.force_full_scale_m_s2 <= G_M_S2:
            raise ValueError(
                f"force_full_scale_m_s2 is {self.force_full_scale_m_s2} m/s^2; gravity alone is {G_M_S2}, choose more"
            )
        if self.clip_m_s2 < LEAST_CLIP_M_S2:
            raise ValueError(f"clip_m_s2 is {self.clip_m_s2} m/s^2; choose {LEAST_CLIP_M_S2:.1f} or more")
        if self.learn_wind and not self.rotate_history:
            raise ValueError("learn_wind needs rotate_history: wind is learnt from a nose free of corrections")
