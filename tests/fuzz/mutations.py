"""Damage: bytes flipped, cut, doubled and spliced; cells, values and fields replaced by what nobody expects.

Every function takes the generator first, and returns a damaged copy.
"""

import copy
import json
import struct
from collections.abc import Callable
from typing import Any

import numpy as np

Generator = np.random.Generator
CELLS = (
    "1e308",
    "-1e308",
    "1e99",
    "-1",
    "0",
    "nan",
    "",
    "inf",
    "-inf",
    "-",
    "1e",
    "x" * 300,
    "\u0663\u0664",
    "\u00b2",
    "9" * 400,
    "0x1F",
    "1_000",
    '"',
    "'",
    "12:34:56",
    "2026-07-02T12:00:00",
    "\x1b[31m",
    "\u202e",
    "1,5",
    "#",
    "//",
    "true",
    "1e-320",
    "\0",
)
TOML = (
    "1e308",
    "-1e308",
    "nan",
    "-inf",
    "-1",
    "0",
    "9" * 5000,
    "9" * 400,
    "true",
    '""',
    "[]",
    "{}",
    "[[]]",
    "2026-07-02",
    "12:00:00",
    '"x"',
    '"' + "y" * 300 + '"',
    "[" * 3000 + "]" * 3000,
    '"\\u0000"',
    "{ value = [] }",
    "0x7f",
    '"gyro.x deg/s"',
    '"-force.z"',
    "[1, 2, 3]",
    '{ is = "mag.x", unit = "mG", factor = 0.9, offset = 1e308 }',
)
VALUES: tuple[Any, ...] = (
    None,
    True,
    False,
    -1,
    0,
    10**400,
    1e308,
    -1e308,
    float("nan"),
    float("inf"),
    "",
    "x",
    "1",
    "\x1b[31m",
    "\ud800",
    [],
    {},
    [[]],
    [1, 2, 3],
    {"a": None},
    {"value": None, "source": "set"},
    "y" * 500,
)
NUMBERS = (1e308, -1e308, 1e99, 1e12, -1.0, 0.0, np.nan, np.inf, -np.inf, 5e-324, 4.5e15)
_PATTERNS = (
    b"\xff" * 4,
    b"\xff" * 8,
    b"\0" * 8,
    b"\x7f" * 8,
    struct.pack("<d", 1e308),
    struct.pack("<f", 3e38),
    struct.pack("<d", np.nan),
    struct.pack("<i", -1),
    struct.pack("<Q", 1 << 63),
    struct.pack("<I", 0x7FFFFFFF),
    b"1e308",
    b"\xa3\x95\x80",
    b"\0\0",
    b"\n",
    b",",
)


def pick(rng: Generator, choices: Any) -> Any:
    """One of them."""
    return choices[int(rng.integers(len(choices)))]


def of_bytes(rng: Generator, raw: bytes) -> bytes:
    """Damage of the kinds that a disk, a radio or a download does."""
    made = bytearray(raw)
    for _ in range(int(rng.integers(1, 4))):
        n = len(made)
        if not n:
            break
        at, length = int(rng.integers(n)), int(rng.integers(1, 1 + min(n, 200)))
        kind = int(rng.integers(8))
        if kind <= 2:
            for place in rng.integers(n, size=int(rng.integers(1, 6))):
                made[place] ^= 1 << int(rng.integers(8))
        elif kind == 3:
            del made[at:]
        elif kind == 4:
            made[at:at] = made[at : at + length]
        elif kind == 5:
            del made[at : at + length]
        elif kind == 6:
            other = int(rng.integers(n))
            made[at : at + length] = made[other : other + length]
        else:
            pattern = pick(rng, _PATTERNS)
            made[at : at + (len(pattern) if rng.random() < 0.8 else 0)] = pattern
    return bytes(made)


def of_pieces(rng: Generator, pieces: list[bytes]) -> bytes:
    """Damage of a log of records: whole ones lost, doubled and swapped, and fields replaced in place."""
    made = list(pieces)
    for _ in range(int(rng.integers(1, 6))):
        i, j = int(rng.integers(len(made))), int(rng.integers(len(made)))
        kind = int(rng.integers(7))
        if kind == 0 and len(made) > 1:
            del made[i]
        elif kind == 1:
            made.insert(j, made[i])
        elif kind == 2:
            made[i], made[j] = made[j], made[i]
        elif kind == 3:
            i = int(rng.integers(min(12, len(made))))  # definitions come first
            made[i] = of_bytes(rng, made[i])
        else:
            piece, pattern = bytearray(made[i]), pick(rng, _PATTERNS)
            at = int(rng.integers(3, max(4, len(piece))))
            piece[at : at + len(pattern)] = pattern[: max(0, len(piece) - at)]  # as long as before
            made[i] = bytes(piece)
    return b"".join(made)


def of_table(rng: Generator, text: str, delimiter: str = ",") -> bytes:
    """Damage of a table in text: cells, lines, columns and names."""
    rows = [line.split(delimiter) for line in text.splitlines()]
    encoding = "utf-8"
    for _ in range(int(rng.integers(1, 4))):
        i = 0 if rng.random() < 0.2 else int(rng.integers(len(rows)))
        j = int(rng.integers(max(1, len(rows[i]))))
        kind = int(rng.integers(12))
        if kind <= 4 and rows[i]:
            rows[i][j] = pick(rng, CELLS)
        elif kind == 5:
            cell = pick(rng, CELLS)
            for row in rows[1:]:
                row[j : j + 1] = [cell]
        elif kind == 6:
            rows.insert(int(rng.integers(len(rows))), list(rows[i]))
        elif kind == 7 and len(rows) > 1:
            del rows[i]
        elif kind == 8:
            k = int(rng.integers(len(rows)))
            rows[i], rows[k] = rows[k], rows[i]
        elif kind == 9:
            rows[i] = rows[i] * int(rng.integers(2, 30)) if rng.random() < 0.5 else rows[i][:j]
        elif kind == 10:
            rows = rows[: int(rng.integers(1, 1 + len(rows)))]
        else:
            encoding = pick(rng, ("utf-16", "latin-1", "utf-8-sig", "utf-8"))
    made = pick(rng, ("\n", "\n", "\n", "\r\n", "\r")).join(delimiter.join(row) for row in rows)
    raw = made.encode(encoding, "replace")
    return of_bytes(rng, raw) if rng.random() < 0.3 else raw


def of_toml(rng: Generator, text: str) -> bytes:
    """Damage of a file of settings: values, names, headings, lines."""
    lines = text.splitlines()
    for _ in range(int(rng.integers(1, 4))):
        i = int(rng.integers(len(lines)))
        name, equals, value = lines[i].partition(" = ")
        kind = int(rng.integers(8))
        if kind <= 3 and equals:
            lines[i] = f"{name} = {pick(rng, TOML)}"
        elif kind == 4 and equals:
            other = pick(rng, ("x", "gyro", "board", "columns", "calibration", "a.b.c", '"9 9"'))
            lines[i] = f"{other} = {value}"
        elif kind == 5:
            lines.insert(int(rng.integers(len(lines))), lines[i])
        elif kind == 6:
            del lines[i]
            lines = lines or [""]
        else:
            lines[i] = pick(
                rng,
                ("[columns]", "[gyro]", "[board]", "[[instruments]]", "[on_ground]", "[changes]", "x = [", "\x00", "#"),
            )
    raw = "\n".join(lines).encode()
    return of_bytes(rng, raw) if rng.random() < 0.2 else raw


def of_tree(rng: Generator, data: Any) -> Any:
    """Damage of a tree of tables and lists: an entry replaced, lost or renamed."""
    made = copy.deepcopy(data)
    for _ in range(int(rng.integers(1, 3))):
        at: Any = made
        while isinstance(at, dict | list) and at:
            key = pick(rng, list(at)) if isinstance(at, dict) else int(rng.integers(len(at)))
            below = at[key]
            if isinstance(below, dict | list) and below and rng.random() < 0.7:
                at = below
                continue
            if rng.random() < 0.15:
                del at[key]
            elif isinstance(at, dict) and rng.random() < 0.1:
                at[f"{key}x"] = at.pop(key)
            else:
                at[key] = pick(rng, VALUES)
            break
    return made


def as_json(rng: Generator, data: Any) -> bytes:
    """A damaged tree as JSON, which now and then is none."""
    text = json.dumps(of_tree(rng, data))
    if rng.random() < 0.03:
        text = "[" * 100_000 + "]" * 100_000
    raw = text.encode()
    return of_bytes(rng, raw) if rng.random() < 0.15 else raw


def of_array(rng: Generator, values: Any) -> Any:
    """Damage of an array of numbers: an element, all of them, its shape or its type."""
    made = np.array(values)
    kind = int(rng.integers(9))
    if kind <= 3 and made.size and made.dtype.kind == "f":
        made = made.astype(np.float64)
        made.flat[int(rng.integers(made.size))] = pick(rng, NUMBERS)
    elif kind == 4:
        made = np.full(made.shape, pick(rng, NUMBERS))
    elif kind == 5:
        made = made[: int(rng.integers(0, 3))]
    elif kind == 6:
        made = pick(rng, (made.T, made.ravel(), made[None], np.repeat(made, 2, axis=0)))
    elif kind == 7:
        made = pick(
            rng,
            (
                made.astype("U5"),
                made.astype(object),
                *((made.astype("f4"), made.astype("i4"), made + 1j, made > 0) if made.dtype.kind == "f" else ()),
            ),
        )
    else:
        made = pick(
            rng, (np.zeros(0), np.array("text"), np.array(["a", 1.0], object), np.zeros((2, 3, 4)), np.array(5.0))
        )
    return made


Damage = Callable[[Generator], bytes]
