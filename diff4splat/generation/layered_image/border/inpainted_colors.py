"""Colours beyond the border of a photograph, by the inpainting network (ours, ADR 50).

Axes: ``h w`` cells of the image, ``hs ws`` cells of a ring's grid. A ring farther out goes on from
the nearer one, so that both show one scene.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.layered_image.inpainting import Inpaint
from diff4splat.generation.layered_image.other_grid import on_grid
from diff4splat.generation.layered_image.types import ImageLayer
from diff4splat.geometry.camera import Camera


def inpaint_colors(
    rgb: Float[Tensor, "h w 3"], camera: Camera, nearer: ImageLayer | None, inpaint: Inpaint
) -> Float[Tensor, "hs ws 3"]:
    """The image in the middle of the grid of ``camera``, completed; ``nearer`` is known too."""
    height, width = camera.size_px
    top, left = (height - rgb.shape[0]) // 2, (width - rgb.shape[1]) // 2
    middle = (slice(top, top + rgb.shape[0]), slice(left, left + rgb.shape[1]))
    colors = rgb.new_zeros(height, width, 3)
    known = torch.zeros(height, width, dtype=torch.bool, device=rgb.device)
    if nearer is not None:
        maps, known = on_grid(nearer.rgb.movedim(-1, 0), nearer.camera, camera)
        colors = maps.movedim(0, -1)
    colors[middle], known[middle] = rgb, True
    return inpaint(colors, known)
