"""A scenario: aircraft, start, air, commands, length of the flight, and the checks it must pass."""

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
    """A scenario's script raised, or did not return a Script."""


@dataclass(frozen=True, slots=True)
class Scenario:
    """One scenario; its file exports it as ``SCENARIO``, and with its variants as ``SCENARIOS``.

    name        as typed on the command line: the name of its file; a variant has an ending appended
    story       the docstring of its file: a table of Story / Verifies / Aircraft / Wind / Sensors / Passes when
    config      the configuration, before any override
    script      from the resolved configuration to the set-points
    checks      what the flight must pass
    milestones  label -> function that finds such moments in the true motion; they become events of the flight
    expected_to_fail    the scenario shows a failure that a paper predicts for its own estimator: it passes if that
                estimator fails, so a better one does not pass.  It is left out when another estimator is checked on all
                scenarios or on a pattern of names
    """

    name: str
    story: str
    config: FlightConfig
    script: Callable[[FlightConfig], Script]
    checks: tuple[Check, ...]
    milestones: dict[str, Moments] = field(default_factory=dict)
    expected_to_fail: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.isidentifier():
            raise ValueError(f"scenario name {self.name!r}: must be letters, digits and underscores")
        for name, right, fits in (
            ("story", "a text", isinstance(self.story, str)),
            ("config", "a FlightConfig", isinstance(self.config, FlightConfig)),
            ("script", "a function from the configuration to a Script", callable(self.script)),
            ("checks", "Checks", isinstance(self.checks, tuple | list) and all(map(_is_check, self.checks))),
            ("milestones", "functions by names", _are_milestones(self.milestones)),
            ("expected_to_fail", "True or False", isinstance(self.expected_to_fail, bool)),
        ):
            if not fits:
                raise ValueError(f"scenario {self.name}: {name} is {shown(getattr(self, name))}; it must be {right}")
        names = [check.name for check in self.checks]
        twice = {name for name in names if names.count(name) > 1}
        if not names or twice:
            fault = f"checks named twice: {', '.join(sorted(twice))}" if twice else "no checks; it needs at least one"
            raise ValueError(f"scenario {self.name}: {fault}")

    @property
    def summary(self) -> str:
        """The first line of the story."""
        return self.story.strip().splitlines()[0] if self.story.strip() else ""

    def varied(
        self, ending: str, summary: str, changes: Mapping[str, Any], limits: Mapping[str, float] | None = None,
        **fields: Any,
    ) -> "Scenario":  # fmt: skip
        """A variant, named ``name_ending``.

        Parameters
        ----------
        summary     the first line of its story
        changes     of the configuration, by dotted names
        limits      of checks, by their names: everything else about those checks stays as it is
        fields      other fields of the scenario, replaced

        Raises
        ------
        ValueError  `limits` names a check that the scenario does not have
        """
        story = "\n".join((summary, *self.story.strip().splitlines()[1:]))
        name, config = f"{self.name}_{ending}", override(self.config, changes)
        varied = replace(self, name=name, story=story, config=config, **fields)
        limits = dict(limits or {})
        checks = tuple(c.limited(limits.pop(c.name)) if c.name in limits else c for c in varied.checks)
        if limits:
            raise ValueError(f"scenario {name}: limits of checks that it does not have: {', '.join(limits)}")
        return replace(varied, checks=checks)

    def scripted(self, config: FlightConfig) -> Script:
        """The set-points under the resolved `config`.

        Raises
        ------
        ScriptFailed    one line: the script raised, or did not return a Script
        """
        with theirs(lambda line: ScriptFailed(f"scenario {self.name}: script: {line}"), home_of(self.script)):
            script = self.script(config)
            if type(script) is not Script:
                raise Refused(f"it returned {shown(script)}; it must return a Script")
            for t_s, setpoint in script:
                if type(setpoint) is not Setpoint:
                    raise Refused(f"at {t_s:g} s it asks for {shown(setpoint)}; it must ask for a Setpoint")
                if setpoint.mode not in tuple(Mode):
                    raise Refused(f"at {t_s:g} s it asks for mode {shown(setpoint.mode)}; it must ask for a Mode")
            return script

    def events(self, flight: Flight) -> tuple[tuple[Event, ...], str]:
        """The milestones that `flight` reached; and what the first function that failed raised, or an empty text."""
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
    """The function of a milestone raised."""


def _is_check(check: object) -> bool:
    """Whether `check` is a Check whose fields have the right types."""
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
