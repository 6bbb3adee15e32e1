"""A draft of the video: the reconstruction's guess from one picture, seen along the path (ours).

Axes: ``c t h w`` latents, ``f hh ww`` video frames and pixels. Depth that one picture lets guess
already says where most of it will be seen; the video model corrects what that gets wrong, fills in
what was hidden and moves what the text says (rendered conditions as in ViewCrafter, arXiv
2409.02048; docs/adr/0016). The draft stands still.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.input_image import InputImage
from diff4splat.generation.latents_to_gaussians import VideoLatent, canonical_scene
from diff4splat.geometry.camera import Camera
from diff4splat.models.hub.pretrained import Model
from diff4splat.progress.run_log import RunLog
from diff4splat.render.api import render
from diff4splat.scene.gaussians import Gaussians

FAINTEST = 0.0
"""Nothing is pruned: fresh heads leave later frames below any threshold."""


@torch.no_grad()
def render_condition_latent(
    model: Model, picture: InputImage, cameras: Camera
) -> Float[Tensor, "1 c t h w"]:
    """Standardised latent of the draft; ``cameras`` (f,) are the path's, relative to the first."""
    return model.networks.vae.encode(render_condition_video(model, picture, cameras) * 2 - 1).mean


@torch.no_grad()
def render_condition_video(
    model: Model, picture: InputImage, cameras: Camera
) -> Float[Tensor, "1 3 f hh ww"]:
    """RGB in [0, 1]; the first frame is the picture itself."""
    first = picture.rgb.movedim(-1, 0)[None, :, None].float()
    if len(cameras) == 1:
        return first
    gaussians = input_gaussians(model, picture, cameras[:1])
    later = render(gaussians, cameras[1:], outputs=("rgb",)).rgb
    return torch.cat([first, later.movedim(-1, 0)[None].clamp(0, 1)], 2)


def input_gaussians(model: Model, picture: InputImage, cameras: Camera) -> Gaussians:
    """What the reconstruction sees in a video of one frame."""
    image = picture.rgb.movedim(-1, 0)[None, :, None].float() * 2 - 1
    latent = model.networks.vae.encode(image).mean
    video = VideoLatent(latent=latent, picture=picture, cameras=cameras)
    return canonical_scene(model, video, FAINTEST, RunLog()).gaussians
