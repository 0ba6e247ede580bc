"""Masses and figures of the sailplane, the source of its JSBSim model.

    python -m sim.aircraft.gentle_lady.build

The outline is in airframe.toml; PROVENANCE.md gives the source of each figure.
"""

from pathlib import Path

from sim.aircraft.design import builder
from sim.aircraft.design.design import Design
from sim.aircraft.design.lattice import Sections
from sim.aircraft.design.masses import Box, Spread

DESIGN = Design(
    folder=Path(__file__).parent,
    about="Two-metre polyhedral sailplane, see PROVENANCE.md",
    sections=Sections(wing="clarky", tail="naca0006", tail_incidence_deg=0.0, wing_incidence_deg=3.0),
    parts=(
        Spread("spars and edges", 0.120, power=0.0, part=0.35),
        Spread("ribs, sheeting and covering", 0.150, power=2.0, part=0.45),
        Box("fuselage", 0.164, (-0.12, 0.0, 0.033), (0.90, 0.05, 0.07)),
        Box("tailplane", 0.028, (-0.62, 0.0, 0.010), (0.115, 0.60, 0.006)),
        Box("fin and rudder", 0.018, (-0.63, 0.0, -0.080), (0.165, 0.006, 0.20)),
        Box("servos", 0.036, (0.09, 0.0, 0.046), (0.04, 0.03, 0.03)),
        Box("receiver", 0.018, (0.16, 0.0, 0.046), (0.05, 0.03, 0.02)),
        Box("battery", 0.090, (0.235, 0.0, 0.046), (0.06, 0.03, 0.03)),
        Box("nose lead", 0.086, (0.285, 0.0, 0.050), (0.03, 0.03, 0.03)),
    ),
    cruise_m_s=6.3,
    cruise_rad=0.035,
    stall_m_s=5.0,
    cd_extra=0.006,
    cd_lift=0.017,
)


def render() -> dict[str, str]:
    """The files of the model, {name: text}."""
    return builder.render(DESIGN)


if __name__ == "__main__":
    builder.write(DESIGN)
