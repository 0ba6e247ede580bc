"""Autopilots broken in one respect, for scenarios to notice: named ``broken_autopilots.py:Class``."""

from dataclasses import replace

from autopilot.airframes import params_of
from autopilot.autopilot import DcmAutopilot
from estimator.interface import HeadingReference


class TurnsAtTheCorner(DcmAutopilot):
    """Leaves a leg when its waypoint is reached, and not before."""

    def __init__(self, heading_reference: HeadingReference = "course", aircraft: str = "endurance") -> None:
        params = params_of(aircraft)
        late = replace(params, route=replace(params.route, roll_s=0.0, sharpest_rad=0.0))
        super().__init__(late, heading_reference, aircraft)


class NeverMissesTheGps(DcmAutopilot):
    """Flies on as it was told to, whether fixes arrive or not."""

    def __init__(self, heading_reference: HeadingReference = "course", aircraft: str = "endurance") -> None:
        params = params_of(aircraft)
        patient = replace(params, failsafe=replace(params.failsafe, gps_lost_s=1e9))
        super().__init__(patient, heading_reference, aircraft)
