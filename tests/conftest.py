"""What all tests share: how hypothesis searches, and a Ctrl-C that arrives."""

import os
import signal
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings

# The gate is the same every time: what is drawn follows from the test alone, nothing is remembered, and a compiler or a
# busy machine is no failure.  `make fuzz` searches on, with another seed each time.
_SLOW_MACHINE = (HealthCheck.too_slow,)
settings.register_profile("gate", derandomize=True, database=None, deadline=None, suppress_health_check=_SLOW_MACHINE)
settings.register_profile(
    "explore", max_examples=2000, derandomize=False, print_blob=True, deadline=None, suppress_health_check=_SLOW_MACHINE
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "gate"))


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """SIGINT raises KeyboardInterrupt, as at a terminal: under nohup, or in the background of a shell, it is ignored.

    Processes started meanwhile get it, too: an ignored signal is inherited, a handled one is not.
    """
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
