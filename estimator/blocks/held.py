"""In the hand, before the flight: the gyro offset is learnt quickly.  Not in the paper.

In flight the drift controller is slow, because what it corrects is disturbed by manoeuvres: an offset takes half a
minute.  At rest nothing disturbs it, and a model that is thrown a few seconds after power-up needs the offset before.
So while it is held, the corrections of roll and pitch pass a faster loop of the same form (`estimator.blocks.pi`):

    s^2 + 1.5 s + 0.5 = 0    natural frequency 0.7 rad/s, a damping of 1.06: 5 % of an offset is left after 7 s

The offset about the vertical is not seen by an accelerometer: a turn table is not mistaken for an offset.

It counts as held from `AFTER_S` after power-up, so that a receiver in flight has time to report its motion, until for
the first time something moves it: a fix with a speed that gives a course, or a specific force that differs from
gravity, as in a throw.  It is never held again, whatever GPS and accelerometer say later.
Readings that repeat to the last digit are of a stuck accelerometer, and nothing is learnt quickly from them.  After
`learn_held_s` the slow loop takes over, for then the offset is known.
"""

from estimator.blocks.kernels import dot
from estimator.compiler.jit import inlined
from estimator.interface import G_M_S2, Column

AFTER_S = 2.0
FASTER_P_1_S, FASTER_I_1_S2 = 1.5, 0.5  # gains of the loop, per radian of tilt
STILL_G = 0.1  # largest deviation from gravity
MOVED_S = 0.1  # of more than that: no longer held
STILL_RAD_S = 0.8  # a faster rotation is not learnt from

HELD = (
    Column("moved_s", (), "how long the specific force has differed from gravity; infinite once it was moved"),
    Column("force_before_b_m_s2", (3,), "the reading before"),
    Column("held", (), "1 while the offset is learnt quickly", integer=True),
)


@inlined
def watch_held(force_b_m_s2, omega_b_rad_s, s):  # type: ignore[no-untyped-def]
    """Set ``s.held``.

    s : record with `HELD`, `clock_s`, `dt_s`, `fix_age_s` (infinite before the first fix with a course) and the
    parameter `learn_held_s`
    """
    s.held = 0
    if s.moved_s < MOVED_S and s.clock_s < AFTER_S + s.learn_held_s:
        f2 = dot(force_b_m_s2, force_b_m_s2) / (G_M_S2 * G_M_S2)
        still = (1.0 - STILL_G) * (1.0 - STILL_G) <= f2 <= (1.0 + STILL_G) * (1.0 + STILL_G)
        if s.fix_age_s < 1e9:
            s.moved_s = 1e9
        elif not still:
            s.moved_s += s.dt_s
        else:
            s.moved_s = 0.0
            last, now = s.force_before_b_m_s2, force_b_m_s2
            stuck = last[0] == now[0] and last[1] == now[1] and last[2] == now[2]
            slow = dot(omega_b_rad_s, omega_b_rad_s) < STILL_RAD_S * STILL_RAD_S
            s.held = s.clock_s >= AFTER_S and slow and not stuck
        for i in range(3):
            s.force_before_b_m_s2[i] = force_b_m_s2[i]
