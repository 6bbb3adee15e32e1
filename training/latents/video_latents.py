"""Videos as the networks read them: latents, Plücker maps, render conditions, motion channels.

Axes: ``b`` batch, ``f`` frames, ``h w`` pixels, ``c t h2 w2`` latents.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.input_image import InputImage
from diff4splat.generation.render_condition import render_condition_latent
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.rays import plucker_map
from diff4splat.io.pixels import unit_rgb
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.hub.pretrained import Model
from diff4splat.models.motion_unet.motion_field import append_zero_motion, pack_motion
from diff4splat.models.video_vae.vae import VideoVae
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.latents.latent_batch import LatentBatch


def network_video(batch: ClipBatch) -> Float[Tensor, "b 3 f h w"]:
    """The input video as networks read it: channels first, in [−1, 1]."""
    return batch.video.movedim(-1, 1).float() / 127.5 - 1


def image_video(video: Float[Tensor, "b 3 f h w"]) -> Float[Tensor, "b f h w 3"]:
    """A network's video as images, channels last; about 0 to 1."""
    return (video.movedim(1, -1).float() + 1) / 2


def camera_rays(cameras: Camera) -> Float[Tensor, "b 6 f h w"]:
    """Plücker maps of cameras of batch shape (b, f), relative to the first of each sample."""
    # Products of rotations must not follow the networks into half precision.
    with torch.autocast(cameras.focal_px.device.type, enabled=False):
        return plucker_map(cameras).movedim(1, 2)


@torch.no_grad()
def encode_video(vae: VideoVae, batch: ClipBatch) -> Float[Tensor, "b c t h2 w2"]:
    """Standardised latents of the input video, by the frozen autoencoder."""
    return vae.encode(network_video(batch)).mean


def zero_latents(model: ModelConfig, batch: ClipBatch) -> Float[Tensor, "b c t h2 w2"]:
    """Zeros in the shape of the latents, for stages that run before there is an autoencoder."""
    grid = model.latent_grid(batch.video.shape[1], batch.cameras.size_px)
    return torch.zeros(len(batch), model.vae.latent_channels, *grid, device=batch.video.device)


def packed_motion(
    model: ModelConfig, motion: Float[Tensor, "b 3 t hc wc"]
) -> Float[Tensor, "b m t h2 w2"]:
    """True motion as channels beside the latent; none for a model without motion channels."""
    return pack_motion(motion, model.vae.space_stride)[:, : model.motion_channels]


def without_motion_channels(
    model: ModelConfig, latent: Float[Tensor, "b c t h2 w2"]
) -> Float[Tensor, "b d t h2 w2"]:
    """The latent channels alone."""
    return latent[:, : model.vae.latent_channels]


def with_zero_motion(
    model: ModelConfig, condition: Float[Tensor, "b d t h2 w2"] | None
) -> Float[Tensor, "b c t h2 w2"] | None:
    """A render condition with the channels that the video model reads."""
    return None if condition is None else append_zero_motion(condition, model.motion_channels)


def render_condition(
    model: Model, rgb: Float[Tensor, "h w 3"], cameras: Camera
) -> Float[Tensor, "1 c t h2 w2"] | None:
    """Latent of the render condition of one clip; None for a model without.

    ``rgb`` is the first frame, in [0, 1]; ``cameras`` (f,) are relative to the first.
    """
    if not model.config.dit.draft:
        return None
    image = InputImage(rgb=rgb, camera=cameras[0], focal_source="clip")
    return render_condition_latent(model, image, cameras)


@torch.no_grad()
def encode_batch(model: Model, batch: ClipBatch) -> LatentBatch:
    """Latents, render conditions and motion channels of clips, by frozen networks."""
    firsts = [unit_rgb(batch.video[index, 0]) for index in range(len(batch))]
    conditions = [
        render_condition(model, rgb, batch.cameras[index]) for index, rgb in enumerate(firsts)
    ]
    return LatentBatch(
        sample_index=batch.sample_index,
        source=batch.source,
        latent=encode_video(model.networks.vae, batch),
        render_condition=torch.cat(conditions) if model.config.dit.draft else None,
        motion=packed_motion(model.config, batch.motion),
        cameras=batch.cameras,
        captions=batch.captions,
    )
