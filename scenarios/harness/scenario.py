"""A scenario: what flies, where, through what air, commanded how, for how long, and what it must pass."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from autopilot.pilot import Script
from scenarios.harness.checks import Check
from scenarios.harness.config import FlightConfig, override
from sim.log import Event, Flight

Moments = Callable[[Flight], Iterable[float]]  # times since the release


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
        if not self.name.isidentifier():
            raise ValueError(f"scenario name {self.name!r}: must be letters, digits and underscores")
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

    def events(self, flight: Flight) -> tuple[Event, ...]:
        """The milestones that `flight` reached."""
        last_s = float(flight.log.truth["t_s"][-1]) if len(flight.log) else 0.0
        return tuple(
            Event(flight.release_s + t_s, text)
            for text, moments in self.milestones.items()
            for t_s in moments(flight)
            if flight.release_s + t_s <= last_s  # NaN, a moment that never came, is not
        )
