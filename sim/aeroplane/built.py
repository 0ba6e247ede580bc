"""An aeroplane as it was built: how it differs from its drawing.

JSBSim's masses cannot be set at run time, so the differences are written into a copy of the model, which JSBSim loads
from a temporary folder before the flight; nothing is written while it flies.  An aeroplane built as drawn is loaded
from its own folder.

References
----------
Etkin, B. and Reid, L. D., "Dynamics of Flight", 3rd ed., 1996, section 2.3: the neutral point; section 4.3: the
moments of inertia.
Glauert, H., R&M 595, 1919: the wing in strips.  With the same chord and slope a everywhere, halves of a wing at angles
of +w/2 and -w/2 roll it with Cl = a w / 8, and the damping in roll is Clp = -a / 6; so Cl = -3/4 Clp w.
"""

import math
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import astuple, dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np

from autopilot.interface import ActuatorCommand
from estimator.interface import Array
from sim.aeroplane.trim import Trim, accelerations, trim

if TYPE_CHECKING:
    from sim.aeroplane.jsbsim_model import Model

AIRCRAFT = Path(__file__).parents[1] / "aircraft"
PROPELLER = "propeller.xml"
STEP_RAD = 1e-4  # of the angle of attack, for slopes


@dataclass(frozen=True, slots=True)
class AsBuilt:
    """Differences from the drawing.

    mass_factor         of the drawn mass, with all parts heavier alike: the moments of inertia change with it
    cg_aft              centre of gravity behind the drawn one, in mean chords; below 0 ahead of it
    roll_inertia_factor, pitch_inertia_factor, yaw_inertia_factor   of the moments of inertia, on top of the mass's
    aileron_trim, elevator_trim, rudder_trim    deflection at neutral command, of the full one; the stops stay
    thrust_factor       of the thrust at the same propeller speed and airspeed
    warp_deg            incidence of the left half of the wing less that of the right half: above 0 rolls right
    """

    mass_factor: float = 1.0
    cg_aft: float = 0.0
    roll_inertia_factor: float = 1.0
    pitch_inertia_factor: float = 1.0
    yaw_inertia_factor: float = 1.0
    aileron_trim: float = 0.0
    elevator_trim: float = 0.0
    rudder_trim: float = 0.0
    thrust_factor: float = 1.0
    warp_deg: float = 0.0

    @property
    def trims(self) -> tuple[float, float, float]:
        """Of aileron, elevator and rudder."""
        return self.aileron_trim, self.elevator_trim, self.rudder_trim

    @property
    def as_modelled(self) -> bool:
        """Whether the model itself is as drawn; the trims are added to the commands."""
        return replace(self, aileron_trim=0.0, elevator_trim=0.0, rudder_trim=0.0) == AS_DRAWN

    def servos(self, command: ActuatorCommand) -> ActuatorCommand:
        """What the servos do at `command`: off by the trims."""
        if not any(self.trims):
            return command
        aileron, elevator, rudder = (c + off for c, off in zip(command[:3], self.trims, strict=True))
        return command._replace(aileron=aileron, elevator=elevator, rudder=rudder)


AS_DRAWN = AsBuilt()


@contextmanager
def model_folder(own: Path, built: AsBuilt) -> Iterator[tuple[str, str]]:
    """Folders from which JSBSim loads the model of the folder `own`, and its engine; copies last as long as the block.

    Raises
    ------
    ValueError      no body has such moments of inertia, or a thrust of an aeroplane without a motor
    OSError         the copy cannot be written
    """
    if built.as_modelled:
        yield str(own.parent), str(own)
        return
    with tempfile.TemporaryDirectory(prefix="wingslevel-") as name:
        copy = Path(name) / own.name
        copy.mkdir()
        for part in own.glob("*.xml"):
            shutil.copyfile(part, copy / part.name)
        _rewrite(copy / f"{own.name}.xml", lambda model: _change(model, built))
        if built.thrust_factor != 1.0:
            _weaken(copy, built.thrust_factor)
        yield name, str(copy)


def has_motor(aircraft: str) -> bool:
    """Whether the aeroplane has a propeller."""
    return (AIRCRAFT / aircraft / PROPELLER).exists()


@cache
def drawn_inertia_kg_m2(aircraft: str) -> tuple[float, float, float]:
    """Moments of inertia about x, y and z of the drawn aeroplane."""
    masses = _found(ElementTree.parse(AIRCRAFT / aircraft / f"{aircraft}.xml").getroot(), "mass_balance")
    x, y, z = (_number(masses, f"i{a}{a}") for a in "xyz")
    return x, y, z


def differences_of(built: AsBuilt) -> str:
    """Differences from the drawing as they are set, separated by commas."""
    values = zip(AsBuilt.__slots__, astuple(built), astuple(AS_DRAWN), strict=True)
    return ", ".join(f"airframe.{name} = {value:g}" for name, value, drawn in values if value != drawn)


def require_flyable(model: "Model", height_m: float = 60.0) -> None:
    """ValueError if `model` as built has no steady flight at its cruise speed, or diverges in pitch there."""
    speed_m_s = model.airframe["cruise"]["airspeed_m_s"]
    named = differences_of(model.built)
    try:
        cruise = trim(model, speed_m_s, height_m)
    except ValueError as problem:
        why = str(problem).partition(f"{height_m:g} m, ")[2] or str(problem)
        raise ValueError(f"{named}: cannot fly at its cruise speed of {speed_m_s:g} m/s, {why}") from None
    margin = static_margin(model, cruise, height_m)
    if not margin > 0.0:
        most = model.built.cg_aft + margin
        raise ValueError(
            f"{named}: diverges in pitch, its static margin is {100.0 * margin:.1f} % of the mean chord; "
            f"airframe.cg_aft must be below {most:.3f}"
        )


def static_margin(model: "Model", t: Trim, height_m: float = 60.0) -> float:
    """Distance from the centre of gravity back to the neutral point, stick fixed, in mean chords, at the trim `t`."""

    def lift_and_moment(alpha_rad: float) -> Array:
        accelerations(model, replace(t, alpha_rad=alpha_rad), height_m)
        (x, _, z), (_, pitch, _) = model.force_and_moment()
        return np.array([x * math.sin(alpha_rad) - z * math.cos(alpha_rad), pitch])

    lift, moment = lift_and_moment(t.alpha_rad + STEP_RAD) - lift_and_moment(t.alpha_rad - STEP_RAD)
    return float(-moment / (lift * model.wing()[2]))


def _change(model: ElementTree.Element, built: AsBuilt) -> None:
    """Write mass, centre of gravity, inertia and warp into the model's file."""
    masses = _found(model, "mass_balance")
    _scale(masses, "emptywt", built.mass_factor)
    roll, pitch, yaw = built.roll_inertia_factor, built.pitch_inertia_factor, built.yaw_inertia_factor
    factors = {"ixx": roll, "iyy": pitch, "izz": yaw, "ixz": math.sqrt(roll * yaw)}
    for name, factor in factors.items():
        _scale(masses, name, built.mass_factor * factor)
    _require_possible(masses, (roll, pitch, yaw))
    aft_m = built.cg_aft * _number(_found(model, "metrics"), "chord")
    places = [_found(masses, "location")]
    places += [_found(force, "location") for force in _found(model, "external_reactions").findall("force")]
    for place in places:  # the hand holds the aeroplane at its centre of gravity
        _found(place, "x").text = repr(_number(place, "x") + aft_m)
    if built.warp_deg:
        roll_axis = next(axis for axis in _found(model, "aerodynamics").findall("axis") if axis.get("name") == "ROLL")
        damping = next(f for f in roll_axis.findall("function") if f.get("name") == "aero/moment/roll-p")
        roll_axis.append(_warp(-0.75 * _at_zero(damping) * math.radians(built.warp_deg)))


def _require_possible(masses: ElementTree.Element, factors: tuple[float, float, float]) -> None:
    """ValueError if one moment of inertia exceeds the sum of the others, which no body has."""
    moments = [_number(masses, f"i{axis}{axis}") for axis in "xyz"]
    for name, factor, moment in zip(("roll", "pitch", "yaw"), factors, moments, strict=True):
        others = math.fsum(moments) - moment
        if moment > others:
            raise ValueError(
                f"airframe.{name}_inertia_factor = {factor:g}: no body has a moment of inertia above the sum of the "
                f"other two; it must be at most {factor * others / moment:.3g} with these"
            )


def _warp(coefficient: float) -> ElementTree.Element:
    """The moment of a twisted wing; it ceases as the wing is turned across the flow."""
    function = ElementTree.Element("function", name="aero/moment/roll-warp")
    factors = ElementTree.SubElement(function, "product")
    for name in ("aero/qbar-psf", "metrics/Sw-sqft", "metrics/bw-ft", "aero/cos-alpha"):
        ElementTree.SubElement(factors, "property").text = name
    ElementTree.SubElement(factors, "value").text = repr(coefficient)
    return function


def _at_zero(damping: ElementTree.Element) -> float:
    """Damping in roll at no angle of attack and no roll rate: the first column of its table."""
    rows = [line.split() for line in (damping.findtext(".//tableData") or "").splitlines() if line.strip()]
    return next(float(row[1]) for row in rows[1:] if float(row[0]) == 0.0)


def _weaken(folder: Path, factor: float) -> None:
    """Scale the thrust coefficient of the propeller."""
    if not (folder / PROPELLER).exists():
        raise ValueError(f"airframe.thrust_factor = {factor:g}: '{folder.name}' has no motor; leave it at 1")

    def scale(thruster: ElementTree.Element) -> None:
        ElementTree.SubElement(thruster, "ct_factor").text = repr(factor)

    _rewrite(folder / PROPELLER, scale)


def _rewrite(path: Path, change: Callable[[ElementTree.Element], None]) -> None:
    tree = ElementTree.parse(path)
    change(tree.getroot())
    tree.write(path)


def _found(parent: ElementTree.Element, name: str) -> ElementTree.Element:
    child = parent.find(name)
    if child is None:
        raise RuntimeError(f"the model's <{parent.tag}> has no <{name}>")
    return child


def _number(parent: ElementTree.Element, name: str) -> float:
    return float(_found(parent, name).text or "")


def _scale(parent: ElementTree.Element, name: str, factor: float) -> None:
    _found(parent, name).text = repr(_number(parent, name) * factor)
