"""The claims there are: ``CLAIMS`` of every module of ``scenarios.claims``, in the order of their papers."""

import importlib
import pkgutil
from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from functools import cache
from types import MappingProxyType

import scenarios.claims
from scenarios.harness.claims.claim import Claim, Paper
from sim.params import near_misses

# The sections of the theory that make claims, in its order.  The other papers' claims stand as their modules have them.
SECTIONS = (
    "Introduction",
    "Direction cosine matrices",
    "Computing direction cosines from gyro signals",
    "Renormalization",
    "Drift cancellation",
    "GPS",
    "Accelerometers",
    "Feedback controller",
    "Gyro characteristics",
    "Wind",
    "Using DCM in control and navigation",
)


@cache
def claims() -> Mapping[str, Claim]:
    """All claims by name: paper by paper, within the theory section by section.

    Raises
    ------
    ValueError      two are called alike
    """
    found: dict[str, Claim] = {}
    for info in sorted(pkgutil.iter_modules(scenarios.claims.__path__), key=lambda info: info.name):
        module = importlib.import_module(f"scenarios.claims.{info.name}")
        for claim in getattr(module, "CLAIMS", ()):
            if claim.name in found:
                raise ValueError(
                    f"two claims are called {claim.name!r}: rename that of scenarios/claims/{info.name}.py"
                )
            found[claim.name] = claim
    return MappingProxyType({claim.name: claim for claim in sorted(found.values(), key=_place)})


def _place(claim: Claim) -> tuple[int, int]:
    """Where a claim stands: number of its paper, and of the section that its place begins with."""
    place = claim.place.casefold().replace("isation", "ization")
    sections = [i for i, section in enumerate(SECTIONS) if place.startswith(section.casefold())]
    return list(Paper).index(claim.paper), sections[0] if sections else len(SECTIONS)


def matching(patterns: Iterable[str]) -> list[Claim]:
    """The claims that `patterns` ask for, names or ``offset*``, in the order of `claims`; all where there are none.

    Raises
    ------
    ValueError      nothing is called so
    """
    wanted = tuple(patterns)
    for pattern in wanted:
        if not any(fnmatchcase(name, pattern) for name in claims()):
            raise ValueError(f"unknown claim {pattern!r}: {near_misses(pattern, claims())}")
    return [claim for name, claim in claims().items() if not wanted or any(fnmatchcase(name, p) for p in wanted)]
