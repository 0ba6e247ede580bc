"""The mean wind with height: the power law of wind engineering.

    W(h) = W(10 m) (h / 10 m)^shear

Over open country the exponent is about 0.14, the "one-seventh power"; over water it is nearer to 0.1, over suburbs and
woods 0.2 to 0.3.  An exponent of 0 is the same wind at every height.
"""

from typing import Final

from estimator.compiler.jit import kernel

REFERENCE_HEIGHT_M: Final = 10.0  # at which weather stations measure


@kernel
def share_of_wind(height_m, shear):  # type: ignore[no-untyped-def]
    """Wind at `height_m` above the ground over that at the reference height; below the ground as on it."""
    return (max(height_m, 0.0) / REFERENCE_HEIGHT_M) ** shear
