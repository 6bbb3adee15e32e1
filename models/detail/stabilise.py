"""The neighbours of each key frame as its own camera would have seen them, had nothing moved.

Axes: ``b`` batch, ``k`` key frames, ``h w`` pixels, ``h4 w4`` cells of 4 pixels, ``d`` channels.
Neighbouring pictures are carried into the key frame through the predicted depth. What stands still
then looks the same in all of them, and what moves shows where to: the deformation network need not
learn to subtract the camera's motion. No gradient passes.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models import activations
from diff4splat.models.base_scene import PLANE_DEPTH
from diff4splat.models.config_parts import ActivationConfig
from diff4splat.models.detail.layers import CELL_PX, cells
from diff4splat.models.detail.sight import Sight, camera_frames, flat_cameras
from diff4splat.models.detail.warping import other_pixels, sampled

NEIGHBOURS = (-4, -2, -1, 1, 2, 4)
"""Frames before and after a key frame; beyond the video its ends stand in."""
CUES = 3 * CELL_PX**2 * len(NEIGHBOURS)


def motion_cues(
    features: Float[Tensor, "b k c h4 w4"],
    raw_distance: Float[Tensor, "b k h w"],
    sight: Sight,
    config: ActivationConfig,
) -> Float[Tensor, "b d k h4 w4"]:
    """Features of the key frames, then differences of their stabilised neighbours."""
    with torch.no_grad():
        depth = key_depth(raw_distance, config)
        apart = [_difference(depth, sight, offset) for offset in NEIGHBOURS]
        stacked = cells(torch.cat(apart, 2).flatten(0, 1)).unflatten(0, depth.shape[:2])
    return torch.cat([features, stacked.to(features.dtype)], 2).transpose(1, 2)


def key_depth(
    raw_distance: Float[Tensor, "*b k h w"], config: ActivationConfig
) -> Float[Tensor, "*b k h w"]:
    """Depth z of the key frames' pixels: their base is a plane before their own camera."""
    raw = raw_distance.float()
    return PLANE_DEPTH * activations.bounded_factor(raw, config.log_distance_limit)


def _difference(
    depth: Float[Tensor, "b k h w"], sight: Sight, offset: int
) -> Float[Tensor, "b k 3 h w"]:
    """A neighbour, carried into the key frame, minus the key frame."""
    batch, count = depth.shape[:2]
    frames = (sight.keys + offset).clamp(0, sight.rgb.shape[2] - 1)
    own, other = (
        flat_cameras(c) for c in (sight.key_cameras, camera_frames(sight.cameras, frames))
    )
    pixels, _ = other_pixels(own, other, 1 / depth.flatten(0, 1)[:, None])
    neighbour = sight.rgb[:, :, frames].transpose(1, 2).flatten(0, 1)
    carried = sampled(neighbour, pixels)[:, :, 0].unflatten(0, (batch, count))
    return carried - sight.key_rgb
