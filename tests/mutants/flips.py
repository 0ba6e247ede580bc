"""The flips: where in a source a sign, an arithmetic operator or a comparison stands, and what it becomes.

A minus sign goes, + and - change places, * and / do, and a comparison becomes its opposite.  Left alone is what makes
no difference to what is computed: annotations, what only words an error message (`raise`, f-strings, a text put
together with + or %), and paths put together with /.
"""

import ast
import hashlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
PLACES = ("estimator", "autopilot", "sim", "scenarios/harness/metrics/series.py")
_OPERATORS: dict[type[ast.AST], tuple[str, str]] = {
    ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*"),
    ast.Lt: ("<", ">="), ast.LtE: ("<=", ">"), ast.Gt: (">", "<="), ast.GtE: (">=", "<"),
    ast.Eq: ("==", "!="), ast.NotEq: ("!=", "=="),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Flip:
    """One change of one operator: the bytes `start`..`end` of `path` are `old` and become `new`."""

    path: str
    line: int
    start: int
    end: int
    old: str
    new: str
    text: str  # the line
    nth: int = 0  # of this change in lines that read the same

    @property
    def change(self) -> str:
        """What a person reads."""
        return f"{self.old} -> {self.new}"

    @property
    def key(self) -> str:
        """A name that stays as long as the line does, whatever is edited around it."""
        return f"{self.path}: {self.text} [{self.change}, {self.nth}]"

    def applied(self, source: bytes) -> bytes:
        """The source with the flip.  ValueError where it is another source."""
        if source[self.start : self.end] != self.old.encode():
            raise ValueError(f"{self.path}:{self.line}: has {source[self.start : self.end]!r}, not {self.old!r}")
        return source[: self.start] + self.new.encode() + source[self.end :]

    def to_json(self) -> dict[str, object]:
        """All of it as plain values."""
        return asdict(self)


def flips_of(path: str, source: bytes) -> list[Flip]:
    """Every flip of one file, in the order of the text."""
    lines = source.splitlines(keepends=True)
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line))

    def flip(start: int, end: int, operator: ast.AST) -> Flip | None:
        """The flip of the operator that stands between two operands."""
        old, new = ("-", "+") if isinstance(operator, ast.USub) else _OPERATORS.get(type(operator), ("", ""))
        where = _find(source, start, end, old) if old else -1
        if where < 0:
            return None
        line = sum(s <= where for s in starts)
        return Flip(path, line, where, where + len(old), old, new, lines[line - 1].decode().strip())

    def offset(line: int, column: int) -> int:
        return starts[line - 1] + column

    found = []
    for node in _computing(ast.parse(source)):
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            found.append(flip(offset(node.lineno, node.col_offset), offset(*_start(node.operand)), node.op))
        elif isinstance(node, ast.BinOp):
            found.append(flip(offset(*_end(node.left)), offset(*_start(node.right)), node.op))
        elif isinstance(node, ast.AugAssign):
            found.append(flip(offset(*_end(node.target)), offset(*_start(node.value)), node.op))
        elif isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            for left, operator, right in zip(sides, node.ops, sides[1:], strict=False):
                found.append(flip(offset(*_end(left)), offset(*_start(right)), operator))
    seen: Counter[str] = Counter()
    numbered = []
    for found_flip in sorted((f for f in found if f), key=lambda f: f.start):
        numbered.append(replace(found_flip, nth=seen[found_flip.key]))
        seen[found_flip.key] += 1
    return numbered


def every_flip(root: Path = ROOT) -> list[Flip]:
    """All flips of the product, by file and place."""
    files = [f for place in PLACES for f in ([root / place] if place.endswith(".py") else (root / place).rglob("*.py"))]
    found = []
    for file in sorted(files):
        found += flips_of(file.relative_to(root).as_posix(), file.read_bytes())
    return found


def sample(flips: list[Flip], number: int, seed: int) -> list[Flip]:
    """So many of them, drawn without regard to anything; an edit elsewhere draws no others, a larger number more."""
    return sorted(flips, key=lambda flip: hashlib.sha256(f"{seed} {flip.key}".encode()).digest())[:number]


def _start(node: ast.expr) -> tuple[int, int]:
    return node.lineno, node.col_offset


def _end(node: ast.expr) -> tuple[int, int]:
    assert node.end_lineno is not None
    assert node.end_col_offset is not None
    return node.end_lineno, node.end_col_offset


def _find(source: bytes, start: int, end: int, operator: str) -> int:
    """Where the operator stands between two operands; comments between them are passed over."""
    k = start
    while k < end:
        if source[k : k + 1] == b"#":
            k = source.index(b"\n", k)
        elif source[k : k + len(operator)] == operator.encode():
            return k
        k += 1
    return -1


def _is_text(node: ast.AST) -> bool:
    """Whether text is put together here: an operand is a text."""
    if isinstance(node, ast.BinOp):
        return _is_text(node.left) or _is_text(node.right)
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def _computing(node: ast.AST) -> Iterator[ast.AST]:
    """The nodes that compute something."""
    if isinstance(node, (ast.Raise, ast.JoinedStr)) or (isinstance(node, ast.BinOp) and _is_text(node)):
        return
    yield node
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _computing(child)
