"""Autopilots broken in one respect, for scenarios to notice: named ``broken_autopilots.py:Class``."""

import math
from dataclasses import replace

from autopilot.airframes import params_of
from autopilot.dcm import DcmAutopilot
from autopilot.fence import FenceParams
from autopilot.interface import ActuatorCommand, Setpoint
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


class ClimbsOn(DcmAutopilot):
    """Waits for a fix to end the climb of a launch."""

    def __init__(self, heading_reference: HeadingReference = "course", aircraft: str = "endurance") -> None:
        params = params_of(aircraft)
        patient = replace(params, failsafe=replace(params.failsafe, blind_climb=1e9))
        super().__init__(patient, heading_reference, aircraft)


class FliesThroughTheFence(DcmAutopilot):
    """Receives a fence, and ignores it."""

    def __init__(
        self, heading_reference: HeadingReference = "course", aircraft: str = "endurance", fence: object = None
    ) -> None:
        assert fence is not None
        super().__init__(params_of(aircraft), heading_reference, aircraft)


class LooksAtTheFenceTooLate(DcmAutopilot):
    """Turns back once it is outside."""

    def __init__(
        self,
        heading_reference: HeadingReference = "course",
        aircraft: str = "endurance",
        fence: FenceParams | None = None,
    ) -> None:
        super().__init__(params_of(aircraft), heading_reference, aircraft, replace(fence, ahead_s=0.0))


class Impatient(DcmAutopilot):
    """Counts the GPS as lost after half a second."""

    def __init__(self, heading_reference: HeadingReference = "course", aircraft: str = "endurance") -> None:
        params = params_of(aircraft)
        hasty = replace(params, failsafe=replace(params.failsafe, gps_lost_s=0.5))
        super().__init__(hasty, heading_reference, aircraft)


class CruisesOn(DcmAutopilot):
    """Flies at cruise speed whatever wind is against it."""

    def __init__(self, heading_reference: HeadingReference = "course", aircraft: str = "endurance") -> None:
        params = params_of(aircraft)
        slow = replace(params, energy=replace(params.energy, fastest_m_s=params.energy.airspeed_m_s))
        super().__init__(slow, heading_reference, aircraft)


class FollowsTheCourse(DcmAutopilot):
    """Circles at cruise speed whatever the wind, in the direction of the estimator's course."""

    def __init__(self, heading_reference: HeadingReference = "course", aircraft: str = "endurance") -> None:
        p = params_of(aircraft)
        energy = replace(p.energy, fastest_m_s=p.energy.airspeed_m_s)
        guidance = replace(p.guidance, blown=math.inf)
        super().__init__(replace(p, energy=energy, guidance=guidance), heading_reference, aircraft)


class _Mishears(DcmAutopilot):
    """Flies each set-point as `heard` has it."""

    def __init__(self, *arguments, **named):
        super().__init__(*arguments, **named)
        self._heard = {}

    def update(self, estimate, m, setpoint):
        """As the sound one, which looks at a set-point only where it is another object than before."""
        if setpoint not in self._heard:
            self._heard[setpoint] = self.heard(setpoint)
        return super().update(estimate, m, self._heard[setpoint])


class NeverInverted(_Mishears):
    """Stays upright whatever is asked."""

    @staticmethod
    def heard(setpoint: Setpoint) -> Setpoint:
        """Right side up."""
        return replace(setpoint, inverted=False)


class HalfTheRate(_Mishears):
    """Rotates half as fast as it is asked to."""

    @staticmethod
    def heard(setpoint: Setpoint) -> Setpoint:
        """Half of each rate."""
        p, q, r = setpoint.rate_b_rad_s
        return replace(setpoint, rate_b_rad_s=(0.5 * p, 0.5 * q, 0.5 * r))


class RudderStuck(DcmAutopilot):
    """The rudder stays in line."""

    def update(self, estimate, m, setpoint) -> ActuatorCommand:
        """As the sound one, but for the rudder."""
        return super().update(estimate, m, setpoint)._replace(rudder=0.0)


class IgnoresTheElevator(DcmAutopilot):
    """Does not notice by its elevator that it is slow."""

    def __init__(self, heading_reference: HeadingReference = "course", aircraft: str = "endurance") -> None:
        params = params_of(aircraft)
        numb = replace(params, lift=replace(params.lift, incidence_per_elevator_rad=0.0))
        super().__init__(numb, heading_reference, aircraft)


class NeverTrims(DcmAutopilot):
    """Learns no deflection that holds an attitude: without the integrals of the rate errors."""

    def __init__(self, heading_reference: HeadingReference = "course", aircraft: str = "endurance") -> None:
        params = params_of(aircraft)
        untrimmed = replace(params, stabilise=replace(params.stabilise, integral_limit=0.0))
        super().__init__(untrimmed, heading_reference, aircraft)


class BelievesEveryFix(DcmAutopilot):
    """Compares no fix with those before."""

    def update(self, estimate, m, setpoint) -> ActuatorCommand:
        """As the sound one, which starts the comparison with this fix."""
        self._memory["s"]["watched"] = self._memory["s"]["gps_lost"] = 0
        return super().update(estimate, m, setpoint)


class TrustsThePitch(DcmAutopilot):
    """Without a GPS it flies at the pitch of level flight by the estimator, whatever the speed."""

    def __init__(self, heading_reference: HeadingReference = "course", aircraft: str = "endurance") -> None:
        params = params_of(aircraft)
        energy = replace(params.energy, pitch_per_excess_rad_s_m=0.0, climb_per_excess=0.0)
        super().__init__(replace(params, energy=energy), heading_reference, aircraft)
