"""A scenario: what flies, where, through what air, commanded how, for how long, and what it must pass."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, get_args

from autopilot.interface import Mode, Setpoint
from autopilot.pilot import Script
from scenarios.harness.checks import Check, Pooling, Sense
from scenarios.harness.config import FlightConfig, override
from sim.log import Event, Flight
from sim.outside.blame import Refused, home_of, shown, theirs

Moments = Callable[[Flight], Iterable[float]]  # times since the release


class ScriptFailed(ValueError):
    """A scenario's script that raised, or that returned none."""


@dataclass(frozen=True, slots=True)
class Scenario:
    """One scenario; its file exports it as ``SCENARIO``, and variants of it as ``SCENARIOS``.

    name        as typed on the command line: that of its file, a variant's with an ending
    story       the docstring of its file: a table of Story / Verifies / Aircraft / Wind / Sensors / Passes when
    config      what is flown where nothing is overridden
    script      the set-points, from the resolved configuration
    checks      what it must pass
    milestones  moments found in the truth of the flight, by what to call them; they become events
    shows_failure   it passes where its own estimator fails as the paper says, and for no estimator that copes:
                it is left out where an estimator of one's own flies all scenarios, or a family of them
    """

    name: str
    story: str
    config: FlightConfig
    script: Callable[[FlightConfig], Script]
    checks: tuple[Check, ...]
    milestones: dict[str, Moments] = field(default_factory=dict)
    shows_failure: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.isidentifier():
            raise ValueError(f"scenario name {self.name!r}: must be letters, digits and underscores")
        for name, right, fits in (
            ("story", "a text", isinstance(self.story, str)),
            ("config", "a FlightConfig", isinstance(self.config, FlightConfig)),
            ("script", "a function from the configuration to a Script", callable(self.script)),
            ("checks", "Checks", isinstance(self.checks, tuple | list) and all(map(_is_check, self.checks))),
            ("milestones", "functions by names", _are_milestones(self.milestones)),
            ("shows_failure", "True or False", isinstance(self.shows_failure, bool)),
        ):
            if not fits:
                raise ValueError(f"scenario {self.name}: {name} is {shown(getattr(self, name))}, must be {right}")
        names = [check.name for check in self.checks]
        twice = {name for name in names if names.count(name) > 1}
        if not names or twice:
            fault = f"checks named twice: {', '.join(sorted(twice))}" if twice else "no checks: a scenario judges"
            raise ValueError(f"scenario {self.name}: {fault}")

    @property
    def told_as(self) -> str:
        """The first line of the story."""
        return self.story.strip().splitlines()[0] if self.story.strip() else ""

    def varied(self, ending: str, told: str, changes: Mapping[str, Any], **others: Any) -> "Scenario":
        """A variant, called ``name_ending``: the configuration with `changes` by dotted names, `others` of the fields.

        told : what becomes the first line of its story
        """
        story = "\n".join((told, *self.story.strip().splitlines()[1:]))
        return replace(self, name=f"{self.name}_{ending}", story=story, config=override(self.config, changes), **others)

    def scripted(self, config: FlightConfig) -> Script:
        """The set-points under the resolved `config`.

        Raises
        ------
        ScriptFailed    one line: the scenario's script raises, or returns none
        """
        with theirs(lambda line: ScriptFailed(f"scenario {self.name}: script: {line}"), home_of(self.script)):
            script = self.script(config)
            if type(script) is not Script:
                raise Refused(f"it returned {shown(script)}, must return a Script")
            for t_s, setpoint in script:
                if type(setpoint) is not Setpoint:
                    raise Refused(f"at {t_s:g} s it asks for {shown(setpoint)}, must be a Setpoint")
                if setpoint.mode not in tuple(Mode):
                    raise Refused(f"at {t_s:g} s it asks for mode {shown(setpoint.mode)}, must be a Mode")
            return script

    def events(self, flight: Flight) -> tuple[tuple[Event, ...], str]:
        """The milestones that `flight` reached, and a line on the first that could not be found, or nothing."""
        last_s = float(flight.log.truth["t_s"][-1]) if len(flight.log) else 0.0
        events, fault = [], ""
        for text, moments in self.milestones.items():
            try:
                with theirs(lambda line, text=text: _Unfound(f"milestone {text!r}: {line}"), home_of(moments)):  # type: ignore[misc]
                    times_s = [flight.release_s + float(t_s) for t_s in moments(flight)]
            except _Unfound as problem:
                fault = fault or str(problem)
                continue
            events += [Event(t_s, text) for t_s in times_s if t_s <= last_s]  # NaN, a moment that never came, is not
        return tuple(events), fault


class _Unfound(RuntimeError):
    """A milestone whose function raised."""


def _is_check(check: object) -> bool:
    """Whether `check` is a Check of which every field is what it must be."""
    if not isinstance(check, Check):
        return False
    words = (check.sense, get_args(Sense)), (check.pooled, get_args(Pooling))
    return (
        isinstance(check.name, str)
        and isinstance(check.unit, str)
        and callable(check.metric)
        and all(isinstance(word, str) and word in right for word, right in words)
    )


def _are_milestones(milestones: object) -> bool:
    if not isinstance(milestones, Mapping):
        return False
    return all(isinstance(text, str) and callable(moments) for text, moments in milestones.items())
