"""A video's latent, its first frame and its cameras through LDRM.

Axes: ``c t h2 w2`` latents, ``f h w`` video frames. A generated video and a true one take this way.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.video.canonical_scene import (
    CanonicalScene,
    reconstruct,
    reconstruct_refined,
)
from diff4splat.geometry.camera import Camera, stack_cameras
from diff4splat.geometry.rays import plucker_map, relative_to_first
from diff4splat.models.hub.model import Model
from diff4splat.models.ldrm.gaussian_head import PixelBase
from diff4splat.models.ldrm.plane_prior import plane_base
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.models.ldrm.refinement.start_distance import with_start_distance
from diff4splat.progress.run_log import RunLog


@dataclass(frozen=True, slots=True, kw_only=True)
class VideoLatent:
    """A video as networks hand it on."""

    latent: Float[Tensor, "1 c t h2 w2"]
    """Standardised."""
    first_frame: InputImage
    """As it is, not decoded."""
    cameras: Camera
    """Batch shape (f,), of the image's size."""
    frames: Float[Tensor, "f h w 3"] | None = None
    """True frames; None for a generated video, whose frames are decoded."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RawVideoMaps:
    """LDRM's output with the frames that it saw."""

    maps: RawGaussianMaps
    frames: PosedVideo | None
    """True or decoded; only refinement needs them."""


def raw_video_maps(model: Model, video: VideoLatent, *, moving: bool, log: RunLog) -> RawVideoMaps:
    """LDRM's raw maps; optical flow is computed only where something is ``moving``."""
    rays = plucker_map(relative_to_first(video.cameras)).movedim(0, 1)[None]
    frames = None
    if model.config.refinement.used:
        frames = posed_video(model, video)
        if video.frames is not None:
            log.record_skipped("video decoder", "the frames are given", "decoding every frame")
    else:
        log.record_skipped("video decoder", "LDRM reads latents", "decoding every frame")
    maps = model.networks.ldrm(video.latent, rays, frames, moving=moving)
    return RawVideoMaps(maps=maps, frames=frames)


def video_gaussians(model: Model, video: VideoLatent, log: RunLog) -> CanonicalScene:
    """Gaussians of everything that the video shows."""
    raw = raw_video_maps(model, video, moving=True, log=log)
    if raw.frames is not None:
        return reconstruct_refined(raw.maps, raw.frames, model.config.activation, log)
    return reconstruct(raw.maps, image_plane_base(model, video), model.config.activation)


def image_plane_base(model: Model, video: VideoLatent) -> PixelBase:
    """The first frame on its plane, seen by every camera."""
    image = video.first_frame
    return plane_base(image.rgb, image.camera, video.cameras, model.config.ldrm.grid_stride)


def posed_video(model: Model, video: VideoLatent) -> PosedVideo:
    """The video's frames with their cameras, and with the start of its key frames."""
    frames = _decoded_frames(model, video) if video.frames is None else video.frames
    rgb = frames.movedim(-1, 0)[None]
    posed = PosedVideo(rgb=rgb, cameras=stack_cameras([video.cameras]))
    return with_start_distance(posed, model.networks.monocular_depth, model.config)


def _decoded_frames(model: Model, video: VideoLatent) -> Float[Tensor, "f h w 3"]:
    """The true first frame, then decoded ones."""
    decoded = (model.networks.vae.decode(video.latent)[0].float() + 1) / 2
    first = video.first_frame.rgb[None].to(decoded)
    return torch.cat([first, decoded[:, 1:].clamp(0, 1).movedim(0, -1)])
