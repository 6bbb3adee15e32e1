"""Videos as the networks read them: latents, Plücker maps, render conditions.

Axes: ``b`` batch, ``f`` frames, ``h w`` pixels, ``c t h2 w2`` latents, ``hc wc`` cells.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.layered_image.build import build_layered_image
from diff4splat.generation.layered_image.pixel_maps.image_maps import ImageMaps
from diff4splat.generation.priors import image_depth
from diff4splat.generation.video.render_condition import encode_condition, render_layered_image
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.rays import plucker_map
from diff4splat.io.pixels import unit_rgb
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.hub.model import Model
from diff4splat.models.motion_unet.motion_field import masked_offsets, upsample_to_pixels
from diff4splat.models.protocols import VideoCodec
from diff4splat.models.video_dit.conditions import RenderCondition
from diff4splat.paths.camera_path import CameraPath
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
def encode_video(vae: VideoCodec, batch: ClipBatch) -> Float[Tensor, "b c t h2 w2"]:
    """Standardised latents of the input video, by the frozen autoencoder."""
    return vae.encode(network_video(batch)).mean


def zero_latents(model: ModelConfig, batch: ClipBatch) -> Float[Tensor, "b c t h2 w2"]:
    """Zeros in the shape of the latents, for stages that run before there is an autoencoder."""
    grid = model.latent_grid(batch.video.shape[1], batch.cameras.size_px)
    return torch.zeros(len(batch), model.vae.latent_channels, *grid, device=batch.video.device)


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstFrame:
    """What a render condition is made from: the first frame, its true motion, and the cameras."""

    rgb: Float[Tensor, "h w 3"]
    """In [0, 1]."""
    field: Float[Tensor, "3 t hc wc"]
    """True relative displacement of every cell (``motion_field``)."""
    moving: Bool[Tensor, "h w"]
    """Pixels that truly move."""
    cameras: Camera
    """Batch shape (f,), relative to the first."""
    motion_known: bool = True
    """Whether ``field`` and ``moving`` are the truth."""


@torch.no_grad()
def render_condition(model: Model, first: FirstFrame) -> RenderCondition | None:
    """The layered image along the path, on predicted depth and with true motion; None without.

    With predicted motion the true video would be no fair target where the prediction is wrong.
    Where the true motion is not known, all but the first frame is a guess: not valid.
    """
    if not model.config.dit.render_condition:
        return None
    image = InputImage(rgb=first.rgb, camera=first.cameras[0], focal_source="clip")
    depth = image_depth(model, image)
    displacement = masked_offsets(upsample_to_pixels(first.field), first.moving, depth)
    maps = ImageMaps(depth=depth, displacement=displacement if displacement.any() else None)
    border_cells = model.config.refinement.border_cells
    layered = build_layered_image(image, image, maps, border_cells)
    times_s = torch.linspace(0, 1, len(first.cameras), device=depth.device)
    path = CameraPath(cameras=first.cameras, times_s=times_s)
    rendered = render_layered_image(layered, path, times_s)
    if not first.motion_known:
        is_first = torch.arange(len(path), device=depth.device) == 0
        rendered = replace(rendered, valid=rendered.valid & is_first[:, None, None])
    return encode_condition(model, rendered)


@torch.no_grad()
def encode_batch(model: Model, batch: ClipBatch) -> LatentBatch:
    """Latents and render conditions of clips, by frozen networks."""
    conditions = [render_condition(model, first_frame(batch, index)) for index in range(len(batch))]
    used = model.config.dit.render_condition
    return LatentBatch(
        sample_index=batch.sample_index,
        source=batch.source,
        latent=encode_video(model.networks.vae, batch),
        render_latent=torch.cat([one.latent for one in conditions]) if used else None,
        validity=torch.cat([one.validity for one in conditions]) if used else None,
        cameras=batch.cameras,
        captions=batch.captions,
    )


def first_frame(batch: ClipBatch, index: int) -> FirstFrame:
    """The first frame of one sample."""
    return FirstFrame(
        rgb=unit_rgb(batch.video[index, 0]),
        field=batch.field[index],
        moving=batch.moving[index],
        cameras=batch.cameras[index],
        motion_known=bool(batch.motion_known[index]),
    )
