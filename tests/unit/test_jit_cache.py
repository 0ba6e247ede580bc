"""The cache of compiled kernels notices an edited callee in another file, and keeps what did not change."""

import ast
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numba
import pytest

import estimator.compiler.jit
from estimator.compiler import compiling, kernel_cache, owner
from estimator.compiler.sources import ROOT, Sources, imported

PARTS = ("__init__", "jit", "kernel_cache", "sources", "compiling", "owner")
CALLER = """
from estimator.compiler.jit import kernel
from estimator.callee import (  # (the callee)
    factor,
)

@kernel
def scaled(x):
    return factor(x)
"""
CALLEE = """
from estimator.compiler.jit import kernel

@kernel
def factor(x):
    return {factor} * x
"""
APART = """
from estimator.compiler.jit import kernel

@kernel
def apart(x):
    return x + 1.0
"""
MAIN = """
from estimator.{module} import {kernel}
print({kernel}(2.0), sum({kernel}.stats.cache_hits.values()))
"""


@pytest.fixture
def tree(tmp_path):
    """A package of three tiny kernels, one calling another, around the real cache."""
    package = tmp_path / "estimator"
    (package / "compiler").mkdir(parents=True)
    (package / "__init__.py").touch()
    for part in PARTS:
        text = Path(estimator.compiler.jit.__file__).with_name(f"{part}.py").read_text()
        (package / "compiler" / f"{part}.py").write_text(text)
    (package / "caller.py").write_text(CALLER)
    (package / "callee.py").write_text(CALLEE.format(factor=3.0))
    (package / "apart.py").write_text(APART)
    return tmp_path


def python(tree, code, folder=None, **env):
    """Run `code` in a fresh process in the tree, with its own cache."""
    env = {**os.environ, "XDG_CACHE_HOME": str(tree / "cache"), "PYTHONPATH": str(tree), **env}
    return subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder or tree,
        env=env,
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )


def run(tree, module="caller", kernel="scaled"):
    """What a fresh process computes, how many of its kernels came from the cache, and what it says."""
    done = python(tree, MAIN.format(module=module, kernel=kernel))
    value, hits = done.stdout.split()
    return float(value), int(hits), done.stderr


def files(tree, pattern="*.nb?"):
    """Files of the cache."""
    return sorted((tree / "cache").rglob(pattern))


def test_cache_edited_callee_is_compiled_anew_and_unchanged_sources_are_not(tree):
    """First process compiles, second loads, after an edit of the callee the result is new; others stay."""
    assert run(tree) == (6.0, 0, "")
    assert run(tree, "apart", "apart") == (3.0, 0, "")
    assert run(tree) == (6.0, 1, "")
    (tree / "estimator" / "callee.py").write_text(CALLEE.format(factor=5.0))
    assert run(tree) == (10.0, 0, "")
    assert run(tree, "apart", "apart") == (3.0, 1, "")


def test_cache_own_file_that_calls_local_and_project_kernels_follows_edits_of_both(tree):
    """A person's file outside the packages: its own import, and ours, are noticed when they are edited."""
    folder = tree / "mine"
    folder.mkdir()
    (folder / "helper.py").write_text(CALLEE.format(factor=7.0))
    own = "from estimator.compiler.jit import kernel\nimport helper, estimator.callee as theirs\nmine = helper.factor\n"
    own += "ours = theirs.factor\n\n@kernel\ndef both(x):\n    return mine(x) + ours(x)\n"
    (folder / "own.py").write_text(own)
    code = "from own import both; print(both(1.0), sum(both.stats.cache_hits.values()))"
    said = [python(tree, code, folder).stdout.split() for _ in range(2)]
    (folder / "helper.py").write_text(CALLEE.format(factor=70.0))
    said.append(python(tree, code, folder).stdout.split())
    (tree / "estimator" / "callee.py").write_text(CALLEE.format(factor=5.0))
    said.append(python(tree, code, folder).stdout.split())
    assert said == [["10.0", "0"], ["10.0", "1"], ["73.0", "0"], ["75.0", "0"]]


def test_cache_source_edited_while_running_is_not_kept(tree):
    """What was imported before the edit is compiled, and does not get the name of what was edited."""
    edit = f"open('estimator/callee.py', 'w').write({CALLEE.format(factor=5.0)!r}); "
    code = MAIN.format(module="caller", kernel="scaled").replace("print", f"{edit}print")
    assert python(tree, code).stdout.split() == ["6.0", "0"]
    assert not files(tree, "caller*.nb?")
    assert run(tree) == (10.0, 0, "")


def bent(path, how):
    """Spoil a file of the cache."""
    data = path.read_bytes()
    path.unlink()
    if how == "a folder":
        path.mkdir()
    elif how == "a pipe":
        os.mkfifo(path)
    elif how == "a link to nothing":
        path.symlink_to("nothing")
    elif how != "gone":
        path.write_bytes({
            "empty": b"", "cut": data[: len(data) // 2], "one bit": data[:-9] + bytes([data[-9] ^ 4]) + data[-8:],
            "junk": b"junk", "a pickle": b"cos\nabort\n(tR.",
        }[how])  # fmt: skip


class Here:
    """A kernel in a cache of its own, in this process: each call of `run` begins as a new process would."""

    def __init__(self, folder, monkeypatch):
        self.folder, self._source = folder / "cache", folder / "tiny.py"
        self._source.write_text("def tiny(x):\n    return 3.0 * x\n")
        monkeypatch.setattr(kernel_cache, "base", lambda: self.folder)

    def run(self):
        """What is computed, whether it came from the cache, and what is told."""
        told, names = [], {}
        exec(compile(self._source.read_text(), self._source, "exec"), names)
        compiling.on_trouble(told.append)
        try:
            tiny = estimator.compiler.jit.kernel(names["tiny"])
            return tiny(2.0), sum(tiny.stats.cache_hits.values()), told
        finally:
            compiling.on_trouble(None)


@pytest.fixture
def here(tmp_path, monkeypatch):
    """See `Here`."""
    return Here(tmp_path, monkeypatch)


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize(
    "how", ["empty", "cut", "one bit", "junk", "a pickle", "a folder", "a pipe", "gone", "a link to nothing"]
)
def test_cache_damaged_file_is_told_once_and_compiled_again(here, how, suffix):
    """Whatever a file of the cache has become: the result is right, one line tells it, and the next process loads."""
    assert here.run() == (6.0, 0, [])
    (path,) = here.folder.rglob(f"*.{suffix}")
    bent(path, how)
    value, hits, told = here.run()
    assert (value, hits) == (6.0, 0)
    if suffix == "nbi" and how in ("gone", "a link to nothing"):
        assert told == []  # nothing was promised
    else:
        assert len(told) == 1
        assert told[0].startswith(str(path))
        assert told[0].endswith(": discarded, compiling again")
    assert here.run() == (6.0, 1, [])


@pytest.mark.parametrize("version", ["0.1.0", ("not", "a version")])
def test_cache_of_another_numba_is_compiled_again_without_a_word(here, monkeypatch, version):
    """An index that another version of numba wrote is no damage."""
    with monkeypatch.context() as patched:
        patched.setattr(numba, "__version__", version)
        here.run()
    assert here.run() == (6.0, 0, [])
    assert here.run() == (6.0, 1, [])


def test_cache_damaged_file_is_told_on_standard_error_by_a_process_of_its_own(tree):
    """One line however many files are damaged, and no traceback."""
    run(tree)
    for path in files(tree):
        path.write_bytes(b"junk")
    value, hits, said = run(tree)
    assert (value, hits, said.count("\n")) == (6.0, 0, 1)
    assert said.startswith("wingslevel: kernel cache: ")


@pytest.mark.parametrize("place", ["", "sub/cache", "folder"])
def test_cache_that_cannot_be_made_is_told_once_and_compiled_in_memory(here, place, monkeypatch):
    """A file where a folder of the cache should be: compiled in memory, and the file is left alone."""
    file = here.folder
    file.write_text("mine")
    monkeypatch.setattr(kernel_cache, "base", lambda: file / place)
    value, _, told = here.run()
    assert value == 6.0
    assert len(told) == 1
    assert told[0].startswith("cannot write to ")
    assert file.read_text() == "mine"


@pytest.mark.parametrize("how", ["a file", "a link to nothing"])
def test_cache_folder_of_a_module_that_is_something_else_is_replaced(here, how):
    """What lies in the place of a module's own folder goes."""
    here.run()
    (folder,) = here.folder.iterdir()
    shutil.rmtree(folder)
    folder.write_text("junk") if how == "a file" else folder.symlink_to("nothing")
    assert here.run()[:2] == (6.0, 0)
    assert here.run() == (6.0, 1, [])


def test_cache_full_disk_is_told_once_and_compiled_in_memory(tree):
    """A file that may not grow: the result is right, one line tells it, and nothing half written is left."""
    limit = "import resource, signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
    limit += "resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))\n"
    done = python(tree, limit + MAIN.format(module="caller", kernel="scaled"))
    assert done.stdout.split() == ["6.0", "0"]
    assert done.stderr.startswith("wingslevel: kernel cache: cannot write to ")
    assert done.stderr.count("\n") == 1
    assert not [path for path in files(tree, "*") if path.name.startswith(".") or path.suffix == ".nbc"]


def test_cache_temporary_files_of_the_dead_go_and_those_of_the_living_stay(here):
    """A killed process leaves a file half written; the next process that looks into the cache removes it."""
    here.run()
    (path,) = here.folder.rglob("*.nbc")
    gone, kept = path.with_name(f".x.nbc.{dead_mark()}"), path.with_name(f".x.nbc.{owner.mark()}")
    gone.touch()
    kept.touch()
    kernel_cache._tidy.cache_clear()
    here.run()
    assert (gone.exists(), kept.exists()) == (False, True)


def dead_mark():
    """The mark of a process that has ended."""
    return subprocess.run(
        [sys.executable, "-c", "from estimator.compiler import owner; print(owner.mark())"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    ).stdout.strip()  # fmt: skip


def test_cache_folders_of_old_sources_go_when_unused(here):
    """Of one module the last few versions stay, and whatever was used lately; after a month all go."""
    day_s = 86_400.0
    ages = {f"tiny-{i:016x}": (2 + i) * day_s for i in range(6)} | {"other-0000000000000000": 31 * day_s}
    ages |= {"tiny-new0000000000000": 10.0}
    for name, age_s in ages.items():
        (here.folder / name).mkdir(parents=True)
        os.utime(here.folder / name, (time.time() - age_s,) * 2)
    kernel_cache._tidy.cache_clear()
    here.run()
    left = {path.name for path in here.folder.iterdir()} & set(ages)
    assert left == {"tiny-new0000000000000", "tiny-0000000000000000", "tiny-0000000000000001"}


def test_imported_every_file_of_the_project_finds_what_the_parser_finds():
    """Judged by Python's own parser over all our sources: no import is missed."""
    paths = [
        path for package in ("estimator", "autopilot", "sim", "scenarios") for path in Path(ROOT, package).rglob("*.py")
    ]
    assert len(paths) > 100
    for path in paths:
        source, wanted = path.read_bytes(), set()
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.Import):
                wanted |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                origin = "." * node.level + (node.module or "")
                dot = "" if origin.endswith(".") else "."
                wanted |= {origin} | {f"{origin}{dot}{alias.name}" for alias in node.names if alias.name != "*"}
        assert not wanted - set(imported(source)), path


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("import a.b as c, d", {"a.b", "d"}),
        ("if x: import a", {"a"}),
        ("def f():\n\tfrom a import b", {"a", "a.b"}),
        ("x = 1; from . import y; from ..z import (q as r, # )\n  s,\n)", {".", ".y", "..z", "..z.q", "..z.s"}),
        ("from a \\\n  import b, \\\n  c", {"a", "a.b", "a.c"}),
        ("from a import *", {"a"}),
        ("from fromage import(x)\r\nimport importer", {"fromage", "fromage.x", "importer"}),
        ("m = importlib.import_module('a.b')", {"a.b"}),
        ("try: from.a import b\nexcept ImportError: pass", {".a", ".a.b"}),
    ],
)
def test_imported_every_form_of_an_import_is_found(text, names):
    """However it is written."""
    assert set(imported(text.encode())) == names


def test_closure_of_an_estimator_leaves_out_the_others():
    """The shared kernels are in it, another estimator is not, and neither is what is not ours."""
    closure = {Path(path).name for path in Sources().closure(f"{ROOT}/estimator/premerlani.py")}
    assert {"premerlani.py", "rotation.py", "kernels.py", "jit.py"} <= closure
    assert not {"ins_ekf.py", "ap_dcm.py", "core.py"} & closure


def test_base_without_a_home_is_no_error(monkeypatch):
    """Nobody's home: a path that cannot be made, so that kernels are compiled in memory."""
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", lambda: (_ for _ in ()).throw(RuntimeError("no home")))
    kernel_cache.base.cache_clear()
    try:
        assert kernel_cache.base() == Path("/dev/null/kernels")
    finally:
        kernel_cache.base.cache_clear()
