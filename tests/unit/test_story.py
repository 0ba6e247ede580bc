"""A flight in words."""

import numpy as np
import pytest

from sim.log import Flight, Log, Outcome
from sim.view.story import story


@pytest.mark.parametrize(("release_s", "said"), [(0.0, "at 2.0 s"), (1.3, "at 0.7 s")])
def test_story_ends_as_long_after_the_release_as_the_log_does(release_s, said):
    """A hundred ticks of 20 ms since power-up, however long of them in the hand."""
    log = Log.empty(100)
    log.truth["t_s"] = 0.02 * np.arange(1, 101)
    assert f"Ground contact {said}" in story(Flight(log, 0.02, release_s, Outcome.GROUND_CONTACT, "course"))
