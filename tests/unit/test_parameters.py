"""The list of an estimator's parameters: complete for ours, readable for your own, and the page that is made of it."""

import importlib
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest

from estimator import ESTIMATORS
from estimator.params import PARAMETERS
from scenarios.harness import equipping, plugins
from scenarios.harness.parameters import default_text, estimator_parameters, update_page

ROOT = Path(__file__).parents[2]

OWN = '''
from dataclasses import dataclass, field

@dataclass(frozen=True)
class Lag:
    """A receiver.

    delay_s : s  age of a fix
        higher: the nose is
            recalled from earlier; lower: from later
    """
    delay_s: float = 0.3

@dataclass(frozen=True)
class Params:
    """Mine.

    gain : 1/s  pull of the accelerometer
        higher: noisier; lower: slower
    learn : switch  learn the offset
        on: it is learnt; off: it is kept
    """
    gain: float = 0.5
    learn: bool = True
    width_m: float = 1.5
    enabled: bool = False
    lag: Lag = field(default_factory=Lag)

class WithParams:
    def __init__(self, params: Params = Params()): self.params = params
    def update(self, measurements): ...

class WithArguments:
    """Mine too.

    k_p : 1/s  proportional gain
        higher: quicker; lower: slower
    """
    def __init__(self, k_p=2.0, use_airspeed=True, instruments=None, name=None): ...
    def update(self, measurements): ...

class WithNothing:
    def update(self, measurements): ...
'''


@pytest.fixture
def own(tmp_path: Path) -> str:
    """A file with three estimators."""
    (tmp_path / "own.py").write_text(OWN)
    return str(tmp_path / "own.py")


@pytest.mark.parametrize("name", sorted(PARAMETERS))
def test_each_parameter_says_unit_meaning_and_what_a_change_does(name: str) -> None:
    """A number what raising and lowering do, a switch what on and off do, a choice its values."""
    found = estimator_parameters(name)
    assert found
    for parameter in found:
        assert parameter.unit, parameter
        assert len(parameter.meaning) > 5, parameter
        if parameter.unit == "choice":
            assert not isinstance(parameter.default, bool | int | float), parameter
        else:
            assert parameter.raised, parameter
            assert parameter.lowered, parameter
        if isinstance(parameter.default, bool):
            assert parameter.unit == "switch", parameter
        text = f"{parameter.meaning} {parameter.raised} {parameter.lowered}"
        assert not any(f"{word}: " in text for word in ("higher", "lower", "on", "off")), parameter


@pytest.mark.parametrize("name", sorted(ESTIMATORS))
def test_names_and_defaults_are_those_of_the_estimator(name: str) -> None:
    """What is read without the compiler is what the estimator flies with."""
    code = equipping.load_estimator(name)
    found = estimator_parameters(name)
    assert {p.name for p in found} == equipping.parameters_of(name)
    assert len({p.name for p in found}) == len(found)
    for parameter in found:
        value = code.params  # type: ignore[attr-defined]
        for part in parameter.name.split("."):
            value = getattr(value, part)
        assert value == parameter.default
    assert bool(found) == (name in PARAMETERS)


def test_names_of_this_project_do_not_load_the_compiler() -> None:
    """A list of all parameters is printed at once."""
    code = (
        "import sys; from estimator.params import PARAMETERS; from scenarios.harness.parameters import *\n"
        "for name in PARAMETERS.keys() - {'complementary'}: estimator_parameters(name)\n"
        "sys.exit('numba' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0


def test_own_parameter_class_is_listed_with_what_it_says(own: str) -> None:
    """Documented fields in full; of others the name, the default and the unit in the name; groups with dots."""
    found = {p.name: tuple(p)[1:] for p in estimator_parameters(f"{own}:WithParams")}
    assert found == {
        "gain": (0.5, "1/s", "pull of the accelerometer", "noisier", "slower"),
        "learn": (True, "switch", "learn the offset", "it is learnt", "it is kept"),
        "width_m": (1.5, "m", "", "", ""),
        "enabled": (False, "switch", "", "", ""),
        "lag.delay_s": (0.3, "s", "age of a fix", "the nose is recalled from earlier", "from later"),
    }


def test_own_constructor_arguments_are_listed(own: str) -> None:
    """Those that can be set; documented in the docstring of the class."""
    found = [tuple(p) for p in estimator_parameters(f"{own}:WithArguments")]
    assert found == [
        ("k_p", 2.0, "1/s", "proportional gain", "quicker", "slower"),
        ("use_airspeed", True, "switch", "", "", ""),
        ("name", None, "", "", "", ""),
    ]


def test_own_estimator_without_parameters_has_none(own: str) -> None:
    """By name, and by class."""
    assert estimator_parameters(f"{own}:WithNothing") == []

    class Mine:
        """Nothing to set."""

        def __init__(self, gain: float = 0.25) -> None:
            self.gain = gain

        def update(self, _measurements: object) -> None:
            """Nothing."""

    assert [tuple(p) for p in estimator_parameters(Mine)] == [("gain", 0.25, "", "", "", "")]


def test_unknown_estimator_is_refused_in_one_line() -> None:
    """With the near misses."""
    with pytest.raises(plugins.PluginError, match="did you mean premerlani"):
        estimator_parameters("premerlanni")


@pytest.mark.parametrize(
    ("value", "text"),
    [(True, "true"), (False, "false"), (0.104719755, "0.1047"), (float("inf"), "inf"), (3, "3"), (None, "unknown")],
)
def test_default_text_is_short(value: object, text: str) -> None:
    """Four digits."""
    assert default_text(value) == text


def test_page_of_estimators_is_up_to_date(tmp_path: Path) -> None:
    """To renew it: `update_page(Path("docs/estimators.md"))`."""
    page = ROOT / "docs" / "estimators.md"
    copy = tmp_path / "estimators.md"
    copy.write_text(page.read_text(encoding="utf-8"), encoding="utf-8")
    update_page(copy)
    assert copy.read_text(encoding="utf-8") == page.read_text(encoding="utf-8")
    for target in PARAMETERS.values():
        module, _, name = target.partition(":")
        found = getattr(importlib.import_module(module), name)
        for f in fields(found):
            assert f"`{f.name}" in page.read_text(encoding="utf-8"), (target, f.name)


def test_page_without_the_marks_is_refused(tmp_path: Path) -> None:
    """Nothing is written into a page that does not ask for it."""
    page = tmp_path / "other.md"
    page.write_text("# Other\n")
    with pytest.raises(ValueError, match="needs the lines"):
        update_page(page)
    assert page.read_text() == "# Other\n"
