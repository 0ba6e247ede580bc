"""What the step of the physics costs, and what the ground does."""

import math

import numpy as np
import pytest

from autopilot.interface import ActuatorCommand
from sim.aeroplane.jsbsim_model import Model
from sim.aeroplane.jsbsim_plant import JsbsimPlant
from sim.air import STILL
from sim.clock import Rates
from sim.log import Log
from sim.plant import InFlight

SECONDS = 8.0
READ = ("velocities/u-fps", "velocities/p-rad_sec", "attitude/theta-rad", "position/h-agl-ft", "forces/fbz-gear-lbs")


def stirred(physics_hz):
    """Position after 8 s of the same smooth stirring of all controls, flown at `physics_hz`."""
    rates = Rates(physics_hz)
    plant = JsbsimPlant(start=InFlight(0.3, height_m=100.0), rates=rates)
    log = Log.empty(rates.ticks(SECONDS))
    plant.reset(log)
    trimmed = plant.trimmed.command
    for k in range(len(log)):
        t = k * rates.dt_s
        stir = 0.10 * math.sin(1.3 * t), 0.05 * math.sin(2.1 * t), 0.10 * math.sin(0.7 * t)
        moved = (c + s for c, s in zip(trimmed[:3], stir, strict=True))
        assert plant.advance(k, ActuatorCommand(*moved, trimmed[3])) is None
    return log.truth["p_e_m"][-1]


def test_halving_the_step_converges_at_first_order():
    """JSBSim is of first order in the step h, so beside 1000 Hz the error goes with h - 1 ms: 9, 4 and 1.5 ms."""
    finest = stirred(1000)
    error_m = [np.linalg.norm(stirred(hz) - finest) for hz in (100, 200, 400)]
    assert error_m[1] < 0.2  # at the 200 Hz that is flown; 0.084 m measured
    # First order gives 2.250 and 2.667; 2.2514 and 2.6676 measured, a hundredth is left for the terms of second order.
    assert error_m[0] / error_m[1] == pytest.approx(9.0 / 4.0, rel=0.01)
    assert error_m[1] / error_m[2] == pytest.approx(4.0 / 1.5, rel=0.01)


@pytest.mark.parametrize("name", ["endurance", "gentle_lady"])
@pytest.mark.parametrize("pitch_deg", [0.0, -20.0, -80.0, 90.0])
def test_ground_met_at_any_attitude_stays_finite(name, pitch_deg):
    """Flown into the ground and left there for 5 s: it may bounce and break, but it remains a number."""
    model = Model(name, 200)
    still = ActuatorCommand(0.0, 0.0, 0.0, 0.0)
    model.place(1.5, (0.4, math.radians(pitch_deg), 0.0), np.array([12.0, 0.0, 0.0]), (0.0,) * 3, still, STILL, 1)
    get = [model.getter(p) for p in READ]
    seen = np.empty((1000, len(READ)))
    for row in seen:
        model.run()
        row[:] = [g() for g in get]
    assert np.isfinite(seen).all()
    if pitch_deg <= 0.0:
        assert np.abs(seen[:, -1]).max() > 0.0  # it did touch
