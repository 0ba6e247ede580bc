"""How a GPS receiver makes its fixes: filter, latency, errors, smoothing, static navigation, resolution, course.

Position and velocity pass a first-order filter, dy/dt = (u - y) / T, as small receivers show in turns.  The velocity
is filtered as a vector, so in a turn at the rate w it lags by atan(wT) and shrinks by 1 / sqrt(1 + (wT)^2).  Fix j is
valid at physics step j * steps_per_fix (interpolated between two ticks), is stamped with that time, and arrives in
the first tick that ends at least the latency later.  The log rows serve as filter memory and latency buffer.

The filter output plus its errors then passes these stages, in this order, as far as they are enabled:

track smoothing     A second filter from fix to fix, as offered by receivers for cars.  Assumed:
                    v^ += g (v - v^),  p^ += h + g (p - p^ - h),  g = 1 - exp(-dt / T),  h the distance at the
                    mean of the old and new v^: steady flight is reported without lag; jumps of position and
                    turns are followed with the time constant T.
static navigation   While the horizontal speed is below the limit, position and course are held and the velocity
                    is zero.  Assumed: no hysteresis, no limit on the distance.
resolution          Each message field is rounded to its nearest step; latitude and longitude with the metres per
                    degree at the launch point, which is itself a whole number of steps.  NMEA (RMC, GGA) has
                    speed and course but no vertical velocity: zero is reported.  UBX NAV-PVT has all three
                    components, speed and course.
course              From the velocity, or from three reported positions: the mean of their two velocities
                    (Dilshad & Jahan 2014, Eqn 9), in a steady turn one fix interval old.  Velocity and speed of
                    the fix are then that mean too, and fixes begin with the third position.

In an outage no fix is made; fixes already under way arrive.  The filter has settled when the outage ends.
"""

import numpy as np

from estimator.compiler.jit import kernel
from sim.sensors.noise import to_step

MEMORY = np.dtype(
    [
        ("fixes", "i8"),  # made since power-up
        ("p_e_m", "f8", (3,)),  # smoothed, before rounding
        ("v_e_m_s", "f8", (3,)),
        ("course_rad", "f8"),
        ("track_e_m", "f8", (3, 3)),  # the last three reported positions, oldest first
        ("track_step", "i8", (3,)),  # and their times
    ],
    align=True,
)
_BELOW_TWO_PI = float(np.nextafter(2.0 * np.pi, 0.0))  # a course of -1e-17 must not round up to a full circle


@kernel
def receive(truth, measured, noise, k, unit, memory):  # type: ignore[no-untyped-def]
    """Filter in tick `k`, hold the last fix or report a new one; `unit`, `memory`: of gps.UNIT and MEMORY."""
    _filter(truth, k, unit)
    measured[k].gps_new = 0
    if k == 0:
        measured[k].gps_valid = 0
    else:
        hold(measured[k - 1], measured[k])
    # Step of the newest fix that can have arrived by the end of this tick.
    spt, spf = unit.steps_per_tick, unit.steps_per_fix
    step = ((k + 1) * spt - unit.latency_steps) // spf * spf
    if step + unit.latency_steps > k * spt and step >= max(unit.first_fix_step, spf):
        at = (step + spt - 1) // spt - 1  # the row of the tick that `step` lies in
        if not noise[at].satellites_lost and not _report(truth, measured[k], noise, step, at, unit, memory):
            hold(measured[k - 1], measured[k])


@kernel
def _filter(truth, k, unit):  # type: ignore[no-untyped-def]
    row = truth[k]
    if k == 0:  # as after a long time at this velocity
        for i in range(3):
            row.gps_v_e_m_s[i] = row.v_e_m_s[i]
            row.gps_p_e_m[i] = row.p_e_m[i] - unit.filter_s * row.v_e_m_s[i]
        return
    last = truth[k - 1]
    a, b, c = unit.before, unit.start, unit.end
    for i in range(3):
        row.gps_v_e_m_s[i] = a * last.gps_v_e_m_s[i] + b * last.v_e_m_s[i] + c * row.v_e_m_s[i]
        row.gps_p_e_m[i] = a * last.gps_p_e_m[i] + b * last.p_e_m[i] + c * row.p_e_m[i]


@kernel
def hold(last, row):  # type: ignore[no-untyped-def]
    """Copy the fix of the row `last` into `row`."""
    row.gps_valid = last.gps_valid
    row.gps_t_s = last.gps_t_s
    for i in range(3):
        row.gps_p_e_m[i] = last.gps_p_e_m[i]
        row.gps_v_e_m_s[i] = last.gps_v_e_m_s[i]
    row.gps_course_rad = last.gps_course_rad
    row.gps_speed_m_s = last.gps_speed_m_s


@kernel
def _report(truth, row, noise, step, at, unit, memory):  # type: ignore[no-untyped-def]
    """Report the fix of the physics step `step`, in the tick of row `at`; False: no fix yet."""
    late = (step - at * unit.steps_per_tick) / unit.steps_per_tick  # fraction of that tick, 0 < late <= 1
    newer, older, error = truth[at], truth[max(at - 1, 0)], noise[at]
    p, v = row.gps_p_e_m, row.gps_v_e_m_s
    for i in range(3):
        p[i] = (1.0 - late) * older.gps_p_e_m[i] + late * newer.gps_p_e_m[i] + error.gps_p_wander_e_m[i]
        v[i] = (1.0 - late) * older.gps_v_e_m_s[i] + late * newer.gps_v_e_m_s[i] + error.gps_v_noise_e_m_s[i]
    if unit.plain:
        row.gps_course_rad, row.gps_speed_m_s = _course(v), np.sqrt(v[0] * v[0] + v[1] * v[1])
    else:
        row.gps_course_rad, row.gps_speed_m_s = _process(p, v, step, unit, memory)
        if unit.from_positions and memory.fixes < 3:
            return False
    row.gps_t_s = step / unit.physics_hz
    row.gps_new = 1
    row.gps_valid = 1
    return True


@kernel
def _course(v_e_m_s):  # type: ignore[no-untyped-def]
    course_rad = np.arctan2(v_e_m_s[1], v_e_m_s[0])
    return course_rad if course_rad >= 0.0 else min(course_rad + 2.0 * np.pi, _BELOW_TWO_PI)


@kernel
def _process(p, v, step, unit, memory):  # type: ignore[no-untyped-def]
    """Turn the fix `p`, `v` in place into that of the message; returns course and speed."""
    if unit.smoothing_s > 0.0:
        _smooth(p, v, step, unit, memory)
    if np.sqrt(v[0] * v[0] + v[1] * v[1]) < unit.hold_below_m_s:
        v[:] = 0.0
        if memory.fixes > 0:
            p[:] = memory.track_e_m[2]
    for i in range(3):
        p[i] = to_step(p[i], unit.p_step_m[i])
    _remember(p, step, memory)
    if unit.from_positions:
        _mean_velocity(v, unit, memory)
    speed_m_s = np.sqrt(v[0] * v[0] + v[1] * v[1])
    if speed_m_s > 0.0:  # at rest the course is held
        memory.course_rad = _course(v)
    if unit.from_positions:  # computed from the message's positions: not rounded again
        return memory.course_rad, speed_m_s
    speed_m_s, course_rad = to_step(speed_m_s, unit.speed_step_m_s), memory.course_rad
    if unit.course_steps > 0.0:
        course_rad = np.floor(course_rad / (2.0 * np.pi) * unit.course_steps + 0.5) % unit.course_steps
        course_rad *= 2.0 * np.pi / unit.course_steps
    if unit.polar:
        v[0], v[1], v[2] = speed_m_s * np.cos(course_rad), speed_m_s * np.sin(course_rad), 0.0
    for i in range(3):
        v[i] = to_step(v[i], unit.v_step_m_s)
    return course_rad, speed_m_s


@kernel
def _smooth(p, v, step, unit, memory):  # type: ignore[no-untyped-def]
    if memory.fixes > 0:
        dt_s = (step - memory.track_step[2]) / unit.physics_hz
        gain = -np.expm1(-dt_s / unit.smoothing_s)
        for i in range(3):
            old = memory.v_e_m_s[i]
            v[i] = old + gain * (v[i] - old)
            ahead = memory.p_e_m[i] + 0.5 * dt_s * (old + v[i])
            p[i] = ahead + gain * (p[i] - ahead)
    memory.p_e_m[:] = p
    memory.v_e_m_s[:] = v


@kernel
def _remember(p, step, memory):  # type: ignore[no-untyped-def]
    memory.track_e_m[0], memory.track_step[0] = memory.track_e_m[1], memory.track_step[1]
    memory.track_e_m[1], memory.track_step[1] = memory.track_e_m[2], memory.track_step[2]
    memory.track_e_m[2], memory.track_step[2] = p, step
    memory.fixes += 1


@kernel
def _mean_velocity(v, unit, memory):  # type: ignore[no-untyped-def]
    """Set `v` to the mean of the two velocities between the last three positions; zero with fewer."""
    for i in range(3):
        v[i] = 0.0
        if memory.fixes >= 3:
            for j in range(2):
                dt_s = (memory.track_step[j + 1] - memory.track_step[j]) / unit.physics_hz
                v[i] += 0.5 * (memory.track_e_m[j + 1, i] - memory.track_e_m[j, i]) / dt_s
