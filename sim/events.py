"""Events of a flight, read from its log afterwards: phases, modes, GPS, faults, the end."""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from autopilot.interface import Mode
from autopilot.pilot import Script
from estimator.interface import Health
from sim.aeroplane.battery import Battery
from sim.faults import Fault
from sim.log import Event, Flight, Log, Outcome, Phase

_GPS_SILENCE_S = 2.5  # the GPS counts as lost after this long without a fix
_PHASES = {
    Phase.HELD: "held in the hand",
    Phase.THROWN: "thrown",
    Phase.FLYING: "released",
    Phase.RESTING: "at rest on the table",
}
_FAILSAFES = {
    Mode.CIRCLE: "no GPS",
    Mode.GLIDE: "no GPS for a long time",
    Mode.LEVEL: "estimator unhealthy",
    Mode.LOW: "too close to the ground",
}


def events_of(
    log: Log, outcome: Outcome, message: str, script: Script | None = None, release_s: float = 0.0
) -> tuple[Event, ...]:
    """Events of `log` in order of time; the last one says how the flight ended, if not as planned.

    script, release_s : setpoints by time since the release; a mode other than that commanded gives its reason
    """
    if len(log) == 0:
        return (Event(0.0, message or outcome, "error"),) if outcome != Outcome.COMPLETED else ()
    t_s = log.truth["t_s"]
    events = []

    def changes(column: np.ndarray) -> list[int]:
        return [0, *(np.flatnonzero(np.diff(column)) + 1).tolist()]

    if log.truth["phase"][0] != Phase.FLYING:
        events += [Event(float(t_s[k]), _PHASES[Phase(log.truth["phase"][k])]) for k in changes(log.truth["phase"])]
    events += [
        _mode_event(Mode(log.flown["mode"][k]), float(t_s[k]), script, release_s) for k in changes(log.flown["mode"])
    ]
    events += _radio_events(script, release_s, float(t_s[-1]))
    events += [
        Event(float(t_s[k]), f"estimator {Health(log.flown['health'][k]).name.lower()}")
        for k in changes(log.flown["health"])
    ]
    fixes = np.flatnonzero(log.measured["gps_new"])
    if len(fixes):
        events.append(Event(float(t_s[fixes[0]]), "first GPS fix"))
        gaps = np.diff(t_s[fixes], append=t_s[-1])
        for i in np.flatnonzero(gaps > _GPS_SILENCE_S):
            events.append(Event(float(t_s[fixes[i]] + _GPS_SILENCE_S), "GPS lost", "warn"))
            if i + 1 < len(fixes):
                events.append(Event(float(t_s[fixes[i + 1]]), "GPS back"))
    if outcome != Outcome.COMPLETED:
        level: Literal["warn", "error"] = "warn" if outcome == Outcome.INTERRUPTED else "error"
        events.append(Event(float(t_s[-1]), message or outcome.replace("_", " "), level))
    return tuple(sorted(events, key=lambda e: e.t_s))


def _mode_event(mode: Mode, t_s: float, script: Script | None, release_s: float) -> Event:
    """The mode that became active at `t_s`; a warning with the reason for a failsafe."""
    setpoint = script.at(t_s - release_s) if script is not None else None
    text, reason = f"mode {mode.name.lower()}", _FAILSAFES.get(mode, "")
    if setpoint is not None and setpoint.mode == mode:
        reason = ""
    elif setpoint is not None and not setpoint.radio and mode == Mode.RETURN:
        reason = "no radio"
    return Event(t_s, f"{text}: {reason}", "warn") if reason else Event(t_s, text)


def _radio_events(script: Script | None, release_s: float, last_s: float) -> list[Event]:
    """Loss and return of the radio link."""
    events, heard = [], True
    for t_s, setpoint in script or ():
        if setpoint.radio != heard:
            heard = setpoint.radio
            events.append(Event(release_s + t_s, "radio back" if heard else "radio lost", "info" if heard else "warn"))
    return [event for event in events if event.t_s <= last_s]


def events_of_faults(faults: Sequence[Fault], flight: Flight) -> tuple[Event, ...]:
    """Start and end of each fault within `flight`, not before power-up."""
    last_s = float(flight.log.truth["t_s"][-1]) if len(flight.log) else 0.0
    events = []
    for fault in faults:
        begins_s, ends_s = max(flight.release_s + fault.from_s, 0.0), flight.release_s + fault.to_s
        events += [Event(begins_s, f"fault {fault}", "warn"), Event(ends_s, f"fault {fault} ended")]
    return tuple(event for event in events if event.t_s <= last_s)


def events_of_battery(battery: Battery) -> tuple[Event, ...]:
    """The moment at which the speed controller began to take the motor back."""
    cut_off_s = battery.figures["cut_off_s"]
    return () if cut_off_s is None else (Event(cut_off_s, "battery low: motor cut off", "warn"),)
