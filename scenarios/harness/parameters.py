"""The parameters of an estimator, with their documentation: name, default, unit, meaning, effect of a change.

Documentation is read from the docstring of the parameter class, in the form that `estimator.params` describes.  A
parameter of your own estimator without documentation is listed too; its unit is then that of the end of its name.
"""

import importlib
import inspect
import math
import re
from collections.abc import Iterator, Mapping
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple

from estimator.params import PARAMETERS
from scenarios.harness import equipping, plugins
from sim.params import dotted_fields, unit_of

_NOT_SET = ("params", "instruments")  # arguments of a constructor that ``--set`` does not change
_ENTRY = re.compile(r"^ *(\w+) : (\S+)  +(\S.*)$")
_EFFECTS = re.compile(r"^(?P<meaning>.*?)\s+(?:higher|on): (?P<raised>.*?); (?:lower|off): (?P<lowered>.*)$")


class Parameter(NamedTuple):
    """One parameter that ``--set`` can change.

    name : as ``--set`` spells it, nested fields with dots
    default : its value where nothing is set; None where the class gives none
    unit : "-" for a pure number, ``switch`` for true or false, ``choice`` for one of the values in `meaning`
    meaning : what it is
    raised : what happens when it is raised, or switched on
    lowered : what happens when it is lowered, or switched off
    """

    name: str
    default: Any
    unit: str
    meaning: str
    raised: str
    lowered: str


def estimator_parameters(spec: str | plugins.Maker) -> list[Parameter]:
    """The parameters of an estimator, its own before those that estimators share.

    Parameters
    ----------
    spec : name, ``module:Class``, ``file.py:Class``, or a class.  Names of this project do not load the compiler

    Returns
    -------
    list of Parameter    empty where the estimator has none.  Texts of your own estimator that is not documented in
                         the form of `estimator.params` are empty

    Raises
    ------
    PluginError    one line: no such estimator, or one that cannot be loaded
    """
    if isinstance(spec, str) and spec in plugins.estimators() and spec in PARAMETERS:
        return _of_dataclass(_registered(spec))
    estimator = equipping.load_estimator(spec) if isinstance(spec, str) else equipping.equipped(spec).code
    params = equipping.params_of(spec, estimator)
    found = _of_dataclass(params) if params is not None else []
    arguments = _arguments(type(estimator))
    settable = equipping.parameters_of(spec) if isinstance(spec, str) else set(arguments)
    texts = documented(type(estimator))
    others = [name for name in (*arguments, *sorted(settable - arguments.keys())) if name in settable]
    listed = {parameter.name for parameter in found}
    return found + [_parameter(name, arguments.get(name), texts) for name in others if name not in listed]


def _registered(name: str) -> Any:
    """Default parameters of an estimator of this project."""
    module, _, attribute = PARAMETERS[name].partition(":")
    found = getattr(importlib.import_module(module), attribute)
    return found() if isinstance(found, type) else found


def documented(cls: type) -> dict[str, tuple[str, str, str, str]]:
    """Unit, meaning, effect when raised and when lowered, by field, from the docstrings of `cls` and its bases."""
    found: dict[str, tuple[str, str, str, str]] = {}
    for owner in cls.__mro__:
        for name, unit, text in _entries(owner.__doc__ if isinstance(owner.__doc__, str) else ""):
            effects = _EFFECTS.match(text)
            meaning, raised, lowered = effects.group("meaning", "raised", "lowered") if effects else (text, "", "")
            found.setdefault(name, (unit, meaning, raised, lowered))
    return found


def _entries(doc: str) -> Iterator[tuple[str, str, str]]:
    """Name, unit and text of each ``name : unit  text`` in a docstring, continuation lines joined."""
    lines = inspect.cleandoc(doc).splitlines()
    for i, line in enumerate(lines):
        if entry := _ENTRY.match(line):
            indent = len(line) - len(line.lstrip())
            more = []
            for following in lines[i + 1 :]:
                if not following.strip() or len(following) - len(following.lstrip()) <= indent:
                    break
                more.append(following.strip())
            yield entry[1], entry[2], " ".join([entry[3].strip(), *more])


def _of_dataclass(params: Any) -> list[Parameter]:
    """The fields of a parameter dataclass, nested ones with dots; those of the class itself before inherited ones."""
    paths = [path for cls in type(params).__mro__ for path in _declared(params, cls)]
    return [_parameter(path, *_field(params, path)) for path in paths]


def _declared(params: Any, cls: type) -> list[str]:
    """Dotted names of the fields of `params` that its class `cls` or base class `cls` declares first."""
    inherited = {name for base in cls.__mro__[1:] for name in inspect.get_annotations(base)}
    declared = inspect.get_annotations(cls).keys() - inherited
    return [path for path in dotted_fields(params) if path.partition(".")[0] in declared]


def _field(params: Any, path: str) -> tuple[Any, Mapping[str, tuple[str, str, str, str]]]:
    """Value of a dotted field, and the documentation of the class that it is a field of."""
    *groups, name = path.split(".")
    for group in groups:
        params = getattr(params, group)
    return getattr(params, name), documented(type(params))


def _parameter(path: str, default: Any, texts: Mapping[str, tuple[str, str, str, str]]) -> Parameter:
    name = path.rpartition(".")[2]
    unit = "switch" if isinstance(default, bool) else unit_of(name)
    return Parameter(path, default, *texts.get(name, (unit, "", "", "")))


def _arguments(cls: type) -> dict[str, Any]:
    """Arguments of a constructor that can be set, with their defaults, None without a default."""
    try:
        arguments = inspect.signature(cls).parameters.values()
    except (TypeError, ValueError):  # compiled code that does not say
        return {}
    named = (a for a in arguments if a.kind in (a.POSITIONAL_OR_KEYWORD, a.KEYWORD_ONLY))
    return {a.name: None if a.default is a.empty else a.default for a in named if a.name not in _NOT_SET}


def default_text(value: Any) -> str:
    """A default as a table shows it: four digits, true or false, names of a set."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return "inf" if math.isinf(value) else f"{value:.4g}"
    if isinstance(value, frozenset | set):
        return ", ".join(sorted(str(v.value if isinstance(v, Enum) else v) for v in value)) or "none"
    return "unknown" if value is None else str(value)


MARKS = ("<!-- parameters: generated -->", "<!-- end of parameters -->")


def update_page(path: Path) -> None:
    """Write the tables of all parameters into the page at `path`, between the two lines `MARKS`.

    Raises
    ------
    ValueError    the page does not have both lines
    """
    before, first, rest = path.read_text(encoding="utf-8").partition(MARKS[0])
    _, last, after = rest.partition(MARKS[1])
    if not (first and last):
        raise ValueError(f"{path} needs the lines {' and '.join(MARKS)}")
    path.write_text(f"{before}{first}\n\n{page()}\n{last}{after}", encoding="utf-8")


def page() -> str:
    """Tables of all parameters in Markdown: one for each parameter class, what they share last."""
    users: dict[type, list[str]] = {}
    of_class: dict[type, Any] = {}
    for name in PARAMETERS:
        params = _registered(name)
        for cls in type(params).__mro__[:-1]:
            users.setdefault(cls, []).append(name)
            of_class.setdefault(cls, params)
    leaves_first = sorted(users, key=lambda cls: cls in {base for user in users for base in user.__mro__[1:]})
    return "\n".join(_table(cls, of_class[cls], users[cls]) for cls in leaves_first)


def _table(cls: type, params: Any, users: list[str]) -> str:
    declared = _declared(params, cls)
    lines = [
        f"**{'Shared by ' if len(users) > 4 else ''}{', '.join(f'`{name}`' for name in users)}**\n",
        "| parameter | default | unit | meaning | higher, or on | lower, or off |",
        "|-|-|-|-|-|-|",
    ]
    for p in _of_dataclass(params):
        if p.name in declared:
            cells = (f"`{p.name}`", default_text(p.default), p.unit, p.meaning, p.raised, p.lowered)
            lines.append(f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |")
    return "\n".join(lines) + "\n"
