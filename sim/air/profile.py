"""The mean wind over height: the power law of wind engineering.

    W(h) = W(10 m) (h / 10 m)^shear

The exponent is about 0.14 over open country ("one-seventh power law"), nearer 0.1 over water, and 0.2 to 0.3 over
suburbs and woods.  With 0 the wind is the same at every height.
"""

from typing import Final

from estimator.compiler.jit import kernel

REFERENCE_HEIGHT_M: Final = 10.0  # of weather stations


@kernel
def share_of_wind(height_m, shear):  # type: ignore[no-untyped-def]
    """Wind at `height_m` above the ground over that at the reference height; negative heights count as 0."""
    return (max(height_m, 0.0) / REFERENCE_HEIGHT_M) ** shear
