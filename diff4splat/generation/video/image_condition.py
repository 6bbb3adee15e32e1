"""The image as image-to-video weights take it: as channels beside the noisy ones, and as states.

Axes: ``c`` latent channels, ``h w`` pixels, ``t h2 w2`` latents.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.cogvideox.token_frames import repeat_first_frame
from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.models.hub.model import Model
from diff4splat.models.video_dit.conditions import ImageCondition


def image_condition(
    model: Model,
    image: Float[Tensor, "1 3 1 h w"],
    latent: Float[Tensor, "1 c 1 h2 w2"],
    frames: int,
) -> ImageCondition | None:
    """For a video of ``frames``; None for a model whose first latent frame is the image's.

    ``image`` is in [−1, 1], and ``latent`` belongs to it.
    """
    if not model.config.dit.condition_channels:
        return None
    if model.config.joint.used:
        channels = _followed_by_zeros(model, latent, frames)
    else:
        channels = _followed_by_grey(model, image, frames)
    encoder = model.networks.image_encoder
    states = None if encoder is None else encoder.encode_image((image[:, :, 0] + 1) / 2)
    return ImageCondition(channels=channels, states=states)


def _followed_by_zeros(
    model: Model, latent: Float[Tensor, "1 c 1 h2 w2"], frames: int
) -> Float[Tensor, "1 c t h2 w2"]:
    """CogVideoX: the latent, then zeros; 1.5-I2V learned latents divided by their scale."""
    joint = model.config.joint
    if joint.inverse_image_scale:
        latent = latent * model.networks.vae.latent_std.square().view(1, -1, 1, 1, 1)
    empty = torch.zeros_like(latent).expand(-1, -1, (frames - 1) // TIME_STRIDE, -1, -1)
    return repeat_first_frame(torch.cat([latent, empty], 2), joint.patch_frames)


def _followed_by_grey(
    model: Model, image: Float[Tensor, "1 3 1 h w"], frames: int
) -> Float[Tensor, "1 c t h2 w2"]:
    """Wan: which frames are known, then the latent of the image followed by grey frames."""
    grey = torch.zeros_like(image).expand(-1, -1, frames - 1, -1, -1)
    latent = model.networks.vae.encode(torch.cat([image, grey], 2)).mean
    known = torch.zeros_like(latent[:, :1]).expand(-1, TIME_STRIDE, -1, -1, -1).clone()
    known[:, :, 0] = 1
    return torch.cat([known, latent], 1)
