"""What lies behind and around the first picture: a coarse second layer of Gaussians.

Axes: ``hs ws`` cells of 4 pixels, with a margin on every side. Its base continues the first
picture's border outwards, somewhat behind the surface that the picture shows: where the camera
looks past its borders or behind an edge, it sees a plausible blur instead of black. The layer never
moves.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry.camera import Camera, stack_cameras
from diff4splat.models.blocks.conv_block import CELL_PX
from diff4splat.models.ldrm.gaussian_head import PixelBase
from diff4splat.models.ldrm.refinement.heads import replicate_border

BEHIND = 1.1
"""Ray distance over that of the surface in front."""
OPAQUE = 0.99


def border_extension(
    rgb: Float[Tensor, "h w 3"], distance: Float[Tensor, "h w"], camera: Camera, margin: int
) -> PixelBase:
    """Base of the layer from the first picture, its ray distances and its camera."""
    height, width = (side // CELL_PX for side in camera.size_px)
    grid = camera.resized((height, width))
    grid = grid.cropped((-margin, -margin), (height + 2 * margin, width + 2 * margin))
    maps = torch.cat([rgb.movedim(-1, 0), distance[None]])[None]
    around = replicate_border(torch.nn.functional.avg_pool2d(maps, CELL_PX), margin)[0]
    return PixelBase(
        rgb=around[:3].movedim(0, -1)[None],
        distance=BEHIND * around[3][None],
        opacity=torch.full_like(around[3], OPAQUE)[None],
        cameras=stack_cameras([grid]),
    )
