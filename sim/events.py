"""Events of a flight, read from its log afterwards: phases, modes, GPS, faults, the end."""

import math
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
_WIND_S = 20.0  # over which wind and airspeed are compared
_WIND_BACK_M_S = 1.0  # airspeed above the wind from which it counts as held again
_HOLDING = (Mode.RETURN, Mode.LOITER, Mode.WAYPOINTS)
_FAILSAFES = {
    Mode.CIRCLE: "no GPS",
    Mode.GLIDE: "no GPS for a long time",
    Mode.LEVEL: "estimator unhealthy",
    Mode.LOW: "too close to the ground",
    Mode.LAND: "estimator unhealthy, and no GPS or no radio",
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
    mode = log.flown["mode"]
    events += [
        _mode_event(Mode(mode[k]), Mode(mode[max(k - 1, 0)]), float(t_s[k]), script, release_s) for k in changes(mode)
    ]
    events += _radio_events(script, release_s, float(t_s[-1]))
    events += _wind_events(log)
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


def _mode_event(mode: Mode, before: Mode, t_s: float, script: Script | None, release_s: float) -> Event:
    """The mode that became active at `t_s`, after the mode `before`; a warning with the reason for a failsafe."""
    setpoint = script.at(t_s - release_s) if script is not None else None
    text, reason = f"mode {mode.name.lower()}", _FAILSAFES.get(mode, "")
    if setpoint is not None and setpoint.mode == mode:
        reason = ""
    elif setpoint is not None and mode in (Mode.RETURN, Mode.LOITER):
        reason = "no radio" if not setpoint.radio and mode == Mode.RETURN else "the fence"
    elif setpoint is not None and mode == Mode.GLIDE and before not in (Mode.GLIDE, Mode.CIRCLE):
        reason = "the fence" if setpoint.radio else "no radio for a long time"
    return Event(t_s, f"{text}: {reason}", "warn") if reason else Event(t_s, text)


def _wind_events(log: Log) -> list[Event]:
    """When the wind became stronger than the airspeed, means of `_WIND_S`, where a place has to be held; and weaker."""
    t_s, wind = log.truth["t_s"], np.hypot(*log.truth["wind_e_m_s"].T[:2])
    ticks = int(np.searchsorted(t_s, t_s[0] + _WIND_S))
    if ticks >= len(t_s):
        return []
    held = np.isin(log.flown["mode"], _HOLDING) & (log.truth["phase"] == Phase.FLYING)
    sums, n_held = np.cumsum(np.where(held, wind - log.truth["airspeed_m_s"], 0.0)), np.cumsum(held)
    excess_m_s = np.full(len(t_s), -math.inf)
    whole = n_held[ticks:] - n_held[:-ticks] == ticks
    excess_m_s[ticks:][whole] = (sums[ticks:] - sums[:-ticks])[whole] / ticks
    clear = (excess_m_s > 0.0) | (excess_m_s < -_WIND_BACK_M_S)  # between the two it stays as it was
    stronger = (excess_m_s > 0.0)[np.maximum.accumulate(np.where(clear, np.arange(len(t_s)), 0))]
    return [
        Event(float(t_s[k]), "wind stronger than can be held", "warn")
        if stronger[k]
        else Event(float(t_s[k]), "wind can be held again")
        for k in (np.flatnonzero(np.diff(stronger)) + 1).tolist()
    ]


def _radio_events(script: Script | None, release_s: float, last_s: float) -> list[Event]:
    """Loss and return of the radio link."""
    events, heard = [], True
    for t_s, setpoint in script or ():
        if setpoint.radio != heard:
            heard = setpoint.radio
            events.append(Event(release_s + t_s, "radio back" if heard else "radio lost", "info" if heard else "warn"))
    return [event for event in events if event.t_s <= last_s]


def events_of_fence(radius_m: float | None, height_m: float | None, flight: Flight) -> tuple[Event, ...]:
    """Each time the aeroplane leaves the fence, in truth, and each time it comes back; None is no limit."""
    if len(flight.log) == 0 or (radius_m is None and height_m is None):
        return ()
    p, t_s = flight.log.truth["p_e_m"], flight.log.truth["t_s"]
    outside = np.hypot(p[:, 0], p[:, 1]) > (np.inf if radius_m is None else radius_m)
    outside |= -p[:, 2] > (np.inf if height_m is None else height_m)
    crossings = np.flatnonzero(np.diff(outside, prepend=False))
    return tuple(
        Event(float(t_s[k]), "outside the fence", "warn") if outside[k] else Event(float(t_s[k]), "inside the fence")
        for k in crossings
    )


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
