"""One flip tried: the nearest tests first, further ones as long as there is time."""

import time
import tomllib
from collections.abc import Iterator
from pathlib import Path

from flips import Flip
from nearness import Nearness
from tree import NONE_COLLECTED, OUT_OF_TIME, PASSED, Tree

CAUGHT, SURVIVED, TIMEOUT, EQUIVALENT = OUTCOMES = ("caught", "survived", "timeout", "equivalent")
AT_ONCE_S = 15.0  # test files so long together are one run of pytest
UNKNOWN_S = 4.0  # a test file that was never run to its end is taken to be so long
COMPILE_S = 120.0  # of computing, for the kernels that a flip makes anew

Equivalents = dict[tuple[str, str, str], str]


def equivalents() -> Equivalents:
    """Flips that make no difference, by path, line and change: why."""
    listed = tomllib.loads(Path(__file__).with_name("equivalent.toml").read_text(encoding="utf-8"))["flip"]
    return {(entry["path"], entry["text"], entry["change"]): entry["reason"] for entry in listed}


class Trial:
    """How a flip is tried in a tree."""

    def __init__(self, tree: Tree, near: Nearness, cap_s: float, same: Equivalents) -> None:
        self.tree, self.near, self.cap_s, self.same = tree, near, cap_s, same

    def of(self, flip: Flip) -> dict[str, object]:
        """The outcome of a flip, as plain values."""
        begin = time.monotonic()
        if reason := self.same.get((flip.path, flip.text, flip.change)):
            outcome, by = EQUIVALENT, reason
        else:
            outcome, by = self._tried(flip)
        seconds = round(time.monotonic() - begin, 1)
        return {**flip.to_json(), "change": flip.change, "outcome": outcome, "by": by, "seconds": seconds}

    def _tried(self, flip: Flip) -> tuple[str, str]:
        for tests, seconds in self._groups(flip):
            remaining = tests
            while remaining:
                before = self.tree.put(flip)
                try:
                    code, by = self.tree.run(remaining, COMPILE_S + 3.0 * seconds)
                finally:
                    self.tree.put_back(flip, before)
                if code in (PASSED, NONE_COLLECTED):
                    break
                if code == OUT_OF_TIME:
                    return TIMEOUT, ", ".join(remaining)
                failed = by.partition("::")[0]
                if failed not in remaining or self.tree.passes(failed):
                    return CAUGHT, by
                remaining = [test for test in remaining if test != failed]  # it fails without the flip, too
        return SURVIVED, ""

    def _groups(self, flip: Flip) -> Iterator[tuple[list[str], float]]:
        """Test files that are run together, and how long they take, until the time is over; the nearest always."""
        group: list[str] = []
        length_s = spent_s = 0.0
        for test in self.near.order(flip.path, self.tree.seconds()):
            seconds = self.tree.seconds().get(test, UNKNOWN_S)
            if spent_s + seconds > self.cap_s and self.near.steps(test, flip.path) > 0:
                continue
            group.append(test)
            length_s, spent_s = length_s + seconds, spent_s + seconds
            if length_s > AT_ONCE_S:
                yield group, length_s
                group, length_s = [], 0.0
        if group:
            yield group, length_s
