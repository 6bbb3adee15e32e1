"""Grids on which a world's numbers lie.

Sines and matrix products differ in their last bits from processor to processor. Rounding to a grid
that is coarse beside such differences, and fine beside anything visible, makes them equal.
"""

import numpy as np
from jaxtyping import Float64

LENGTH_BITS = 14
"""Positions and texture coordinates: 0.06 mm."""
POSE_BITS = 30
"""Rotations stay orthonormal to 1e-9."""
LENS_BITS = 20
COLOR_BITS = 12


def to_grid(
    values: Float64[np.ndarray, "*shape"], bits: int = LENGTH_BITS
) -> Float64[np.ndarray, "*shape"]:
    """The nearest multiples of 2^-bits; never a negative zero."""
    return np.round(values * 2.0**bits) * 2.0**-bits + 0.0


def number_on_grid(value: float, bits: int = COLOR_BITS) -> float:
    """The nearest multiple of 2^-bits."""
    return round(value * 2.0**bits) * 2.0**-bits + 0.0
