"""What the autopilot sees: the measurements of a tick, with a fix that cannot be true held back.

Such a fix (`estimator.blocks.gps_integrity`) is none: the last sound one stays, and grows old, as in an outage.
"""

from estimator.blocks.gps_integrity import fix_is_sound
from estimator.compiler.jit import inlined, kernel


@inlined
def take_in(row, turn_rad_s, seen, s):  # type: ignore[no-untyped-def]
    """Copy the measured `row` into the record `seen`, except a fix that cannot be true, until the next one.

    turn_rad_s : rate about the vertical, of the estimate; NaN if it is not known
    s : record of `WATCH`, with `fix_held_back`, updated
    """
    seen.t_s, seen.dt_s = row.t_s, row.dt_s
    for i in range(3):
        seen.gyro_b_rad_s[i], seen.force_b_m_s2[i] = row.gyro_b_rad_s[i], row.force_b_m_s2[i]
        seen.mag_b_ut[i] = row.mag_b_ut[i]
    seen.mag_new, seen.air_new = row.mag_new, row.air_new
    seen.equivalent_airspeed_m_s, seen.baro_height_m = row.equivalent_airspeed_m_s, row.baro_height_m
    if row.gps_new:
        s.fix_held_back = 0 if fix_is_sound(row, turn_rad_s, s) else 1
    seen.gps_new = 0
    if not s.fix_held_back:
        take_in_fix(row, seen)


@kernel
def take_in_fix(row, seen):  # type: ignore[no-untyped-def]
    """Copy the columns of the GPS."""
    seen.gps_new, seen.gps_valid, seen.gps_t_s = row.gps_new, row.gps_valid, row.gps_t_s
    for i in range(3):
        seen.gps_p_e_m[i], seen.gps_v_e_m_s[i] = row.gps_p_e_m[i], row.gps_v_e_m_s[i]
    seen.gps_course_rad, seen.gps_speed_m_s = row.gps_course_rad, row.gps_speed_m_s
