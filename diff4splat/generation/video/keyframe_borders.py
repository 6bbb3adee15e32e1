"""Fine borders of a video's key frames: what lies just out of all frames.

Axes: ``k`` key frames, ``h w`` pixels, ``hs ws`` cells of a border. LDRM's border layer has cells
of 4 pixels around the first frame alone. Before it lie cells as fine as pixels, beside the border
of every key frame (ADR 30). Those that another key frame sees are left out, and those where an
earlier key frame has a border too.
"""

from collections.abc import Iterator
from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.generation.layered_image.border.fine_border import fine_border
from diff4splat.generation.layered_image.pixel_maps.pixel_layer import PIXEL_FOOTPRINT_PX
from diff4splat.generation.layered_image.types import ImageLayer
from diff4splat.geometry.camera import Camera, stack_cameras
from diff4splat.models.ldrm.plane_prior import OPAQUE
from diff4splat.models.ldrm.refinement.warping import inside, other_pixels


@torch.no_grad()
def keyframe_borders(
    rgb: Float[Tensor, "k h w 3"], depth: Float[Tensor, "k h w"], cameras: Camera
) -> Iterator[ImageLayer]:
    """A static layer around every key frame; ``cameras`` has batch shape (k,)."""
    bordered: list[Camera] = []
    for key in range(len(rgb)):
        pixels = ImageLayer(
            camera=cameras[key],
            rgb=rgb[key],
            depth=depth[key],
            mask=torch.ones_like(depth[key], dtype=torch.bool),
            opacity=OPAQUE,
            footprint_px=PIXEL_FOOTPRINT_PX,
        )
        border = fine_border(pixels, None)
        mask, others = border.mask, [cameras[other] for other in range(len(rgb)) if other != key]
        for camera in (*others, *bordered):
            mask = mask & ~_sees(camera, border)
        bordered.append(border.camera)
        yield replace(border, mask=mask)


def _sees(camera: Camera, layer: ImageLayer) -> Bool[Tensor, "hs ws"]:
    """Cells that project into a camera's image."""
    own, other = (stack_cameras([one]) for one in (layer.camera, camera))
    pixels, relative = other_pixels(own, other, 1 / layer.depth[None, None])
    return inside(pixels, relative)[0, 0]
