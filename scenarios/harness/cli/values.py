"""Parsers for the values of options, and completion of names by the shell."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from typer.core import TyperGroup

from sim.outside.numbers import number, whole
from sim.outside.wording import brief


def number_in(least: float, most: float, unit: str) -> Callable[[Any], float]:
    """A parser for finite numbers from `least` to `most`; defaults pass unchanged."""
    return _reader(number, least, most, unit)


def whole_in(least: int, most: int, unit: str = "") -> Callable[[Any], int]:
    """A parser for whole numbers from `least` to `most`; defaults pass unchanged."""
    return _reader(whole, least, most, unit)


def _reader(read: Callable[[str], Any], least: float, most: float, unit: str) -> Callable[[Any], Any]:
    def parse(text: Any) -> Any:
        from pydantic_core import PydanticCustomError  # typer prints its message and nothing else

        if not isinstance(text, str):
            return text
        try:
            value = read(text)
        except ValueError as error:
            raise PydanticCustomError("number", "{text}", {"text": f"{brief(text)}: {error}"}) from None
        if not least <= value <= most:
            right = f"{brief(text)}: choose {least:.12g} to {most:.12g} {unit}".rstrip()
            raise PydanticCustomError("number", "{text}", {"text": right})
        return value

    return parse


class Commands(TyperGroup):
    """The commands; ``--quiet`` may come before or after their names, and empty arguments are errors."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """As typer does, after the checks common to all arguments."""
        if not ctx.resilient_parsing:  # completion by the shell
            _refuse_empty(args)
        end = args.index("--") if "--" in args else len(args)
        others = [text for text in args[:end] if text not in _QUIET]
        return super().parse_args(ctx, [*_QUIET[: len(others) < end], *others, *args[end:]])


_QUIET = ("--quiet", "-q")


def _refuse_empty(args: list[str]) -> None:
    from scenarios.harness.cli.reports import refusal

    for i, text in enumerate(args):
        name, equals, value = text.partition("=")
        if not text.strip() or (name.startswith("--") and equals and not value.strip()):
            before = args[i - 1] if i and args[i - 1].startswith("-") else f"argument {i + 1}"
            raise refusal(f"{name if equals else before}: the text is empty; write a value, or leave it out")
        if "\0" in text:
            raise refusal(f"argument {brief(text)}: contains a NUL character")


def scenarios(incomplete: str) -> Sequence[str]:
    """Scenarios whose names begin with `incomplete`."""
    return _beginning(incomplete, "scenarios")


def estimators(incomplete: str) -> Sequence[str]:
    """Estimators whose names begin with `incomplete`; in a comma-separated list, with its last name."""
    return _beginning(incomplete, "estimators")


def autopilots(incomplete: str) -> Sequence[str]:
    """Autopilots whose names begin with `incomplete`."""
    return _beginning(incomplete, "autopilots")


def aircraft(incomplete: str) -> Sequence[str]:
    """Aircraft whose names begin with `incomplete`."""
    return _beginning(incomplete, "aircraft")


def suites(incomplete: str) -> Sequence[str]:
    """Sensor suites whose names begin with `incomplete`."""
    return _beginning(incomplete, "suites")


def suites_and_parts(incomplete: str) -> Sequence[str]:
    """Sensor suites and parts whose names begin with `incomplete`."""
    return [*suites(incomplete), *_beginning(incomplete, "parts")]


def claims(incomplete: str) -> Sequence[str]:
    """Names of claims that begin with `incomplete`, read from the source: importing the claims takes seconds."""
    import re

    folder = Path(__file__).resolve().parents[2] / "claims"
    texts = (path.read_text(encoding="utf-8") for path in sorted(folder.glob("*.py")))
    names = (found for text in texts for found in re.findall(r"^@claim\(.*?^def (\w+)", text, re.M | re.S))
    return sorted(name for name in names if name.startswith(incomplete))


def kinds(incomplete: str) -> Sequence[str]:
    """Kinds of named things that begin with `incomplete`."""
    from scenarios.harness.commands.catalogue import KINDS

    return [kind for kind in KINDS if kind.startswith(incomplete)]


def _beginning(incomplete: str, kind: str) -> Sequence[str]:
    from scenarios.harness.commands import catalogue

    done, comma, rest = incomplete.rpartition(",")
    return [f"{done}{comma}{name}" for name in catalogue.catalogue()[kind] if name.startswith(rest)]
