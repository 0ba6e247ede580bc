"""The air: mean wind with shear, gusts, turbulence and thermals.

``profile``  mean wind over height            ``gust``     discrete 1-cosine gusts
``dryden``   turbulence                       ``thermal``  updrafts and the sink between them
``air``      their sum, once per tick

Heights are above the ground, which is flat and at the height of the launch point.
"""

from sim.air.air import STILL, Air, MovingAir
from sim.air.gust import Gust
from sim.air.thermal import Thermals

__all__ = ["STILL", "Air", "Gust", "MovingAir", "Thermals"]
