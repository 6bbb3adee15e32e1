"""The layered image seen along the path: what the video model is conditioned on (ADR 16, 26).

Axes: ``f`` frames, ``h w`` pixels of the copy that the networks see, ``k`` key times. All layers
are rendered, with the motion of the motion prior. A pixel is valid where the image's own layers
cover it; elsewhere the extended layers show a guess that the video model is to replace.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.generation.layered_image.gaussians import image_gaussians
from diff4splat.generation.layered_image.types import LayeredImage
from diff4splat.geometry.camera import Camera
from diff4splat.models.hub.model import Model
from diff4splat.models.video_dit.conditions import RenderCondition
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.api import UNDILATED, render
from diff4splat.scene.gaussians import Gaussians

MIN_COVERAGE = 0.5
"""Opacity of the image's own layers from which a pixel is valid."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderedImage:
    """A layered image along a path."""

    rgb: Float[Tensor, "f h w 3"]
    """In [0, 1]; the first frame is the image itself."""
    valid: Bool[Tensor, "f h w"]
    """Whether the image shows what the pixel sees; all true in the first frame."""
    depth: Float[Tensor, "f h w"]
    """z of the image's own layers; 0 where they cover nothing."""
    surface_depth: Float[Tensor, "f h w"]
    """z of all layers."""


@torch.no_grad()
def render_layered_image(
    image: LayeredImage, path: CameraPath, key_times_s: Float[Tensor, " k"]
) -> RenderedImage:
    """Every camera of ``path`` at its time; the first one took the image.

    ``key_times_s`` are evenly spread over the time in which the image's layers move.
    """
    scene, first = image_gaussians(image, key_times_s), image.layers[0]
    depth = first.depth.float()
    frames = [(first.rgb.float(), first.mask, depth, depth)]
    for index in range(1, len(path)):
        state = scene.motion.state_at(scene.gaussians, float(path.times_s[index]))
        frames.append(_frame(state, image.visible_count, path.cameras[index]))
    rgb, valid, depth, surface_depth = (torch.stack(maps) for maps in zip(*frames, strict=True))
    return RenderedImage(rgb=rgb, valid=valid, depth=depth, surface_depth=surface_depth)


def _frame(
    state: Gaussians, visible_count: int, camera: Camera
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Colour, validity, depth of what the image shows, and depth of all layers."""
    every = render(state, camera, outputs=("rgb", "depth"), settings=UNDILATED)
    shown = state.select(slice(visible_count))
    own = render(shown, camera, outputs=("alpha", "depth"), settings=UNDILATED)
    return every.rgb.clamp(0, 1), own.alpha > MIN_COVERAGE, own.depth, every.depth


@torch.no_grad()
def encode_condition(model: Model, rendered: RenderedImage) -> RenderCondition:
    """The condition as the video model takes it."""
    video = rendered.rgb.movedim(-1, 0)[None] * 2 - 1
    return RenderCondition(
        latent=model.networks.vae.encode(video).mean, validity=rendered.valid[None, None].to(video)
    )
