"""Flight code by name: what is found, and how what cannot be used is refused in one line."""

import re
from dataclasses import dataclass
from pathlib import Path

import pytest

from scenarios.harness import equipping, plugins

FINE = """
class Fine:
    heading_reference = "nose"

    def update(self, m):
        return m
"""


@pytest.fixture
def file_of(tmp_path: Path):
    """Writes Python source to a file and returns its path."""

    def write(source: str, name: str = "own.py") -> Path:
        path = tmp_path / name
        path.write_text(source, encoding="utf-8")
        return path

    return write


def refusal(spec: str) -> str:
    """The one line with which an estimator is refused."""
    with pytest.raises(plugins.PluginError) as refused:
        equipping.load_estimator(spec)
    message = str(refused.value)
    assert "\n" not in message
    return message


@pytest.mark.parametrize("name", plugins.ESTIMATORS)
def test_load_estimator_registered_gives_new_object(name: str) -> None:
    """No state is shared between flights: each call makes another object."""
    assert equipping.load_estimator(name) is not equipping.load_estimator(name)


def test_load_estimator_from_file_gives_its_class(file_of) -> None:
    """A class in a file of one's own is found by its path."""
    estimator = equipping.load_estimator(f"{file_of(FINE)}:Fine")
    assert type(estimator).__name__ == "Fine"
    assert equipping.heading_reference_of(estimator) == "nose"


def test_load_estimator_from_file_imports_its_neighbour(file_of) -> None:
    """A file may import the files beside it."""
    file_of("GAIN = 3", "neighbour_of_own.py")
    path = file_of(f"from neighbour_of_own import GAIN\n{FINE}    gain = GAIN\n")
    assert equipping.load_estimator(f"{path}:Fine").gain == 3


def test_load_estimator_from_module_in_working_directory_is_found(file_of, monkeypatch) -> None:
    """The console script, unlike ``python -m``, does not look in the working directory by itself."""
    monkeypatch.chdir(file_of(FINE, "module_of_own.py").parent)
    assert type(equipping.load_estimator("module_of_own:Fine")).__module__ == "module_of_own"


def test_load_estimator_without_optional_parts_is_accepted(file_of) -> None:
    """Only `update` is required; the heading reference is the course where none is named."""
    estimator = equipping.load_estimator(f"{file_of('class Bare:' + chr(10) + ' def update(self, m): ...')}:Bare")
    assert equipping.heading_reference_of(estimator) == "course"


@pytest.mark.parametrize(
    ("typed", "meant"), [("premelani", "premerlani"), ("gyro-only", "gyro_only"), ("Orcale", "oracle")]
)
def test_load_estimator_misspelt_names_the_near_miss(typed: str, meant: str) -> None:
    """What was probably meant is named."""
    assert f"did you mean {meant}" in refusal(typed)


def test_load_estimator_far_off_names_all_there_are() -> None:
    """Where nothing is near, everything is listed."""
    assert all(name in refusal("zzz") for name in plugins.ESTIMATORS)


@pytest.mark.parametrize(
    ("source", "name", "says"),
    [
        ("class Own: pass", "Own", r"Own has no method update\(measurements\)"),
        (
            "class Own:\n def update(self, gyro, force): ...",
            "Own",
            r"update\(\) takes \(gyro, force\); define it as update\(self, measurements\)",
        ),
        (FINE, "Fien", "did you mean Fine"),
        ("x = 1", "Own", "defines no class"),
        ("class Own\n pass", "Own", "SyntaxError"),
        ("import no_such_module_anywhere", "Own", "ModuleNotFoundError.*no_such_module_anywhere"),
        ("class Own:\n def __init__(self, gain): ...\n def update(self, m): ...", "Own", "TypeError.*gain"),
        (
            "class Own:\n heading_reference = 'north'\n def update(self, m): ...",
            "Own",
            "'north'; it must be 'course' or 'nose'",
        ),
        (
            "class Own:\n def __init__(self): raise RuntimeError('two\\nlines')\n def update(self, m): ...",
            "Own",
            "RuntimeError: two lines",
        ),
    ],
)
def test_load_estimator_unusable_is_refused_in_one_line(file_of, source: str, name: str, says: str) -> None:
    """Each way in which a class of one's own cannot be used has its own message."""
    assert re.search(says, refusal(f"{file_of(source)}:{name}"))


def test_load_estimator_from_a_file_without_a_class_names_one_in_it(file_of) -> None:
    """The class with an update, found without running the file; no list of all estimators."""
    path = file_of("raise RuntimeError\nclass Helper: ...\n" + FINE)
    assert refusal(str(path)) == f"{path}: name the class in it, for instance {path}:Fine"
    path.write_text("class Own\n")
    assert refusal(str(path)) == f"{path}: name the class in it, for instance {path}:Class"


@pytest.mark.parametrize("spec", ["./mine.c", "src/filter.cpp", "lib.rs", "./mine.c:mine"])
def test_load_estimator_from_a_source_file_says_to_build_a_library(spec: str) -> None:
    """With the page that says how."""
    file = spec.removesuffix(":mine")
    assert refusal(spec) == f"{file} is a source file: build a shared library from it first (docs/c_estimators.md)"


@pytest.mark.parametrize("spec", ["no_such_file.py", "no_such_file.py:Own", "no_such_module_anywhere:Own"])
def test_load_estimator_from_nowhere_is_refused(spec: str) -> None:
    """A file or module that is not there is named."""
    assert spec.partition(":")[0] in refusal(spec)


def test_load_autopilot_that_asks_is_told_the_heading_reference(file_of) -> None:
    """An autopilot that navigates on the nose must know that the heading means the nose."""
    path = file_of(
        "class Pilot:\n"
        "    def __init__(self, heading_reference='course'): self.reference = heading_reference\n"
        "    def update(self, estimate, m, setpoint): ...\n"
    )
    assert equipping.load_autopilot(f"{path}:Pilot", "nose").reference == "nose"


def test_load_autopilot_that_asks_is_told_the_aircraft(file_of) -> None:
    """An autopilot that flies more than one aeroplane must know which."""
    path = file_of(
        "class Pilot:\n"
        "    def __init__(self, aircraft): self.aircraft = aircraft\n"
        "    def update(self, estimate, m, setpoint): ...\n"
    )
    assert equipping.load_autopilot(f"{path}:Pilot", aircraft="gentle_lady").aircraft == "gentle_lady"


def test_load_autopilot_for_an_aircraft_that_it_has_no_gains_for_is_refused() -> None:
    """One line with those that it has."""
    with pytest.raises(plugins.PluginError, match=r"'glider': the autopilot has no gains .* endurance, gentle_lady$"):
        equipping.load_autopilot("dcm", aircraft="glider")


def test_load_autopilot_with_the_update_of_an_estimator_is_refused(file_of) -> None:
    """An estimator named in the place of an autopilot is noticed."""
    with pytest.raises(plugins.PluginError, match=r"define it as update\(self, estimate, measurements, setpoint\)"):
        equipping.load_autopilot(f"{file_of(FINE)}:Fine")


@dataclass(frozen=True)
class _Gain:
    gain: float = 1.0


class _TakesNothing:
    params = _Gain()

    def update(self, m):
        """Nothing: never flown."""


def test_parameters_of_a_class_that_takes_none_are_refused_in_one_line():
    """A person's own class has parameters that it cannot be given."""
    with pytest.raises(ValueError, match=r"its class must take its params as an argument"):
        equipping.equipped(_TakesNothing, settings={"gain": 2.0})
    assert equipping.equipped(_TakesNothing).code.params.gain == 1.0


class _TakesPull:
    def __init__(self, pull=0.2):
        self.pull = pull

    def update(self, measurements):
        return None


def test_misspelt_argument_of_a_constructor_gets_a_suggestion():
    """As a misspelt field of a parameter dataclass does."""
    with pytest.raises(ValueError, match=r"_TakesPull' has no parameter 'pul': did you mean pull"):
        equipping.equipped(_TakesPull, settings={"pul": 1.0})
    assert equipping.equipped(_TakesPull, settings={"pull": 1.0}).code.pull == 1.0
