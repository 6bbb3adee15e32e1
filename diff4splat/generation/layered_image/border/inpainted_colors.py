"""Colours beyond the border of a photograph, by the inpainting network (ours, ADR 50).

Axes: ``h w`` cells of the image, ``hs ws`` cells of a ring's grid. A ring farther out goes on from
the nearer one, so that both show one scene.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import grid_sample

from diff4splat.generation.layered_image.inpainting import Inpaint
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
        colors, known = _on_grid(nearer, camera)
    colors[middle], known[middle] = rgb, True
    return inpaint(colors, known)


def _on_grid(
    layer: ImageLayer, camera: Camera
) -> tuple[Float[Tensor, "hs ws 3"], Bool[Tensor, "hs ws"]]:
    """All colours of a layer, and where they are, on the grid of a camera at the same place."""
    axes = [_along(axis, layer.camera, camera) for axis in (0, 1)]
    across, down = torch.meshgrid(*axes, indexing="xy")
    known = (across.abs() < 1) & (down.abs() < 1)
    maps, at = layer.rgb.movedim(-1, 0)[None], torch.stack([across, down], -1)[None]
    colors = grid_sample(maps, at, padding_mode="border", align_corners=False)[0].movedim(0, -1)
    return colors, known


def _along(axis: int, source: Camera, target: Camera) -> Float[Tensor, " n"]:
    """Where cells of ``target`` lie in ``source`` along x or y: from −1 to 1, border to border."""
    count, side = target.size_px[1 - axis], source.size_px[1 - axis]
    cells = torch.arange(count, device=target.focal_px.device, dtype=target.focal_px.dtype) + 0.5
    rays = (cells - target.center_px[axis]) / target.focal_px[axis]
    return 2 * (rays * source.focal_px[axis] + source.center_px[axis]) / side - 1
