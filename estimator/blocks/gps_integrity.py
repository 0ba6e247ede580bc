"""Fixes that cannot be true: a receiver that freezes, jumps, or reports a velocity that does not move its position.

Each fix is compared with the one before.  Position and velocity of a receiver pass the same filter, so that the
displacement is the integral of the reported velocity (trapezoidal rule):

    e = p - p' - (v + v') dt / 2,    r <- r exp(-dt / T) + e,    T = 3 s

Only horizontally: many receivers report no vertical velocity.  A fix is refused

- if it is *odd*: ``|e|`` exceeds its limit.  It is then compared with the last fix that was not odd, so that a single
  outlier costs one fix; odd for 2 s, the position has jumped, and the GPS is lost;
- if it is *frozen*: the position repeats to the last bit while the reported speed has covered 3 m, or position and
  velocity repeat for 2 s while the speed is not zero.  Frozen for 1 s, the GPS is lost.  A receiver at rest that holds
  its position reports a speed of zero and is not frozen;
- if its course repeats to the last bit while the gyros have seen a turn of 15 degrees, and the position has left it by
  2 m, without which that may be an offset of the gyros; 0.75 s later the GPS is lost, for as long as the turn lasts;
- while the GPS is *lost*: also if ``|r|`` exceeds its limit, when the velocity is frozen, or its course, and the
  aeroplane turns.  It is found again by consistent fixes for 2 s.

The velocity may lag behind the position, by one fix if it is computed from positions, by more if the receiver smooths
the track; ``r`` is then the lag times the change of the velocity.  A lag of 1.5 s is allowed for: the limit of ``|r|``
is 6.5 m + 1.5 s ``|u|``, u the change of the velocity with the same memory; that of ``|e|`` likewise with the change
since the last fix.  A velocity that keeps its direction to the last bit does not lag: its u halves with each fix.

The limits, from 20 receivers (all parts, at 1 to 10 Hz; velocity from positions; static navigation) in all scenarios,
loops, spins, launches and a minute at rest among them, 14,000 s each: ``|r| - 1.5 s |u|`` is at most 5.1 m (an EM-406A
at 1 Hz, standard deviation 1.1 m on each axis; a u-blox M10 1.5 m), and ``|e|`` 4.4 m.  Frozen in a circle of 60 m at
13 m/s, the velocity is noticed after 2 s.

What cannot be seen: a velocity or course that freezes in straight flight, which does no harm until it turns; a position
that drifts with a velocity to match, as by a transmitter that imitates satellites.

A receiver that rounds its course to whole degrees repeats it in straight flight; in a turn it may repeat it for its
latency, and that costs a fix or two.

An estimator that uses this has the columns of `WATCH` in its state, of `compiled.BELIEF` and of `screening.SCREEN`.
A position of zero in all fixes means that the log has none: then nothing is checked.
"""

import math

import numpy as np

from estimator.compiler.jit import inlined, kernel
from estimator.interface import Column

MEMORY_S = 3.0  # T
TOLERANCE_M = 6.5  # limit of |e| and |r| of a velocity that does not lag
LAG_S = 1.5  # of the velocity behind the position that is allowed for
COARSE_M_S = 6.0  # more for each second by which fixes are more than one second apart: the trapezoidal rule in a spin
LONGEST_INTERVAL_S = 2.2  # after a longer one the comparison starts again
LONGEST_REACH_S = 3.5  # the last fix that was not odd must be more recent
ODD_S = 2.0  # the position has jumped
FROZEN_M, FROZEN_S = 3.0, 1.0  # distance that a frozen position should have covered; time until the GPS is lost
REPEATS_S = 2.0  # a fix that repeats for longer while its speed is not zero is frozen
CLEAR_S = 2.0  # consistent fixes for this long end the loss
ROUND_OFF_S = 1e-6
STRAIGHT = 1e-6  # sine of a change of direction that is none
TURNED_RAD, TURNING_M_S = math.radians(15.0), 3.0  # turn that a course must follow, at a speed that has one
IGNORED_M = 2.0  # |r| without which the turn may be an offset of the gyros
IGNORED_S = 0.75  # time for which it has not followed a larger one until the GPS is lost
MOST_M, MOST_M_S, MOST_RAD_S = 1e7, 1e4, 10.0  # limits of what is compared

WATCH = (
    Column("watched", (), "1 once there is a fix to compare with", integer=True),
    Column("placed", (), "1 once a position other than zero was reported", integer=True),
    Column("came_s", (), "time at which the last fix arrived"),
    Column("came_p_e_m", (3,), "its position"),
    Column("came_v_e_m_s", (3,), "its velocity"),
    Column("base_s", (), "time at which the last fix that was not odd arrived"),
    Column("base_stamp_s", (), "its time stamp"),
    Column("base_p_e_m", (2,), "its position"),
    Column("base_v_e_m_s", (2,), "its velocity"),
    Column("strayed_m", (2,), "r: displacement that the velocity does not explain"),
    Column("veered_m_s", (2,), "u: change of the velocity"),
    Column("odd_s", (), "time for which fixes have been odd"),
    Column("frozen_s", (), "time for which the position has repeated"),
    Column("frozen_m", (), "distance that it should have covered"),
    Column("repeats_s", (), "time for which position and velocity have repeated"),
    Column("steady_s", (), "time for which the course has repeated in a turn"),
    Column("ignored_rad", (), "turn since the course last changed"),
    Column("gps_lost", (), "1 while fixes cannot be true", integer=True),
    Column("clear_s", (), "time for which they have been consistent since"),
)


@inlined
def fix_is_sound(row, turn_rad_s, s):  # type: ignore[no-untyped-def]
    """Whether the fix that arrived in `row` can be true, given those before; call it once for each fix.

    turn_rad_s : present rate about the vertical, of the gyros
    """
    p, v = row.gps_p_e_m, row.gps_v_e_m_s
    if p[0] != 0.0 or p[1] != 0.0:
        s.placed = 1
    known = abs(p[0]) < MOST_M and abs(p[1]) < MOST_M and abs(v[0]) < MOST_M_S and abs(v[1]) < MOST_M_S  # NaN is not
    if not s.placed or not known or (v[0] == 0.0 and v[1] == 0.0 and row.gps_speed_m_s > 0.0):
        return True  # nothing to compare
    return watch(row, turn_rad_s, s)


@kernel
def watch(row, turn_rad_s, s):  # type: ignore[no-untyped-def]
    """Compare the fix in `row` with those before; returns whether it can be true."""
    interval_s, reach_s = row.t_s - s.came_s, row.t_s - s.base_s
    follows = s.watched != 0 and 0.0 < interval_s <= LONGEST_INTERVAL_S
    frozen = is_frozen(row, s, interval_s) if follows else repeats(row, s)
    if follows and ignores_turn(row, turn_rad_s, s, interval_s, reach_s):
        frozen = True
    held = s.came_v_e_m_s[0] == 0.0 and s.came_v_e_m_s[1] == 0.0 and moves(row)
    s.watched = 1
    s.came_s = row.t_s
    for i in range(3):
        s.came_p_e_m[i], s.came_v_e_m_s[i] = row.gps_p_e_m[i], row.gps_v_e_m_s[i]
    if frozen:
        if max(s.frozen_s, s.repeats_s) >= FROZEN_S - ROUND_OFF_S or s.steady_s >= IGNORED_S - ROUND_OFF_S:
            lose(s)
        return False
    if not follows or held or not 0.0 < reach_s <= LONGEST_REACH_S:
        begin(row, s)
        return s.gps_lost == 0
    if is_odd(row, s, reach_s):
        s.odd_s += interval_s
        if s.gps_lost or s.odd_s >= ODD_S - ROUND_OFF_S:
            lose(s)
            begin(row, s)
        return False
    s.odd_s = 0.0
    if strays(row, s, reach_s):
        lose(s)
        return False
    if s.gps_lost:
        s.clear_s += interval_s
        s.gps_lost = 0 if s.clear_s >= CLEAR_S - ROUND_OFF_S else 1
    return s.gps_lost == 0


@kernel
def moves(row):  # type: ignore[no-untyped-def]
    """Whether the velocity is not exactly zero, as that of a receiver that holds its position is."""
    return row.gps_v_e_m_s[0] != 0.0 or row.gps_v_e_m_s[1] != 0.0


@kernel
def repeats(row, s):  # type: ignore[no-untyped-def]
    """Whether the fix repeats the last one to the last bit, at a speed that is not zero."""
    same = s.watched != 0 and moves(row)
    for i in range(3):
        same = same and row.gps_p_e_m[i] == s.came_p_e_m[i] and row.gps_v_e_m_s[i] == s.came_v_e_m_s[i]
    return same


@kernel
def is_frozen(row, s, interval_s):  # type: ignore[no-untyped-def]
    """Whether the fix has repeated for too far or too long."""
    s.repeats_s = s.repeats_s + interval_s if repeats(row, s) else 0.0
    if row.gps_p_e_m[0] == s.came_p_e_m[0] and row.gps_p_e_m[1] == s.came_p_e_m[1]:
        s.frozen_s += interval_s
        s.frozen_m += interval_s * np.hypot(row.gps_v_e_m_s[0], row.gps_v_e_m_s[1])
    else:
        s.frozen_s = s.frozen_m = 0.0
    return s.frozen_m > FROZEN_M or s.repeats_s >= REPEATS_S - ROUND_OFF_S


@kernel
def keeps_course(v, w):  # type: ignore[no-untyped-def]
    """Whether the velocity `v` has the direction of `w`, to the last bits."""
    return abs(v[0] * w[1] - v[1] * w[0]) <= STRAIGHT * (w[0] * w[0] + w[1] * w[1])


@kernel
def leaves_course(row, s, reach_s):  # type: ignore[no-untyped-def]
    """Whether the position leaves the course that is reported: |r| with this fix."""
    if not 0.0 < reach_s <= LONGEST_REACH_S:
        return False
    dt_s = since_base(row, s, reach_s)
    keep, r = np.exp(-dt_s / MEMORY_S), s.strayed_m
    strayed_m = np.hypot(keep * r[0] + unexplained(row, s, dt_s, 0), keep * r[1] + unexplained(row, s, dt_s, 1))
    return strayed_m > IGNORED_M


@kernel
def ignores_turn(row, turn_rad_s, s, interval_s, reach_s):  # type: ignore[no-untyped-def]
    """Whether the course has not changed in a turn."""
    v = row.gps_v_e_m_s
    if not (keeps_course(v, s.came_v_e_m_s) and np.hypot(v[0], v[1]) >= TURNING_M_S and abs(turn_rad_s) < MOST_RAD_S):
        s.ignored_rad = s.steady_s = 0.0
        return False
    ignored = abs(s.ignored_rad) > TURNED_RAD
    s.ignored_rad += turn_rad_s * interval_s
    ignores = abs(s.ignored_rad) > TURNED_RAD and (s.gps_lost != 0 or leaves_course(row, s, reach_s))
    s.steady_s = s.steady_s + interval_s if ignored and ignores else 0.0
    return ignores


@kernel
def begin(row, s):  # type: ignore[no-untyped-def]
    """Begin the comparison with the fix in `row`."""
    s.strayed_m[0] = s.strayed_m[1] = s.veered_m_s[0] = s.veered_m_s[1] = s.odd_s = s.clear_s = 0.0
    rebase(row, s)


@kernel
def rebase(row, s):  # type: ignore[no-untyped-def]
    """Compare the next fix with that in `row`."""
    s.base_s, s.base_stamp_s = row.t_s, row.gps_t_s
    for i in range(2):
        s.base_p_e_m[i], s.base_v_e_m_s[i] = row.gps_p_e_m[i], row.gps_v_e_m_s[i]


@kernel
def lose(s):  # type: ignore[no-untyped-def]
    """Count the GPS as lost."""
    s.gps_lost = 1
    s.odd_s = s.clear_s = 0.0


@kernel
def since_base(row, s, reach_s):  # type: ignore[no-untyped-def]
    """Time between the fix in `row` and the last one that was not odd: of the time stamps, if they are plausible."""
    stamped_s = row.gps_t_s - s.base_stamp_s
    return stamped_s if abs(stamped_s - reach_s) <= 0.5 * reach_s else reach_s  # NaN: no stamp


@kernel
def unexplained(row, s, dt_s, i):  # type: ignore[no-untyped-def]
    """e: displacement since the last fix that was not odd, less the integral of the velocity, m."""
    covered_m = 0.5 * dt_s * (row.gps_v_e_m_s[i] + s.base_v_e_m_s[i])
    return row.gps_p_e_m[i] - s.base_p_e_m[i] - covered_m


@kernel
def tolerance_m(veered_m_s, dt_s):  # type: ignore[no-untyped-def]
    """Largest displacement that need not be explained where the velocity has changed by `veered_m_s`."""
    return TOLERANCE_M + LAG_S * veered_m_s + COARSE_M_S * max(dt_s - 1.0, 0.0)


@kernel
def is_odd(row, s, reach_s):  # type: ignore[no-untyped-def]
    """Whether the position is far from where the velocity leads."""
    dt_s, v = since_base(row, s, reach_s), row.gps_v_e_m_s
    veered_m_s = np.hypot(v[0] - s.base_v_e_m_s[0], v[1] - s.base_v_e_m_s[1])
    return not np.hypot(unexplained(row, s, dt_s, 0), unexplained(row, s, dt_s, 1)) <= tolerance_m(veered_m_s, dt_s)


@kernel
def strays(row, s, reach_s):  # type: ignore[no-untyped-def]
    """Whether the displacements of the last seconds are not those of the velocity; takes the fix for the next one."""
    dt_s, v, w = since_base(row, s, reach_s), row.gps_v_e_m_s, s.base_v_e_m_s
    keep = np.exp(-dt_s / MEMORY_S)
    keep_u = 0.5 if keeps_course(v, w) else keep
    r, u = s.strayed_m, s.veered_m_s
    for i in range(2):
        r[i] = keep * r[i] + unexplained(row, s, dt_s, i)
        u[i] = keep_u * u[i] + v[i] - w[i]
    rebase(row, s)
    return np.hypot(r[0], r[1]) > tolerance_m(np.hypot(u[0], u[1]), dt_s)
