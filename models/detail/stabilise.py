"""Where each key frame's pixels went, had its own camera taken the neighbouring frames too.

Axes: ``b`` batch, ``k`` key frames, ``h w`` pixels, ``h4 w4`` cells of 4 pixels, ``s`` shifts,
``d`` channels. Neighbouring pictures are carried into the key frame through the predicted depth.
What stands still then lies where it was, and what moves is found at a shift: the deformation
network need not learn to subtract the camera's motion. Shifts are compared at half the resolution,

    match_s = softmax_s( −SHARPNESS · (mean |carried(x + s) − own(x)| + STILLNESS · |s|) )

a soft vote over shifts, of which a displacement is a linear function. No gradient passes.
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models import activations
from diff4splat.models.base_scene import PLANE_DEPTH
from diff4splat.models.config_parts import ActivationConfig
from diff4splat.models.detail.layers import CELL_PX
from diff4splat.models.detail.sight import Sight, camera_frames, flat_cameras
from diff4splat.models.detail.warping import other_pixels, sampled

NEIGHBOURS = (-4, -2, -1, 1, 2, 4)
"""Frames before and after a key frame; beyond the video its ends stand in."""
REACH = 3
"""Farthest shift along one axis, in steps of two pixels."""
SIDE = 2 * REACH + 1
"""Shifts along one axis; votes times it have a root mean square of 1 where all are for one."""
SHARPNESS, STILLNESS = 60.0, 0.004
"""Of the vote, per unit of colour; and what a step of shift costs where colours cannot tell."""
CUES = SIDE**2 * len(NEIGHBOURS) + 1
"""Channels behind the features: a vote per neighbour, and the logarithm of depth at the end."""


def motion_cues(
    features: Float[Tensor, "b k c h4 w4"],
    raw_distance: Float[Tensor, "b k h w"],
    sight: Sight,
    config: ActivationConfig,
) -> Float[Tensor, "b d k h4 w4"]:
    """Features of the key frames, then votes, then log depth over that of the plane."""
    with torch.no_grad():
        depth = key_depth(raw_distance, config)
        votes = [match(_carried(depth, sight, offset), sight.key_rgb) for offset in NEIGHBOURS]
        relative = (depth / PLANE_DEPTH).log().flatten(0, 1)[:, None]
        relative = torch.nn.functional.avg_pool2d(relative, CELL_PX).unflatten(0, depth.shape[:2])
        cues = torch.cat([*(SIDE * vote for vote in votes), relative], 2)
    return torch.cat([features, cues.to(features.dtype)], 2).transpose(1, 2)


def key_depth(
    raw_distance: Float[Tensor, "*b k h w"], config: ActivationConfig
) -> Float[Tensor, "*b k h w"]:
    """Depth z of the key frames' pixels: their base is a plane before their own camera."""
    raw = raw_distance.float()
    return PLANE_DEPTH * activations.bounded_factor(raw, config.log_distance_limit)


def match(
    carried: Float[Tensor, "b k 3 h w"], own: Float[Tensor, "b k 3 h w"]
) -> Float[Tensor, "b k s h4 w4"]:
    """Votes per cell, row by row from the shift up and to the left; they sum to 1."""
    there, here = (torch.nn.functional.avg_pool2d(one.flatten(0, 1), 2) for one in (carried, own))
    costs = _shifted_costs(there, here)
    costs = torch.nn.functional.avg_pool2d(costs, 3, 1, 1, count_include_pad=False)
    votes = (-SHARPNESS * costs).softmax(1)
    return torch.nn.functional.avg_pool2d(votes, CELL_PX // 2).unflatten(0, own.shape[:2])


def _shifted_costs(
    there: Float[Tensor, "n 3 h2 w2"], here: Float[Tensor, "n 3 h2 w2"]
) -> Float[Tensor, "n s h2 w2"]:
    """Difference of colour at every shift, and a little for its length."""
    height, width = here.shape[-2:]
    around = torch.nn.functional.pad(there, (REACH,) * 4, mode="replicate")
    costs = []
    for down in range(SIDE):
        for right in range(SIDE):
            moved = around[..., down : down + height, right : right + width]
            length = math.hypot(down - REACH, right - REACH)
            costs.append((moved - here).abs().mean(1) + STILLNESS * length)
    return torch.stack(costs, 1)


def _carried(
    depth: Float[Tensor, "b k h w"], sight: Sight, offset: int
) -> Float[Tensor, "b k 3 h w"]:
    """A neighbour as the key frame's camera would have seen it."""
    batch, count = depth.shape[:2]
    frames = (sight.keys + offset).clamp(0, sight.rgb.shape[2] - 1)
    own, other = (
        flat_cameras(c) for c in (sight.key_cameras, camera_frames(sight.cameras, frames))
    )
    pixels, _ = other_pixels(own, other, 1 / depth.flatten(0, 1)[:, None])
    neighbour = sight.rgb[:, :, frames].transpose(1, 2).flatten(0, 1)
    return sampled(neighbour, pixels)[:, :, 0].unflatten(0, (batch, count))
