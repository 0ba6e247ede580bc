"""wingslevel: fly attitude estimators of small aeroplanes in closed loop, and judge them.  The public API.

>>> import wingslevel as wl

Fly
---
>>> flight = wl.fly("crosswind", estimator="premerlani", seed=3, wind="5@270")
>>> flight.passed, flight.metrics["inclination_error_rms_deg"]
>>> flight.plot().savefig("crosswind.png")
>>> flight.save("flights/mine")               # wl.load("flights/mine") reads it again

Your own estimator is a class with a method ``update``; pass the class itself, or name it ``"file.py:Class"``.  One in a
shared library is named ``"mine.so"``; `get_include` is the folder of the C header.

>>> flight = wl.fly("crosswind", estimator=MyFilter, params={"k_p": 0.5})

Judge
-----
>>> wl.check("crosswind", seeds="0-9", estimator=MyFilter)                  # pass or fail, over many seeds
>>> wl.compare("crosswind", ["premerlani", MyFilter], seeds=range(5))       # side by side, in the same air

Recorded data
-------------
>>> wl.replay("flight.bin", estimators=["premerlani", MyFilter])            # over a log, against its attitude
>>> wl.estimate(t_s, gyro_b_rad_s, force_b_m_s2, gps={"t_s": t, "v_e_m_s": v})   # plain arrays in, attitude out

Everything else that the command ``wingslevel`` does has a function of the same name: `agree`, `aircraft`, `bench`,
`claims`, `export`, `sensors` and `view`; what it lists is in `scenarios`, `estimators`, `autopilots`, `aircraft` and
`sensors`.

Conventions: earth axes are north, east, down; body axes forward, right, down.  ``R_eb`` takes body components to earth
components.  A name says its frame and unit, ``gyro_b_rad_s``; times count in seconds.  Nothing is printed.  A wrong
name or value raises `WingslevelError`, a ValueError with one line that says what would be right.

Public are the names in ``__all__``, and what their docstrings describe; they follow semantic versioning.  The packages
``estimator``, ``autopilot``, ``sim`` and ``scenarios`` may change in any release, except where the documentation shows
how to write estimators, autopilots and scenarios.  Importing this package takes milliseconds: everything is loaded on
first use.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from wingslevel import _hidden

if TYPE_CHECKING:
    from estimator.interface import (
        AirData,
        AttitudeEstimate,
        AttitudeEstimator,
        GpsFix,
        Health,
        ImuSample,
        MagSample,
        Measurements,
    )
    from wingslevel._arrays import AirArrays, GpsArrays, MagArrays, estimate
    from wingslevel._attitudes import Attitudes
    from wingslevel._campaigns import check, compare
    from wingslevel._errors import Interrupted, WingslevelError, WingslevelWarning
    from wingslevel._flight import Flight
    from wingslevel._flying import fly, load
    from wingslevel._names import autopilots, estimators, parameters, scenarios
    from wingslevel._pages import export, view
    from wingslevel._replaying import Replay, replay
    from wingslevel._reports import Report, agree, aircraft, bench, claims, sensors
    from wingslevel._results import CheckResult, Comparison
    from wingslevel.include import get_include

    __version__: str

# pytest imports this package for its plugin, also for tests that never use it: there, first use is early enough.
if not _hidden.in_pytest():
    _hidden.require_ours()

_HOMES = {
    "estimator.interface": (
        "AirData", "AttitudeEstimate", "AttitudeEstimator", "GpsFix", "Health", "ImuSample", "MagSample",
        "Measurements",
    ),
    "wingslevel._arrays": ("AirArrays", "GpsArrays", "MagArrays", "estimate"),
    "wingslevel._attitudes": ("Attitudes",),
    "wingslevel._campaigns": ("check", "compare"),
    "wingslevel._errors": ("Interrupted", "WingslevelError", "WingslevelWarning"),
    "wingslevel._flight": ("Flight",),
    "wingslevel._flying": ("fly", "load"),
    "wingslevel._names": ("autopilots", "estimators", "parameters", "scenarios"),
    "wingslevel._pages": ("export", "view"),
    "wingslevel._replaying": ("Replay", "replay"),
    "wingslevel._reports": ("Report", "agree", "aircraft", "bench", "claims", "sensors"),
    "wingslevel._results": ("CheckResult", "Comparison"),
    "wingslevel.include": ("get_include",),
}  # fmt: skip
_HOME = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "AirArrays",
    "AirData",
    "AttitudeEstimate",
    "AttitudeEstimator",
    "Attitudes",
    "CheckResult",
    "Comparison",
    "Flight",
    "GpsArrays",
    "GpsFix",
    "Health",
    "ImuSample",
    "Interrupted",
    "MagArrays",
    "MagSample",
    "Measurements",
    "Replay",
    "Report",
    "WingslevelError",
    "WingslevelWarning",
    "__version__",
    "agree",
    "aircraft",
    "autopilots",
    "bench",
    "check",
    "claims",
    "compare",
    "estimate",
    "estimators",
    "export",
    "fly",
    "get_include",
    "load",
    "parameters",
    "replay",
    "scenarios",
    "sensors",
    "view",
]


def __getattr__(name: str) -> Any:
    """Load a public name on first use."""
    if name == "__version__":
        from importlib.metadata import version

        value: Any = version("wingslevel")
    elif name in _HOME:
        _hidden.require_ours()
        value = getattr(import_module(_HOME[name]), name)
    else:
        raise AttributeError(f"module 'wingslevel' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
