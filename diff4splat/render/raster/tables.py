"""The arrays that pass from kernel to kernel.

Axes: ``n`` Gaussians, ``c`` channels, ``p`` pairs (tile, Gaussian), ``k`` tiles. A footprint is
kept as one cache line of float64: positions thousands of pixels from a tile would lose the fraction
of a pixel in float32. With (dx, dy) a pixel minus the centre, the opacity there is 2 to the

    log2_opacity - u² - v²,   u = whiten_x dx,   v = whiten_y dy - shear dx
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]
Integers = NDArray[np.int32]

CENTER_X, CENTER_Y, WHITEN_X, SHEAR, WHITEN_Y, LOG2_OPACITY, EXTENT_X, EXTENT_Y = range(8)
"""Columns of a footprint; the extents are half the size, in pixels, of the box around it."""
MOMENTS = 6
"""Sums over pixels of ∂/∂ln α times (1, u, u², v, u v, v²): what the gradients of the first six
columns of a footprint are made of. Unlike dx, u stays small however far the centre is."""


class Cloud(NamedTuple):
    """Gaussians as they came."""

    means: Floats
    quats: Floats
    scales: Floats
    opacities: Floats


class View(NamedTuple):
    """A camera, in float64."""

    rotation: tuple[tuple[float, ...], ...]
    """Rows of world from camera. Tuples, because arrays inside kernels are counted references."""
    position: tuple[float, ...]
    focal_x: float
    focal_y: float
    center_x: float
    center_y: float
    limits_x: tuple[float, float]
    """Between which tangents of the viewing angle the linearisation follows a mean."""
    limits_y: tuple[float, float]
    width: float
    height: float


class Rules(NamedTuple):
    """What of `RenderSettings` the kernels need."""

    dilation_px2: float
    antialias: bool
    log2_cutoff: float
    alpha_max: float
    light_cutoff: float
    near_depth: float


class ProjectionInputs(NamedTuple):
    """What footprints are made from."""

    cloud: Cloud
    sh: Floats
    """One row per Gaussian."""
    view: View
    rules: Rules


class ProjectionOutputs(NamedTuple):
    """What projection fills."""

    prints: Doubles
    depth: Floats
    visible: Integers
    """Index of every Gaussian with a footprint."""
    unusable: NDArray[np.int64]
    """Gaussians left out, by the first parameter that cannot be used."""


class Grid(NamedTuple):
    """Square tiles over an image whose rows are padded to whole tiles."""

    edge: int
    """Pixels along a tile, 2 to the ``shift``, at least 8."""
    shift: int
    columns: int
    rows: int
    width: int
    height: int


class Lists(NamedTuple):
    """The Gaussians of every tile, nearest first."""

    starts: NDArray[np.int64]
    """k + 1 positions in ``members``."""
    members: Integers
    slots: Integers
    """Where the gradient of a pair goes: pairs of one Gaussian are neighbours there."""
