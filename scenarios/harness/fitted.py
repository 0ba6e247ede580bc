"""The sensors of a flight: a suite by name or by file, with some of its figures changed."""

from collections.abc import Mapping
from typing import Any

from sim.params import changed
from sim.sensors.fitting import NO_FILES, SUITES, SuiteParams, load_suite


def suite_params(suite: str, changes: Mapping[str, Any], files: Mapping[str, str] = NO_FILES) -> SuiteParams:
    """The suite of that name with some fields changed; ValueError where there is no such suite or field.

    files : path -> text of the files that a suite of one's own is made of, read instead of the disk
    """
    params = SUITES[suite] if suite in set(SUITES) else load_suite(suite, files)
    return changed(params, changes, f"sensor suite {suite}")
