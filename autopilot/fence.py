"""The geofence: a cylinder around the launch point, and what the autopilot does before it is left.

The fence looks ahead: it acts where the outward velocity over the ground would carry the aeroplane across within
`ahead_s`, the time of half a turn.  With the wind behind, it acts earlier; along the fence, it does not act.  The
height demanded of the autopilot stays `ceiling_margin_m` below the ceiling.  Without a position there is no fence.

Measured with `endurance` at cruise, course straight out, fence of 200 m: it stays inside in calm air and in head wind,
and comes at most 15 m beyond it with 5 m/s of wind from behind, 55 m with 8 m/s.
"""

import math
from dataclasses import dataclass
from enum import IntEnum

from autopilot.guidance import way_home
from estimator.compiler.jit import kernel

LEAST_RADIUS_M, LEAST_HEIGHT_M = 50.0, 45.0  # room for a turn; and above the height at which LOW ends


class FenceAction(IntEnum):
    """What is done at the fence."""

    RETURN = 0  # to the launch point, until `release_m` inside; then as commanded
    LOITER = 1  # around the launch point, until another setpoint is commanded
    GLIDE = 2  # motor off, in a gentle circle, until another setpoint is commanded and the aeroplane is inside
    REPORT = 3  # nothing: the fence is only reported


FENCE_LOITER, FENCE_GLIDE, FENCE_REPORT = (int(a) for a in (FenceAction.LOITER, FenceAction.GLIDE, FenceAction.REPORT))


@dataclass(frozen=True, slots=True)
class FenceParams:
    """The fence; the default is no fence.  ValueError if it is too small to fly in.

    radius_m : from the launch point, at least 50 (m, default inf).  Higher: flies further out
    height_m : ceiling above the launch point, at least 45 (m, default inf).  Higher: flies higher
    action : a `FenceAction` (default 0: RETURN).  Higher: one of the others
    ahead_s : time by which it acts before the fence, at the present velocity, and longer at more than cruise speed over
        the ground, in proportion (s, default 4).  Higher: turns further inside; lower: overshoots
    release_m : distance inside at which RETURN ends, at most half the radius (m, default 80).  Higher: comes further
        home; lower: turns back and forth at the fence
    ceiling_margin_m : the height demanded stays this far below the ceiling (m, default 10).  Lower: gusts lift it over
    bank_rad : bank that the turn at the fence may use, whatever the setpoint allows (rad, default 35 deg).  Lower:
        overshoots
    """

    radius_m: float = math.inf
    height_m: float = math.inf
    action: float = FenceAction.RETURN
    ahead_s: float = 4.0
    release_m: float = 80.0
    ceiling_margin_m: float = 10.0
    bank_rad: float = math.radians(35.0)

    def __post_init__(self) -> None:
        for name, value, least in (
            ("radius_m", self.radius_m, LEAST_RADIUS_M), ("height_m", self.height_m, LEAST_HEIGHT_M),
        ):  # fmt: skip
            if not value >= least:
                raise ValueError(f"fence.{name} = {value:g} m: must be at least {least:g} m; inf is no limit")
        if self.action not in tuple(FenceAction):
            raise ValueError(f"fence.action = {self.action!r}: must be a FenceAction")

    @property
    def stands(self) -> bool:
        """Whether there is a limit at all."""
        return math.isfinite(self.radius_m) or math.isfinite(self.height_m)


@kernel
def ceiling(f):  # type: ignore[no-untyped-def]
    """The largest height demand, m."""
    return math.inf if f.action == FENCE_REPORT else f.height_m - f.ceiling_margin_m


@kernel
def mind_fence(row, height_m, s, f, g, cruise_m_s):  # type: ignore[no-untyped-def]
    """Update `s.fenced`: whether the fence determines the mode; only with a position.

    row : measured   height_m : present   f, g : records of FenceParams, GuidanceParams   cruise_m_s : airspeed
    s : record with `unseen_turn_rad`, `fenced`, `fenced_by` (number of the setpoint then), `setpoints` (of this one)
    """
    if not (math.isfinite(f.radius_m) or math.isfinite(f.height_m)) or f.action == FENCE_REPORT:
        return
    home_north, home_east = way_home(row, g)
    distance_m = math.hypot(home_north, home_east)
    if not (math.isfinite(distance_m) and math.isfinite(height_m)):
        return
    v, cosine, sine = row.gps_v_e_m_s, math.cos(s.unseen_turn_rad), math.sin(s.unseen_turn_rad)
    north, east = v[0] * cosine - v[1] * sine, v[0] * sine + v[1] * cosine  # the fix is late: turned since
    outward_m_s = max(-(home_north * north + home_east * east) / max(distance_m, 1.0), 0.0)
    ahead_s = f.ahead_s * max(outward_m_s / cruise_m_s, 1.0)  # with the wind behind, half a turn takes it further
    reach_m, top_m = distance_m + outward_m_s * ahead_s, height_m + max(-v[2], 0.0) * f.ahead_s
    if reach_m > f.radius_m or top_m > f.height_m:
        if not s.fenced:
            s.fenced_by = s.setpoints
        s.fenced = 1
        return
    inside_m = min(f.release_m, 0.5 * f.radius_m)
    back = reach_m < f.radius_m - inside_m and top_m < f.height_m - 0.5 * f.ceiling_margin_m
    lasting = f.action in (FENCE_LOITER, FENCE_GLIDE) and s.fenced_by == s.setpoints
    if back and not lasting:
        s.fenced = 0
