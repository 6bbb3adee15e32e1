"""Latents of a video, its first picture and its cameras to canonical Gaussians.

Axes: ``c t h w`` latents, ``f`` video frames. Both ways to a scene end here: from a generated
video and from a true one.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.input_image import InputImage
from diff4splat.generation.reconstruction import (
    Canonical,
    prune_cells,
    reconstruct,
    reconstruct_detailed,
)
from diff4splat.geometry.camera import Camera, stack_cameras
from diff4splat.geometry.rays import plucker_map, relative_to_first
from diff4splat.models.hub.pretrained import Model
from diff4splat.models.ldrm.plane_prior import plane_base
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.progress.run_log import RunLog


@dataclass(frozen=True, slots=True, kw_only=True)
class VideoLatent:
    """A video as networks hand it on."""

    latent: Float[Tensor, "1 c t h w"]
    """Standardised."""
    picture: InputImage
    """Its first frame, unharmed by any coding."""
    cameras: Camera
    """Batch shape (f,), of the picture's size."""


def canonical_scene(model: Model, video: VideoLatent, min_opacity: float, log: RunLog) -> Canonical:
    """Gaussians at rest; those below ``min_opacity`` are dropped."""
    rays = plucker_map(relative_to_first(video.cameras)).movedim(0, 1)[None]
    config, ldrm = model.config, model.networks.ldrm
    if config.detail.used:
        sight = decode_posed_video(model, video)
        maps = ldrm(video.latent, rays, sight)
        whole = reconstruct_detailed(maps, sight, config.activation, log)
    else:
        why = "the scene is decoded from latents"
        log.record_skipped("video decoder", why, "decoding every frame")
        base = plane_base(
            video.picture.rgb, video.picture.camera, video.cameras, config.ldrm.grid_stride
        )
        whole = reconstruct(ldrm(video.latent, rays), base, config.activation)
    return prune_cells(whole, min_opacity, log)


def decode_posed_video(model: Model, video: VideoLatent) -> PosedVideo:
    """The decoded video behind the true first picture."""
    decoded = (model.networks.vae.decode(video.latent).float() + 1) / 2
    first = video.picture.rgb.movedim(-1, 0)[None, :, None].to(decoded)
    rgb = torch.cat([first, decoded[:, :, 1:].clamp(0, 1)], 2)
    return PosedVideo(rgb=rgb, cameras=stack_cameras([video.cameras]))
