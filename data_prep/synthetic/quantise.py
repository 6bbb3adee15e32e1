"""Quantisation of the numbers of a world.

Sines and matrix products differ in their last bits between processors. The grids here are coarser
than these differences and finer than anything visible, so worlds are equal on every machine.
"""

import numpy as np
from jaxtyping import Float64

LENGTH_BITS = 14
"""Positions and texture coordinates: 0.06 mm."""
POSE_BITS = 30
"""Rotations stay orthonormal to 1e-9."""
LENS_BITS = 20
COLOR_BITS = 12


def quantise(
    values: Float64[np.ndarray, "*shape"], bits: int = LENGTH_BITS
) -> Float64[np.ndarray, "*shape"]:
    """The nearest multiples of 2^-bits; never a negative zero."""
    return np.round(values * 2.0**bits) * 2.0**-bits + 0.0


def quantise_number(value: float, bits: int = COLOR_BITS) -> float:
    """The nearest multiple of 2^-bits."""
    return round(value * 2.0**bits) * 2.0**-bits + 0.0
