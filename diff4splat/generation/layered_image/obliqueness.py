"""Cells of extended layers that a very wide lens would smear over the image.

Axes: ``h w`` cells of a layer. A Gaussian whose ray is oblique by the angle a has a
footprint that is 1 / cos a times as long as that of one on the axis. The layers keep their cells
behind what a footprint of ordinary length covers; a longer one would hide the image.
"""

from jaxtyping import Bool
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.geometry.rays import camera_rays

MAX_STRETCH = 2.5
"""66 degrees off the axis. No cell of a lens of up to 90 degrees with a border is further out."""


def is_drawable(camera: Camera) -> Bool[Tensor, "h w"]:
    """Whether a cell's footprint is at most ``MAX_STRETCH`` times as long as on the axis."""
    return camera_rays(camera).norm(dim=-1) <= MAX_STRETCH
