"""What an option's text is turned into, or refused with; and what a shell completes it to."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from typer.core import TyperGroup

from sim.outside.numbers import number, whole
from sim.outside.wording import brief


def number_in(least: float, most: float, unit: str) -> Callable[[Any], float]:
    """What reads a finite number from `least` to `most`; a default is taken as it is."""
    return _reader(number, least, most, unit)


def whole_in(least: int, most: int, unit: str = "") -> Callable[[Any], int]:
    """What reads a whole number from `least` to `most`; a default is taken as it is."""
    return _reader(whole, least, most, unit)


def _reader(read: Callable[[str], Any], least: float, most: float, unit: str) -> Callable[[Any], Any]:
    def parse(text: Any) -> Any:
        from pydantic_core import PydanticCustomError  # typer says of it what the message says, and no more

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
    """The commands; ``--quiet`` is understood before and after their names, and nothing is empty."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """As typer does, after what holds for all arguments alike."""
        if not ctx.resilient_parsing:  # as where a shell wants to complete half a line
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
            raise refusal(f"argument {brief(text)}: holds a NUL character, which no name can")


def scenarios(incomplete: str) -> Sequence[str]:
    """Names of scenarios that begin so."""
    return _beginning(incomplete, "scenarios")


def estimators(incomplete: str) -> Sequence[str]:
    """Names of estimators that begin so; of a list with commas its last one."""
    return _beginning(incomplete, "estimators")


def autopilots(incomplete: str) -> Sequence[str]:
    """Names of autopilots that begin so."""
    return _beginning(incomplete, "autopilots")


def aircraft(incomplete: str) -> Sequence[str]:
    """Names of aircraft that begin so."""
    return _beginning(incomplete, "aircraft")


def suites(incomplete: str) -> Sequence[str]:
    """Names of sensor suites that begin so."""
    return _beginning(incomplete, "suites")


def suites_and_parts(incomplete: str) -> Sequence[str]:
    """Names of sensor suites and of parts that begin so."""
    return [*suites(incomplete), *_beginning(incomplete, "parts")]


def claims(incomplete: str) -> Sequence[str]:
    """Names of claims that begin with `incomplete`, read from the source: importing the claims takes seconds."""
    import re

    folder = Path(__file__).resolve().parents[2] / "claims"
    texts = (path.read_text(encoding="utf-8") for path in sorted(folder.glob("*.py")))
    names = (found for text in texts for found in re.findall(r"^@claim\(.*?^def (\w+)", text, re.M | re.S))
    return sorted(name for name in names if name.startswith(incomplete))


def kinds(incomplete: str) -> Sequence[str]:
    """Kinds of things that have names, which begin so."""
    from scenarios.harness.commands.catalogue import KINDS

    return [kind for kind in KINDS if kind.startswith(incomplete)]


def _beginning(incomplete: str, kind: str) -> Sequence[str]:
    from scenarios.harness.commands import catalogue

    done, comma, rest = incomplete.rpartition(",")
    return [f"{done}{comma}{name}" for name in catalogue.catalogue()[kind] if name.startswith(rest)]
