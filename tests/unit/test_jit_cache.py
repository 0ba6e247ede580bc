"""The cache of compiled kernels notices an edited callee in another file, and keeps what did not change."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import estimator.jit
from estimator.jit import sources_hash

CALLER = """
from estimator.jit import kernel
from estimator.callee import factor

@kernel
def scaled(x):
    return factor(x)
"""
CALLEE = """
from estimator.jit import kernel

@kernel
def factor(x):
    return {factor} * x
"""
MAIN = "from estimator.caller import scaled; print(scaled(2.0), sum(scaled.stats.cache_hits.values()))"


@pytest.fixture
def tree(tmp_path):
    """A package of two tiny kernels, one calling the other, around the real jit.py."""
    package = tmp_path / "estimator"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "jit.py").write_text(Path(estimator.jit.__file__).read_text())
    (package / "caller.py").write_text(CALLER)
    (package / "callee.py").write_text(CALLEE.format(factor=3.0))
    return tmp_path


def run(tree):
    """What a fresh process computes, and how many of its kernels came from the cache."""
    env = {**os.environ, "XDG_CACHE_HOME": str(tree / "cache")}
    env.pop("PYTHONPATH", None)
    out = subprocess.run(
        [sys.executable, "-c", MAIN], cwd=tree, env=env, capture_output=True, text=True, check=True, timeout=60
    ).stdout
    value, hits = out.split()
    return float(value), int(hits)


def test_cache_edited_callee_is_compiled_anew_and_unchanged_sources_are_not(tree):
    """First process compiles, second loads, and after an edit of the callee the third computes the new result."""
    assert run(tree) == (6.0, 0)
    assert run(tree) == (6.0, 1)
    (tree / "estimator" / "callee.py").write_text(CALLEE.format(factor=5.0))
    assert run(tree) == (10.0, 0)


def test_sources_hash_depends_on_names_and_contents_of_all_kernel_packages(tree):
    """An edit, a new file and a renamed file each change it; a touch does not."""
    first = sources_hash(tree)
    caller = tree / "estimator" / "caller.py"
    os.utime(caller, (0, 0))
    assert sources_hash(tree) == first
    seen = {first}
    (tree / "sim").mkdir()
    (tree / "sim" / "air.py").write_text("pass\n")
    seen.add(sources_hash(tree))
    caller.rename(caller.with_name("renamed.py"))
    seen.add(sources_hash(tree))
    (tree / "sim" / "air.py").write_text("...\n")
    seen.add(sources_hash(tree))
    assert len(seen) == 4
