"""Starlino's complementary filter on the direction cosine matrix: a weighted mean of small rotations.

Gyro, accelerometer and magnetometer each give a small angle by which the earth has turned, seen from the body, since
the last sample; the matrix turns by their weighted mean and is made orthonormal again.  There is no integral: a gyro
offset left by the calibration is outweighed, never learnt.  There is no centrifugal term: the accelerometer counts as
the vertical, with less weight the further its length is from gravity.

Frame
-----
The tutorial's earth is North-West-Up: the rows of its matrix are I (north), J (west) and K (zenith), seen from the
body.  Inside this module that matrix is ``dcm``; only `to_north_east_down` converts it to ``R_eb``, north-east-down.
Body axes need no conversion: the tutorial's are any right-handed three.  At rest our specific force points to the
zenith (K = f / g); the tutorial's output A has the sign of gravity (K = -A).

Errata
------
*Sign of the gyro* (Part 3 and Part 4; comments 36 and 37).  The tutorial takes the gyro's output for the rate at which
the world turns about the device, and turns K by ``dtheta_g x K``.  A gyro measures the rate of the device; the world
turns the other way.  As printed, the matrix turns backwards.  Starlino's own code has the minus sign: dtheta_g = -w dt.

*Weights* (Part 4; comments 52, 115, 116).  ``(s_a a + s_g g + s_m m) / (s_a + s_g + s_m)`` also divides by the weights
of instruments that cannot see a rotation: the accelerometer about K, the magnetometer about I.  A turn about the
vertical comes out short by s_a / (s_a + s_g), a twentieth.  The tutorial's note for advanced readers has the solution,
used here for both: about each axis of the earth the mean is over the instruments that can see it.

*West* (comments 16, 108).  ``W = A x M`` points west where A is the zenith, and east where A has the sign of gravity;
``N = W x A`` is north with either.

Left open by the tutorial
-------------------------
Without a magnetometer the heading is that of the gyros.  (The tutorial's sample code has a virtual one, "always
pointing North": it pulls the nose to the north, and is not meant for flight.)  The weights are per sample: another
sample rate needs other weights.  The tutorial starts at any heading and lets the magnetometer correct it.  Here the
first field sets it, as in every estimator of this project that has a magnetometer.

References
----------
Starlino, "DCM Tutorial - An Introduction to Orientation Kinematics", 2011, and its comments.
"""

import numpy as np

from estimator.blocks.compiled import Compiled, state_dtype, write_estimate
from estimator.blocks.kernels import cross, dot, plus
from estimator.blocks.magnetometer import FIELD, SHORTEST_HORIZONTAL, take_field, turn_to_north
from estimator.blocks.screening import FORCE_GOOD, health_of, screen, take_rate
from estimator.compiler.jit import kernel
from estimator.interface import G_M_S2, Column, ImuSample
from estimator.params.starlino import StarlinoParams as StarlinoParams

ZERO = (0.0, 0.0, 0.0)
SMALL_RAD = 0.1  # "small": larger rotations are applied in parts
NED_FROM_NWU = np.diag([1.0, -1.0, -1.0])


STATE_DTYPE = state_dtype(
    StarlinoParams,
    *FIELD,
    Column("aligned", (), "1 once a field has set the heading", integer=True),
    Column("dcm", (3, 3), "rows I, J, K: north, west and zenith, seen from the body"),
)


@kernel
def normalize(a):  # type: ignore[no-untyped-def]
    """``a / |a|``."""
    return plus(ZERO, 1.0 / np.sqrt(dot(a, a)), a)


@kernel
def axis(m, i):  # type: ignore[no-untyped-def]
    """Row `i` of a matrix."""
    return m[i, 0], m[i, 1], m[i, 2]


@kernel
def trust(length_m_s2, band):  # type: ignore[no-untyped-def]
    """Share of its weight that the accelerometer keeps: 1 at the length of gravity, 0 from `band` away on."""
    return max(0.0, 1.0 - abs(length_m_s2 / G_M_S2 - 1.0) / band)


@kernel
def north(A, s):  # type: ignore[no-untyped-def]
    """North: the field made horizontal by the zenith `A` (comments 16, 108), a unit vector; and whether it is known."""
    M = (s.field_b_ut[0], s.field_b_ut[1], s.field_b_ut[2])
    W = cross(A, M)
    horizontal2 = dot(W, W)
    if not horizontal2 > SHORTEST_HORIZONTAL**2 * dot(M, M):  # nor a field of zero length
        return A, False
    N = cross(W, A)  # magnetic: true north lies to the west of it by the declination
    scale = 1.0 / np.sqrt(horizontal2)
    c, z = np.cos(s.declination_rad), np.sin(s.declination_rad)
    return plus(plus(ZERO, scale * c, N), scale * z, W), True


@kernel
def displacement(row, s, good, field_came):  # type: ignore[no-untyped-def]
    """The weighted mean d theta of the instruments (Part 4), in body axes."""
    I0, J0, K0 = axis(s.dcm, 0), axis(s.dcm, 1), axis(s.dcm, 2)
    w, dt = s.omega_b_rad_s, s.dt_s
    # Sums about I, J and K: the earth turns against the gyro (comment 37).
    g = (-dt * w[0], -dt * w[1], -dt * w[2])
    i, j, k = s.s_g * dot(g, I0), s.s_g * dot(g, J0), s.s_g * dot(g, K0)
    by_i = by_j = by_k = s.s_g
    f = row.force_b_m_s2
    length = np.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
    part = trust(length, s.band) if good & FORCE_GOOD else 0.0
    if part > 0.0 and length > 0.0:
        A = (f[0] / length, f[1] / length, f[2] / length)  # K, as the accelerometer has it
        a, s_a = cross(K0, A), part * s.s_a
        i, j = i + s_a * dot(a, I0), j + s_a * dot(a, J0)
        by_i, by_j = by_i + s_a, by_j + s_a
        if field_came:
            N, found = north(A, s)
            if found:
                m, s_m = cross(I0, N), part * s.s_m  # it depends on A, and is trusted as far as A is
                j, k = j + s_m * dot(m, J0), k + s_m * dot(m, K0)
                by_j, by_k = by_j + s_m, by_k + s_m
    return plus(plus(plus(ZERO, i / by_i, I0), j / by_j, J0), k / by_k, K0)


@kernel
def orthonormalise(a, b):  # type: ignore[no-untyped-def]
    """Two nearly orthogonal unit vectors, each moved by half of the error (Part 4, Scenario 3), and normalised.

    Between vectors of unit length the cosine e becomes e^3 / 4.
    """
    err = 0.5 * dot(a, b)
    return normalize(plus(a, -err, b)), normalize(plus(b, -err, a))


@kernel
def turn(dcm, d):  # type: ignore[no-untyped-def]
    """Turn the matrix by the rotation `d` of the earth, in place, in as many small parts as needed."""
    parts = 1
    if dot(d, d) > SMALL_RAD**2:
        parts = 1 + int(np.sqrt(dot(d, d)) / SMALL_RAD)
        d = plus(ZERO, 1.0 / parts, d)
    I1, J1 = axis(dcm, 0), axis(dcm, 1)
    for _ in range(parts):
        I1, J1 = orthonormalise(plus(I1, 1.0, cross(d, I1)), plus(J1, 1.0, cross(d, J1)))
    K1 = cross(I1, J1)
    for i in range(3):
        dcm[0, i], dcm[1, i], dcm[2, i] = I1[i], J1[i], K1[i]


@kernel
def to_north_east_down(s):  # type: ignore[no-untyped-def]
    """Write ``R_eb``, north-east-down, from ``dcm``, north-west-up."""
    for i in range(3):
        s.R_eb[0, i], s.R_eb[1, i], s.R_eb[2, i] = s.dcm[0, i], -s.dcm[1, i], -s.dcm[2, i]


@kernel
def align(s):  # type: ignore[no-untyped-def]
    """Set the heading from the first field; the tilt stays."""
    if turn_to_north(s.R_eb, s.field_b_ut, s.declination_rad):
        s.aligned = 1
        for i in range(3):
            s.dcm[0, i], s.dcm[1, i], s.dcm[2, i] = s.R_eb[0, i], -s.R_eb[1, i], -s.R_eb[2, i]


@kernel
def step(rows, k, state):  # type: ignore[no-untyped-def]
    """One sample; returns the `Health`."""
    row, s = rows[k], state[0]
    good = screen(row, s)
    if good:
        take_rate(row, s, good)
        field_came = s.use_magnetometer and take_field(row, s)
        if field_came and not s.aligned:
            align(s)
        turn(s.dcm, displacement(row, s, good, field_came))
        to_north_east_down(s)
    return health_of(s, True, True)


@kernel
def _replay(rows, state, estimates):  # type: ignore[no-untyped-def]
    for k in range(rows.shape[0]):
        write_estimate(state[0], step(rows, k, state), estimates[k])


class Starlino(Compiled[StarlinoParams]):
    """Starlino's complementary filter: weighted mean of small rotations, no centrifugal term.

    The first field sets the heading.  Started in the air it begins with the tutorial's unit matrix, which corrects
    itself (comment 112).
    """

    heading_reference = "nose"
    uses = ("gyro", "accelerometer", "magnetometer")
    _step, _replay, _dtype = staticmethod(step), staticmethod(_replay), STATE_DTYPE
    _default = StarlinoParams()

    def _begin(self, s: np.void, on_ground: ImuSample | None) -> None:  # noqa: ARG002
        s["dcm"] = NED_FROM_NWU @ s["R_eb"]
