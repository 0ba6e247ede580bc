"""Everything with a name, with a line about each, read from the sources: a listing waits for no compiler or engine."""

import ast
import tomllib
from pathlib import Path
from typing import Any

from scenarios.harness import plugins
from sim.outside.entry_points import offered

KINDS = ("scenarios", "estimators", "autopilots", "aircraft", "suites", "parts")
_ROOT = Path(__file__).resolve().parents[3]


def catalogue() -> dict[str, dict[str, str]]:
    """Everything that has a name on the command line: kind -> name -> one line about it, names in order.

    What an installed package offers is named and not imported: its line says where it is.
    """
    found = ours()
    for kind, things in found.items():
        offers = offered(kind, things).values()
        found[kind] |= {offer.name: f"{offer.value} ({offer.origin})" for offer in offers}
    return {kind: dict(sorted(things.items())) for kind, things in found.items()}


def ours() -> dict[str, dict[str, str]]:
    """As `catalogue`, without what installed packages offer."""
    return {
        "scenarios": {n: lines for p in (_ROOT / "scenarios").glob("[!_]*.py") for n, lines in _scenarios(p).items()},
        **{kind: {name: _about(where) for name, where in code.items()} for kind, code in plugins.OURS.items()},
        "aircraft": aircraft(),
        "suites": sensor_suites(),
        "parts": parts(),
    }


def _scenarios(path: Path) -> dict[str, str]:
    """The scenario of a file and its variants, each with a line about it."""
    tree = _tree(path)
    lines = {path.stem: _first_line(tree)}
    for node in tree.body:
        if isinstance(node, ast.Assign) and any(isinstance(t, ast.Name) and t.id == "VARIANTS" for t in node.targets):
            lines |= {f"{path.stem}_{ending}": line for ending, line in ast.literal_eval(node.value).items()}
    return lines


def aircraft() -> dict[str, str]:
    """Names of the aircraft there are, with a line about each: every folder that holds the XML of its name."""
    folders = (_ROOT / "sim" / "aircraft").iterdir()
    return {p.name: _about_aircraft(p) for p in folders if (p / f"{p.name}.xml").is_file()}


def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def _first_line(node: ast.Module | ast.ClassDef) -> str:
    return (ast.get_docstring(node) or "").partition("\n")[0]


def _about(where: str) -> str:
    """First line of the docstring of the class at ``module:Class``; the place itself if it is not ours."""
    module, _, name = where.partition(":")
    path = _ROOT.joinpath(*module.split(".")).with_suffix(".py")
    if not path.is_file():
        return where
    classes = (node for node in _tree(path).body if isinstance(node, ast.ClassDef) and node.name == name)
    return next((_first_line(node) for node in classes), where)


def _about_aircraft(folder: Path) -> str:
    package = folder / "__init__.py"
    return _first_line(_tree(package)) if package.is_file() else ""


def sensor_suites() -> dict[str, str]:
    """Names of the sensor suites there are, with what each one is."""
    return {path.stem: _toml(path).get("summary", "") for path in (_ROOT / "sim" / "sensors" / "suites").glob("*.toml")}


def parts() -> dict[str, str]:
    """Names of the parts that have a data sheet here, with what each one is."""
    return {path.stem: _about_part(_toml(path)) for path in (_ROOT / "sim" / "sensors" / "parts").glob("*.toml")}


def _about_part(data: dict[str, Any]) -> str:
    return f"{data.get('maker', '')} {data.get('name', '')}: {data.get('summary', '')}"


def _toml(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text(encoding="utf-8"))
