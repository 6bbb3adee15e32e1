"""Baselines of classical inpainting: the image's own layers, and OpenCV where they show nothing.

Telea: fast marching (2004). Navier-Stokes: fluid dynamics (Bertalmio et al. 2001). Both continue
colours from the rim of the hole, in every target image apart, and so have no depth there.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.evaluation.systems.baselines import NoScene
from diff4splat.evaluation.systems.predictions import RenderedView
from diff4splat.generation.video.render_condition import MIN_COVERAGE
from diff4splat.geometry.camera import Camera
from diff4splat.io.pixels import to_bytes, unit_rgb
from diff4splat.render.api import render
from diff4splat.scene.scene import Scene

METHODS = {
    "inpainting (Telea)": cv2.INPAINT_TELEA,
    "inpainting (Navier-Stokes)": cv2.INPAINT_NS,
}
"""Rows of the table, and OpenCV's numbers of the methods."""
RADIUS_PX = 3.0
"""Neighbourhood of a pixel that decides about it."""


@dataclass(frozen=True)
class InpaintedViews(NoScene):
    """Renders of a scene that shows only what the image shows, with their holes filled."""

    visible_scene: Scene
    method: int

    def render(self, camera: Camera, time_s: float, frame: int) -> RenderedView:
        """The render; inpainted where less than half of a pixel is covered."""
        del frame
        rendered = render(self.visible_scene, camera, time_s, outputs=("rgb", "alpha"))
        covered = rendered.alpha > MIN_COVERAGE
        rgb = rendered.rgb / rendered.alpha.clamp_min(MIN_COVERAGE)[..., None]
        return RenderedView(rgb=inpainted(rgb.clamp(0, 1), ~covered, self.method), depth=None)


def inpainted(
    rgb: Float[Tensor, "h w 3"], hole: Bool[Tensor, "h w"], method: int
) -> Float[Tensor, "h w 3"]:
    """The image with ``hole`` filled; grey if it is all hole. Pixels outside keep their values."""
    if bool(hole.all()):
        return torch.full_like(rgb, 0.5)
    image = np.ascontiguousarray(to_bytes(rgb))
    filled = cv2.inpaint(image, hole.numpy().astype(np.uint8), RADIUS_PX, method)
    return torch.where(hole[..., None], unit_rgb(torch.from_numpy(filled)), rgb)
