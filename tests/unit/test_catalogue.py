"""The listing reads the sources without importing them: it must agree with the registries."""

import json
import subprocess
import sys

from scenarios.harness.commands.catalogue import aircraft, catalogue
from scenarios.harness.plugins import AUTOPILOTS, ESTIMATORS
from scenarios.harness.registry import registered
from sim.aeroplane.jsbsim_plant import JsbsimPlant
from sim.plant import InFlight
from sim.sensors.suite import SUITES

HEAVY = ("numba", "jsbsim", "rerun", "pyarrow", "scipy", "numpy")


def test_catalogue_names_equal_registries() -> None:
    """Every name that is listed can be flown, and every one that can be flown is listed."""
    listed = {kind: set(things) for kind, things in catalogue().items()}
    assert listed["scenarios"] == set(registered())
    assert listed["suites"] == set(SUITES)
    assert listed["estimators"] >= set(ESTIMATORS)
    assert listed["autopilots"] >= set(AUTOPILOTS)


def test_catalogue_scenarios_are_told_by_the_first_line_of_their_story() -> None:
    """The line beside a scenario is the one its file opens with."""
    assert catalogue()["scenarios"] == {name: scenario.summary for name, scenario in registered().items()}


def test_aircraft_listed_load_into_jsbsim() -> None:
    """Every aircraft that is listed is one that the plant accepts."""
    assert aircraft()
    for name in aircraft():
        JsbsimPlant(name, start=InFlight(heading_rad=0.0))


def test_list_command_imports_nothing_heavy() -> None:
    """A listing is quick because no compiler, engine or file format is loaded for it."""
    code = (
        "import json, sys; from scenarios.harness.cli.app import run; run(['list', '--json', '-']); "
        f"print(json.dumps([m for m in {HEAVY!r} if m in sys.modules]), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stderr.splitlines()[-1]) == []
    assert json.loads(done.stdout)["scenarios"].keys() == registered().keys()
