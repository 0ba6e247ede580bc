"""Events read from a log."""

from dataclasses import replace

import numpy as np

from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script
from sim.events import events_of
from sim.log import Log, Outcome, Phase


def log_of(seconds):
    log = Log.empty(seconds * 50)
    log.truth["t_s"] = log.measured["t_s"] = 0.02 * np.arange(1, len(log) + 1)
    log.truth["phase"] = Phase.FLYING
    log.flown["health"] = 1
    return log


def test_events_of_a_throw_name_its_phases_in_order():
    log = log_of(4)
    log.truth["phase"][:100], log.truth["phase"][100:115] = Phase.HELD, Phase.THROWN
    log.flown["mode"] = Mode.LAUNCH
    texts = [e.text for e in events_of(log, Outcome.COMPLETED, "") if "mode" not in e.text and "estim" not in e.text]
    assert texts == ["held in the hand", "thrown", "released"]


def test_events_of_a_gps_gap_say_lost_and_back():
    log = log_of(20)
    log.measured["gps_new"][np.r_[0:250:12, 750:1000:12]] = 1
    found = {e.text: e.t_s for e in events_of(log, Outcome.COMPLETED, "")}
    assert abs(found["GPS lost"] - (log.truth["t_s"][240] + 2.5)) < 1e-9
    assert found["GPS back"] == log.truth["t_s"][750]


def test_events_of_a_failed_flight_end_with_the_fault():
    last = events_of(log_of(2), Outcome.ESTIMATOR_FAILED, "Mine at 2.00 s: R_eb is not finite")[-1]
    assert (last.level, last.text) == ("error", "Mine at 2.00 s: R_eb is not finite")


def test_events_of_an_empty_log_still_tell_the_end():
    assert events_of(Log.empty(0), Outcome.DIVERGED, "blew up")[0].text == "blew up"


def test_events_of_failsafes_are_warnings_that_say_why():
    """Modes that nobody asked for, and the radio: by the script."""
    log = log_of(10)
    order = (Mode.COURSE, Mode.CIRCLE, Mode.GLIDE, Mode.LEVEL, Mode.LOW, Mode.COURSE, Mode.RETURN, Mode.COURSE)
    for i, mode in enumerate(order):
        log.flown["mode"][50 * i :] = mode
    course = Setpoint(Mode.COURSE)
    script = Script([(0.0, course), (6.02, replace(course, radio=False)), (7.02, course)])
    told = [e for e in events_of(log, Outcome.COMPLETED, "", script, 0.0) if not e.text.startswith("estimator")]
    warnings = [e.text for e in told if e.level == "warn"]
    assert sorted(warnings[:4]) == sorted(
        ["mode circle: no GPS", "mode glide: no GPS for a long time", "mode level: estimator unhealthy",
         "mode low: too close to the ground"]
    )  # fmt: skip
    assert sorted(warnings[4:]) == ["mode return: no radio", "radio lost"]
    assert [e.text for e in told if e.level == "info"] == ["mode course", "mode course", "radio back", "mode course"]


def test_events_of_modes_that_were_asked_for_are_no_warnings():
    """A script may ask for a circle, and for the way home."""
    log = log_of(4)
    log.flown["mode"][:100], log.flown["mode"][100:] = Mode.CIRCLE, Mode.RETURN
    script = Script([(0.0, Setpoint(Mode.CIRCLE)), (2.0, Setpoint(Mode.RETURN))])
    assert {e.level for e in events_of(log, Outcome.COMPLETED, "", script, 0.0)} == {"info"}


def windy(airspeed_m_s, mode=Mode.LOITER):
    """Events about the wind of a minute in 14 m/s, with an airspeed and a mode by second."""
    log = log_of(60)
    log.truth["wind_e_m_s"] = 0.0, -14.0, 0.0
    log.truth["airspeed_m_s"] = np.repeat(airspeed_m_s, 50)
    log.flown["mode"] = np.repeat(mode, 50) if np.ndim(mode) else mode
    return [(e.text, e.level, round(e.t_s)) for e in events_of(log, Outcome.COMPLETED, "") if "wind" in e.text]


def test_events_say_when_the_wind_cannot_be_held():
    """The mean of 20 s decides: not a gust, and not in a mode that goes with the wind."""
    assert windy(np.full(60, 15.0)) == []
    assert windy(np.where(np.arange(60) % 20 < 5, 12.0, 15.0)) == []
    assert windy(np.full(60, 12.0), Mode.COURSE) == []
    assert windy(np.full(60, 12.0)) == [("wind stronger than can be held", "warn", 20)]


def test_events_say_when_the_wind_can_be_held_again():
    """Flown faster from 25 s on, the mean is more than 1 m/s above the wind 7.5 s to 12 s later, and stays there."""
    texts = windy(np.where(np.arange(60) < 25, 12.0, 18.0))
    assert [text for text, *_ in texts] == ["wind stronger than can be held", "wind can be held again"]
    assert 32 <= texts[1][2] <= 37


def test_events_compare_wind_and_airspeed_only_while_a_place_is_held():
    """A loiter that begins after half a minute on course is judged by its own 20 s."""
    mode = np.where(np.arange(60) < 30, Mode.COURSE, Mode.LOITER)
    assert windy(np.full(60, 12.0), mode) == [("wind stronger than can be held", "warn", 50)]
