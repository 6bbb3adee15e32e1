"""The arrays that pass from kernel to kernel.

Axes: ``n`` Gaussians, ``m`` of them that are visible at all, ``g`` groups of sixteen of these,
``r`` rays. Shapes and places are float64, because a needle's whitening needs it; what lanes read is
float32 relative to the tree's anchor or to the frame of a packet.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]
Integers = NDArray[np.int32]

MEAN, WHITEN, SCALES, LEVEL, VELOCITY, CENTER, INV_TIME_SIGMA = 0, 3, 12, 15, 16, 19, 20
"""Columns of a primitive: mean (3), W row by row (9), scales (3), log2 of the opacity; of one that
moves also velocity (3), centre and inverse deviation of the pulse."""
STATIC_COLUMNS, MOVING_COLUMNS = 16, 24

LEAF_MEAN, LEAF_AXES, LEAF_SLACK, LEAF_VELOCITY = 0, 3, 12, 13
"""Rows of a group: means at the anchor's time (3), reach · S Rᵀ row by row (9), what rounding may
move them by, velocities (3)."""
STATIC_ROWS, MOVING_ROWS = 13, 16
NODE_ROWS = 6
"""Lower corners (3) and upper corners (3) of sixteen children."""


class Cloud(NamedTuple):
    """Gaussians as they came."""

    means: Floats
    quats: Floats
    scales: Floats
    opacities: Floats


class MotionArrays(NamedTuple):
    """What moves them; empty arrays where nothing does."""

    velocities: Floats
    centers: Floats
    deviations: Floats


class TraceRules(NamedTuple):
    """What of `TraceSettings` the kernels need."""

    log2_cutoff: float
    alpha_max: float
    dark: float
    near: float
    least_drop: float
    """How far the logarithm of the response may fall at most; infinity is any."""
    squared_limit: float
    """The same as D²."""
    squared_gate: float
    """The same for the pulse: ((t - centre) / deviation)²."""
    quartic: bool
    toward_mean: bool


class RayBundle(NamedTuple):
    """Rays, and the packets that they are traced in."""

    origins: Floats
    directions: Floats
    times: Floats
    """Empty where nothing moves."""
    order: Integers
    starts: NDArray[np.int64]
    """Where packets begin in ``order``, and one more: the number of rays."""


class Tree(NamedTuple):
    """Sixteen children per node, level by level from the groups of primitives to the root."""

    order: Integers
    """Primitives, sixteen neighbours to a group."""
    nodes: Floats
    """Nodes × 6 × 16: the boxes of the children, relative to the anchor."""
    levels: NDArray[np.int64]
    """Where each level's nodes begin, and one more: the number of nodes."""
    anchor: tuple[float, float, float]


class TraceScene(NamedTuple):
    """Gaussians and their hierarchy."""

    primitives: Doubles
    """n × 16, or 24 if they move."""
    tree: Tree
    leaves: Floats
    """g × 13 × 16, or 16 rows if they move."""
    moment: float
    """The time of the means in ``leaves``."""
    colors: Floats
    """n × 4 without harmonics, else n × 3 × 16 coefficients of a channel side by side."""


class TraceInputs(NamedTuple):
    """One bundle of rays in one scene: all that packets are traced with."""

    scene: TraceScene
    rays: RayBundle
    rules: TraceRules
    bands: int
    """Harmonics per channel."""
    most_hits: int
    """Hits that one packet may keep at once."""
