"""Which tests are most likely to see a flip: those named like the module, then those nearest to it by import."""

import ast
from collections import deque
from functools import cache
from pathlib import Path

PACKAGES = ("estimator", "autopilot", "sim", "scenarios")
LEFT_OUT = ("packaging", "mutants")  # they build wheels and read documents
FAR = 99


def _module(path: Path, root: Path) -> str:
    """The dotted name of a file of the product."""
    return ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")


def _imports(path: Path, modules: set[str]) -> set[str]:
    """Modules of the product that a file imports, also those that it names as text, ``estimator.starlino:Starlino``."""
    found = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and ":" in node.value:
            found.add(node.value.partition(":")[0])
    return found & modules


class Nearness:
    """The tests of a tree, and how far each is from every module."""

    def __init__(self, root: Path) -> None:
        self.root = root
        files = [f for package in PACKAGES for f in sorted((root / package).rglob("*.py"))]
        self._paths = {_module(f, root): f for f in files}
        self.tests = [
            f.relative_to(root).as_posix()
            for f in sorted((root / "tests").rglob("test_*.py"))
            if f.relative_to(root).parts[1] not in LEFT_OUT
        ]

    @cache  # noqa: B019 - one object lives as long as the program
    def _imports_of(self, module: str) -> frozenset[str]:
        return frozenset(_imports(self._paths[module], set(self._paths)))

    @cache  # noqa: B019
    def _steps_of(self, test: str) -> dict[str, int]:
        """Modules that a test reaches, and over how many imports."""
        direct = _imports(self.root / test, set(self._paths))
        steps, waiting = dict.fromkeys(direct, 0), deque(direct)
        while waiting:
            module = waiting.popleft()
            for other in self._imports_of(module):
                # A registry is one step from what it names, and no step at all from those that import its package.
                if other not in steps:
                    steps[other] = steps[module] + 1
                    waiting.append(other)
        return steps

    def steps(self, test: str, path: str) -> int:
        """Imports from the test to the file; -1 for a test that is named like it, `FAR` where it never gets there."""
        module = _module(self.root / path, self.root)
        stem, name = Path(path).stem, f"{Path(test).stem}_"
        if name.startswith((f"test_{stem}_", *(f"test_{part}_{stem}_" for part in Path(path).parts[:-1]))):
            return -1
        return self._steps_of(test).get(module, FAR)

    def order(self, path: str, seconds: dict[str, float]) -> list[str]:
        """The tests that reach a file, the nearest first, of those the quickest."""
        reached = [(self.steps(test, path), seconds.get(test, 4.0), test) for test in self.tests]
        return [test for steps, _, test in sorted(reached) if steps < FAR]
