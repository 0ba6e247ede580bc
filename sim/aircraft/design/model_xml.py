"""Elements of JSBSim XML, combined by `sim.aircraft.design.builder`."""

from collections.abc import Sequence

import numpy as np

from estimator.interface import Array

HEADER = '<?xml version="1.0"?>\n<!-- Written by build.py: change the numbers there. -->\n'


def number(x: float) -> str:
    return f"{x:.6g}"


def location(body_m: Sequence[float], name: str = "", tag: str = "location") -> str:
    """A position in body axes as XML in JSBSim structural axes (x aft, y right, z up)."""
    x, y, z = -body_m[0] + 0.0, body_m[1], -body_m[2] + 0.0
    label = f' name="{name}"' if name else ""
    return f'<{tag}{label} unit="M"><x>{x:.4f}</x><y>{y:.4f}</y><z>{z:.4f}</z></{tag}>'


def table(variable: str, at: Array, values: Array) -> str:
    """A table of one property."""
    body = "\n".join(f"          {x:8.1f} {y:10.5f}" for x, y in zip(at, np.round(values, 5) + 0.0, strict=True))
    return (
        f'        <table>\n          <independentVar lookup="row">{variable}</independentVar>\n'
        f"          <tableData>\n{body}\n          </tableData>\n        </table>"
    )


def table_2d(row: str, rows: Array, column: str, columns: Array, values: Array) -> str:
    """A table of two properties, values of shape (rows, columns)."""
    head = " " * 18 + " ".join(f"{c:9.3g}" for c in columns)
    body = "\n".join(
        f"          {x:8.1f}" + "".join(f" {v:9.4f}" for v in np.round(line, 4) + 0.0)
        for x, line in zip(rows, values, strict=True)
    )
    return (
        f'        <table>\n          <independentVar lookup="row">{row}</independentVar>\n'
        f'          <independentVar lookup="column">{column}</independentVar>\n'
        f"          <tableData>\n{head}\n{body}\n          </tableData>\n        </table>"
    )


def apply(operation: str, *operands: str | float) -> str:
    """An expression: `operation` on properties, numbers and ready-made XML."""
    lines = []
    for x in operands:
        if isinstance(x, str):
            lines.append(x if x.lstrip().startswith("<") else f"        <property>{x}</property>")
        else:
            lines.append(f"        <value>{number(x)}</value>")
    return "\n".join([f"      <{operation}>", *lines, f"      </{operation}>"])


def function(name: str, expression: str, about: str = "") -> str:
    note = f"      <description>{about}</description>\n" if about else ""
    return f'    <function name="{name}">\n{note}{expression}\n    </function>'


def product(name: str, *factors: str | float, about: str = "") -> str:
    """A function that multiplies `factors`."""
    return function(name, apply("product", *factors), about)


def axis(name: str, *functions: str) -> str:
    return f'  <axis name="{name}">\n' + "\n".join(functions) + "\n  </axis>"
