"""The named options of a flight, as the command has them, and what they change in its configuration."""

import inspect
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, SupportsFloat, SupportsIndex, TypedDict, TypeVar, get_type_hints

from wingslevel._errors import WingslevelError

Number = SupportsFloat | SupportsIndex | str  # Python's numbers, NumPy's, or the text of the command
Whole = SupportsIndex | str
Estimator = str | os.PathLike[str] | Callable[..., Any]
"""Registered name, ``module:Class``, ``file.py:Class``, ``library.so``, a class, or a function that makes a new one."""


class Conditions(TypedDict, total=False):
    """What flies, through what air, with which sensors and faults; what is left out or None is as the scenario has it.

    wind : ``"5@270"`` or ``(5, 270)``, speed in m/s and the direction in degrees that it comes from; ``"5@random"``,
        ``"5@cross"``, ``"5@head"``, ``"5@tail"`` (by the heading at the start), ``"calm"``
    shear : exponent of the growth of the wind with height; 0 none, 0.14 open country
    gust : ``"4@12s"`` is 4 m/s more, 12 s after the release; ``"4@12s/3s"`` 3 s long; ``"4@12s:up"``, ``":down"``,
        ``":across"`` or ``":90"``; one or several
    turbulence : ``"light"``, ``"moderate"``, ``"severe"``, or the wind at 20 ft in m/s
    thermals : how many around the launch point
    aircraft, autopilot : by name        sensors : name of a suite, or a ``suite.toml``
    gps_rate, imu_rate : Hz; the inertial sensors, the estimator and the autopilot run at `imu_rate`
    faults : ``"gyro.x:stuck@20-25"``, ``"motor:dead@30"``, times in seconds after the release; one or several
    duration : seconds after the release
    withhold : properties of the instruments that flight code is not given; ``"all"`` for all of them
    settings : any other parameter by its dotted name, ``{"gps.latency_s": 0.5}``; see ``--set`` of the command
    """

    wind: str | tuple[SupportsFloat | SupportsIndex, Number] | None
    shear: Number | None
    gust: str | Sequence[str] | None
    turbulence: Number | None
    thermals: Whole | None
    aircraft: str | None
    autopilot: str | None
    sensors: str | os.PathLike[str] | None
    gps_rate: Number | None
    imu_rate: Whole | None
    faults: str | Sequence[str] | None
    duration: Number | None
    withhold: str | Sequence[str] | None
    settings: Mapping[str, Any] | None


_FIELDS = {
    "wind": "wind", "shear": "air.shear", "gust": "air.gusts", "turbulence": "air.turbulence_w20_m_s",
    "thermals": "air.thermals", "aircraft": "aircraft", "autopilot": "autopilot", "sensors": "suite",
    "gps_rate": "rates.gps_hz", "imu_rate": "rates.imu_hz", "faults": "faults", "duration": "duration_s",
    "withhold": "withheld",
}  # fmt: skip
_LISTS = ("gust", "faults", "withhold")
_OWN = {"seed": "seed", "estimator": "estimator"}  # named by an argument, not by a setting


def changes_of(
    function: Callable[..., Any], conditions: Mapping[str, Any], params: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Changes of the configuration by dotted names, of options given to the public `function`.

    Raises
    ------
    TypeError           an option that there is not
    WingslevelError     one of the wrong type or named twice, or a seed or an estimator among the settings
    """
    for name in conditions:
        if name not in (*_FIELDS, "settings"):
            raise TypeError(f"unknown option {name!r}: {_near(name, function)}")
    changes = params_of(conditions.get("settings"), "settings")
    for name in _OWN:
        if name in changes:
            raise WingslevelError(f"settings[{name!r}] = {changes[name]!r}: name the {name} as an argument")
    for name, value in conditions.items():
        if name == "settings" or value is None:
            continue
        field = _FIELDS[name]
        if field in changes:
            raise WingslevelError(f"{name} = {value!r} and settings[{field!r}] = {changes[field]!r}: name it once")
        changes[field] = _wind(value) if name == "wind" else listed(name, value) if name in _LISTS else plain(value)
    return changes | {f"estimator_params.{name}": value for name, value in params_of(params).items()}


def params_of(given: Any, what: str = "params") -> dict[str, Any]:
    """Values by name, as plain values; empty for None.

    Raises
    ------
    WingslevelError     something else than a dict
    """
    if given is not None and not isinstance(given, Mapping):
        raise WingslevelError(f"{what} = {shortly(given)}: must be a dict of names and values")
    return {str(name): plain(value) for name, value in (given or {}).items()}


def path_of(what: str, given: Any) -> str:
    """A name or a path as text.

    Raises
    ------
    WingslevelError     something else
    """
    if not isinstance(given, str | os.PathLike):
        raise WingslevelError(f"{what} = {shortly(given)}: must be a name or a path")
    return str(os.fspath(given))


def number_of(what: str, given: Any) -> float:
    """A number, also one written as text.

    Raises
    ------
    WingslevelError     something else
    """
    try:
        return float(plain(given))
    except (TypeError, ValueError, OverflowError):
        raise WingslevelError(f"{what} = {shortly(given)}: must be a number") from None


def shortly(value: Any) -> str:
    """`value` in one line of a message."""
    from sim.outside.blame import shown

    return shown(value)


def _near(name: str, function: Callable[..., Any]) -> str:
    from sim.params import near_misses

    return near_misses(name, tuple(inspect.signature(function).parameters))


def _wind(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, Iterable):
        parts = [plain(part) for part in value]
        if len(parts) == 2:
            return "@".join(_plainly(part) if isinstance(part, int | float) else str(part) for part in parts)
    return str(plain(value))


def _plainly(number: float) -> str:
    """`number` without an exponent."""
    return f"{number:.12f}".rstrip("0").rstrip(".")


def listed(what: str, value: Any) -> Any:
    """One text or several, as the configuration takes them.

    Raises
    ------
    WingslevelError     something else
    """
    if isinstance(value, str):
        return value
    items = list(value) if isinstance(value, Iterable) else [None]
    if not all(isinstance(item, str) for item in items):
        raise WingslevelError(f"{what} = {shortly(value)}: must be a text or a list of texts")
    return [str(item) for item in items]


def plain(value: Any) -> Any:
    """`value` with paths as text and NumPy's values as Python's."""
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if hasattr(value, "tolist") and hasattr(value, "dtype"):
        return value.tolist()
    if isinstance(value, list | tuple):
        return type(value)(map(plain, value)) if type(value) in (list, tuple) else value
    if isinstance(value, Mapping):
        return {str(name): plain(item) for name, item in value.items()}
    return value


_Function = TypeVar("_Function", bound=Callable[..., Any])


def with_conditions(function: _Function) -> _Function:
    """Let ``help`` and notebooks show the options of `Conditions` by name, instead of ``**conditions``."""
    own = [p for p in inspect.signature(function).parameters.values() if p.kind is not p.VAR_KEYWORD]
    shown = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=hint)
        for name, hint in get_type_hints(Conditions).items()
    ]
    function.__signature__ = inspect.signature(function).replace(parameters=[*own, *shown])  # type: ignore[attr-defined]
    function.__doc__ = f"{function.__doc__}\n    Options of the flight\n    ---------------------\n{_options_text()}"
    return function


def _options_text() -> str:
    return (Conditions.__doc__ or "").partition("\n\n")[2]


def seeds_of(seeds: Any) -> list[int]:
    """Seeds of ``"0-9"``, ``"0,2,5-7"``, a number or numbers.

    Raises
    ------
    ValueError      naming what would be right
    """
    from scenarios.harness.seeds import parse_seeds

    if not isinstance(seeds, str):
        if not isinstance(plain(seeds), int | Iterable):
            raise WingslevelError(f'seeds = {shortly(seeds)}: must be numbers, or a text as "0-9"')
        numbers = [seeds] if isinstance(plain(seeds), int) else plain(list(seeds))
        if not numbers:
            raise WingslevelError("seeds holds none: name at least one")
        seeds = ",".join(str(number) for number in numbers)
    return parse_seeds(seeds)
