"""The layered image seen along the path: what the video model is conditioned on (ADR 16, 26).

Axes: ``f`` frames, ``h w`` pixels of the copy that the networks see, ``n`` Gaussians. All layers
are rendered, with the motion of the motion prior. A pixel is valid where the image's own layers
cover it; elsewhere the extended layers show a guess that the video model is to replace.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.generation.layered_image.gaussians import image_gaussians
from diff4splat.generation.layered_image.types import LayeredImage
from diff4splat.models.hub.model import Model
from diff4splat.models.video_dit.render_condition import RenderCondition
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings

MIN_COVERAGE = 0.5
"""Opacity of the image's own layers from which a pixel is valid."""
UNDILATED = RenderSettings(dilation_px2=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderedImage:
    """A layered image along a path."""

    rgb: Float[Tensor, "f h w 3"]
    """In [0, 1]; the first frame is the image itself."""
    valid: Bool[Tensor, "f h w"]
    """Whether the image shows what the pixel sees; all true in the first frame."""
    depth: Float[Tensor, "f h w"]
    """z of the image's own layers; 0 where they cover nothing."""


@torch.no_grad()
def render_layered_image(image: LayeredImage, path: CameraPath) -> RenderedImage:
    """Every camera of ``path`` at its time; the first one took the image."""
    scene = image_gaussians(image, path.times_s)
    first = image.layers[0]
    rgb, valid = [first.rgb.float()], [first.mask]
    depth = [first.depth.float()]
    for index in range(1, len(path)):
        state = scene.motion.state_at(scene.gaussians, float(path.times_s[index]))
        camera = path.cameras[index]
        rgb.append(render(state, camera, settings=UNDILATED).rgb.clamp(0, 1))
        shown = state.select(slice(image.visible_count))
        seen = render(shown, camera, outputs=("alpha", "depth"), settings=UNDILATED)
        valid.append(seen.alpha > MIN_COVERAGE)
        depth.append(seen.depth)
    return RenderedImage(rgb=torch.stack(rgb), valid=torch.stack(valid), depth=torch.stack(depth))


@torch.no_grad()
def encode_condition(model: Model, rendered: RenderedImage) -> RenderCondition:
    """The condition as the video model takes it."""
    video = rendered.rgb.movedim(-1, 0)[None] * 2 - 1
    return RenderCondition(
        latent=model.networks.vae.encode(video).mean, validity=rendered.valid[None, None].to(video)
    )
