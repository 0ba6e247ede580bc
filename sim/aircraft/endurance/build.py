"""Masses and figures of the aeroplane, the source of its JSBSim model.

    python -m sim.aircraft.endurance.build

The outline is in airframe.toml; PROVENANCE.md gives the source of each figure.
"""

from pathlib import Path

from sim.aircraft.design import builder
from sim.aircraft.design.design import Design, Drive
from sim.aircraft.design.lattice import Sections
from sim.aircraft.design.masses import Box, Spread

DESIGN = Design(
    folder=Path(__file__).parent,
    about="Electric model aeroplane, see PROVENANCE.md",
    sections=Sections(wing="clarky", tail="naca0006", tail_incidence_deg=-0.42, wing_incidence_deg=1.3),
    parts=(
        Spread("spars and edges", 0.130, power=0.0, part=0.35),
        Spread("ribs, sheeting and covering", 0.150, power=2.0, part=0.45),
        Box("aileron servos", 0.020, (0.0, 0.0, -0.070), (0.02, 0.90, 0.02)),
        Box("fuselage", 0.300, (-0.12, 0.0, 0.012), (1.05, 0.07, 0.09)),
        Box("tailplane", 0.040, (-0.67, 0.0, -0.020), (0.13, 0.52, 0.006)),
        Box("fin and rudder", 0.025, (-0.67, 0.0, -0.100), (0.15, 0.006, 0.20)),
        Box("motor and propeller", 0.150, (0.370, 0.0, 0.0), (0.06, 0.03, 0.03)),
        Box("speed controller", 0.040, (0.270, 0.0, 0.020), (0.06, 0.03, 0.01)),
        Box("battery", 0.310, (0.073, 0.0, 0.039), (0.11, 0.035, 0.035)),
        Box("skid and hatch", 0.060, (0.100, 0.0, 0.070), (0.30, 0.03, 0.01)),
        Box("servos and receiver", 0.175, (-0.060, 0.0, 0.030), (0.15, 0.05, 0.04)),
    ),
    cruise_m_s=12.6,
    cruise_rad=0.016,
    stall_m_s=7.0,
    cd_extra=0.020,
    cd_lift=0.010,
    drive=Drive(
        volts=11.1,
        kv=850.0,
        ohm=0.14,
        no_load_a=0.8,
        rotor_kg_m2=1.0e-4,
        # Above J = 0.8 the propeller windmills.
        propeller=(
            (0.0, 0.110, 0.0520), (0.1, 0.107, 0.0530), (0.2, 0.102, 0.0540), (0.3, 0.094, 0.0530),
            (0.4, 0.082, 0.0505), (0.5, 0.066, 0.0455), (0.6, 0.047, 0.0375), (0.7, 0.025, 0.0255),
            (0.8, 0.002, 0.0120), (0.9, -0.022, -0.0030), (1.0, -0.045, -0.0160), (1.4, -0.110, -0.0450),
            (2.0, -0.190, -0.0750), (5.0, -0.800, -0.2600),
        ),
        folding=False,
        stopped_area_m2=0.0045,
        tail_in_wash=0.4,
        fin_in_wash=0.5,
        roll_rig=0.0009188,
    ),
)  # fmt: skip


def render() -> dict[str, str]:
    """The files of the model, {name: text}."""
    return builder.render(DESIGN)


if __name__ == "__main__":
    builder.write(DESIGN)
