"""The tool that flips signs and comparisons: every flip is another program, and the right one."""

import ast
import importlib.util
import sys
from pathlib import Path

import pytest

FLIPS = Path(__file__).parent.parent / "mutants" / "flips.py"


@pytest.fixture(scope="module")
def flips():
    """The module; it is no part of a package."""
    spec = importlib.util.spec_from_file_location("_flips", FLIPS)
    module = importlib.util.module_from_spec(spec)
    sys.modules["_flips"] = module  # dataclasses look there
    spec.loader.exec_module(module)
    yield module
    del sys.modules["_flips"]


SOURCE = b'''"""No flip: 1 - 2 < 3."""

def f(a: int = -1, *b) -> "x - y":
    """Nor here: a * b."""
    if not 0.0 < a <= 2.0:
        raise ValueError(f"a is {a - 1}: " + "choose 0 < a")
    a += (2  # not this one: +
          * b[0])
    return -a / 2, f"{a * 2}"
'''


def test_flips_of_a_source_are_its_operators_and_no_text(flips):
    """Minus signs, arithmetic and each part of a chained comparison; no docstring, annotation or error message."""
    found = [(f.line, f.change) for f in flips.flips_of("f.py", SOURCE)]
    assert found == [
        (3, "- -> +"), (5, "< -> >="), (5, "<= -> >"), (7, "+ -> -"), (8, "* -> /"), (9, "- -> +"), (9, "/ -> *"),
    ]  # fmt: skip


def test_every_flip_of_the_product_is_another_program(flips):
    """Each can be parsed, differs from the source in that operator alone, and is named by its line."""
    sources = {}
    every = flips.every_flip()
    assert len(every) > 5000
    for flip in flips.sample(every, 100, seed=3):
        source = sources.setdefault(flip.path, (flips.ROOT / flip.path).read_bytes())
        changed = flip.applied(source)
        assert ast.dump(ast.parse(changed)) != ast.dump(ast.parse(source))
        assert source.decode().splitlines()[flip.line - 1].strip() == flip.text
        assert len(changed) - len(source) == len(flip.new) - len(flip.old)


def test_sample_of_more_begins_with_the_sample_of_fewer(flips):
    """A larger number goes on with a run; another seed is another run."""
    every = flips.every_flip()
    assert flips.sample(every, 50, 1) == flips.sample(every, 80, 1)[:50]
    assert flips.sample(every, 50, 1) != flips.sample(every, 50, 2)


def test_flip_of_another_source_is_refused(flips):
    """A file that was edited since is not flipped anywhere."""
    (first, *_) = flips.flips_of("f.py", SOURCE)
    with pytest.raises(ValueError, match=r"f\.py:3"):
        first.applied(b"\n" + SOURCE)
