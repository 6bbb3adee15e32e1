"""How fast each key frame's pixels leave, had its own camera taken the other frames too.

Axes: ``b`` batch, ``k`` key frames, ``h w`` pixels, ``h4 w4`` cells of 4 pixels, ``s`` slots: other
frames, by distance in time, later ones first. Frames are carried into the key frame through the
predicted depth. What stands still then lies where it was, and what moves is followed from one
distance to the next, begun where an even motion would be. The deformation network need learn
neither to subtract the camera's motion nor to compare pictures. Per slot

    rate = R · (flow / focal, 0) / (time of the slot − own time),     R = world_from_camera

so that a point at depth z leaves at z · rate per clip; and how far colours differ there. No
gradient passes.
"""

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.models.blocks.conv_block import CELL_PX
from diff4splat.models.config.networks import TIME_STRIDE, ActivationConfig
from diff4splat.models.ldrm import activations
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.models.ldrm.refinement.lucas_kanade import track_flow, warp
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo, camera_frames, flat_cameras
from diff4splat.models.ldrm.refinement.warping import other_pixels, sampled

DISTANCES = (1, 2, 4, 8)
"""In frames, doubled each time; beyond the video its ends stand in."""
SLOTS = 2 * len(DISTANCES)
RATE_UNIT, DIFFERENCE_UNIT = 0.25, 0.1
"""What is 1 in a cue: about as large as both are where something moves."""
SLOT_CUES = 4
"""Rate (x, y, z), difference."""
CUES = SLOT_CUES * SLOTS + 1
"""Channels behind the features: those of the slots, and the logarithm of depth at the end."""


def motion_features(
    features: Float[Tensor, "b k c h4 w4"],
    raw_distance: Float[Tensor, "b k h w"],
    posed_video: PosedVideo,
    config: ActivationConfig,
) -> Float[Tensor, "b d k h4 w4"]:
    """Features of the key frames, then their cues."""
    with torch.no_grad(), torch.autocast(features.device.type, enabled=False):
        depth = key_depth(raw_distance, config)
        relative = (depth / PLANE_DEPTH).log()[:, :, None]
        pixels = torch.cat([warped_flow(depth, posed_video).flatten(2, 3), relative], 2)
        cues = torch.nn.functional.avg_pool2d(pixels.flatten(0, 1), CELL_PX)
        cues = cues.unflatten(0, depth.shape[:2])
    return torch.cat([features, cues.to(features.dtype)], 2).transpose(1, 2)


def key_depth(
    raw_distance: Float[Tensor, "*b k h w"], config: ActivationConfig
) -> Float[Tensor, "*b k h w"]:
    """Depth z of the key frames' pixels: their base is a plane before their own camera."""
    raw = raw_distance.float()
    return PLANE_DEPTH * activations.bounded_factor(raw, config.log_distance_limit)


def warped_flow(
    depth: Float[Tensor, "b k h w"], posed_video: PosedVideo
) -> Float[Tensor, "b k s 4 h w"]:
    """Rate and difference of every pixel in every slot; beyond an end, those of the other way."""
    later, earlier = (_one_way(depth, posed_video, sign) for sign in (1, -1))
    last = posed_video.rgb.shape[2] - 1
    ends = [(posed_video.keys == end)[:, None, None, None, None] for end in (last, 0)]
    return torch.cat(
        [torch.where(ends[0], earlier, later), torch.where(ends[1], later, earlier)], 2
    )


def slot_shares(elapsed: Float[Tensor, "*b"]) -> Float[Tensor, "*b s"]:
    """How much each slot says of a time so many frames later: the nearest two, linear in log₂."""
    octave = elapsed.abs().clamp(DISTANCES[0], DISTANCES[-1]).log2()[..., None]
    near = (1 - (octave - torch.arange(len(DISTANCES)).to(octave)).abs()).clamp_min(0)
    later = (elapsed >= 0)[..., None]
    return torch.cat([near * later, near * ~later], -1)


def frames_between(keys: int) -> int:
    """Frames from the first key frame to the last."""
    return TIME_STRIDE * (keys - 1)


def _one_way(
    depth: Float[Tensor, "b k h w"], posed_video: PosedVideo, sign: int
) -> Float[Tensor, "b k s 4 h w"]:
    """Slots at growing distance, each begun at the even motion that the one before it saw."""
    own = posed_video.key_rgb.flatten(0, 1).float()
    rate_px = torch.zeros_like(own[:, :2])
    slots = []
    for distance in DISTANCES:
        frames = (posed_video.keys + sign * distance).clamp(0, posed_video.rgb.shape[2] - 1)
        elapsed = (frames - posed_video.keys).repeat(len(depth)).to(own)[:, None, None, None]
        other = _carried(depth, posed_video, frames)
        flow = track_flow(own, other, rate_px * elapsed)
        difference = (warp(other, flow) - own).abs().mean(1, keepdim=True)
        rate_px = torch.where(elapsed == 0, rate_px, flow / elapsed)
        slots.append(torch.cat([_rate(rate_px, posed_video), difference / DIFFERENCE_UNIT], 1))
    return torch.stack(slots, 1).unflatten(0, depth.shape[:2])


def _rate(rate_px: Float[Tensor, "n 2 h w"], posed_video: PosedVideo) -> Float[Tensor, "n 3 h w"]:
    """Pixels per frame as depths per clip, along the axes of the first camera."""
    cameras = flat_cameras(posed_video.key_cameras)
    count = posed_video.rgb.shape[2] - 1
    across = count * rate_px / cameras.focal_px[:, :, None, None].to(rate_px)
    turn = cameras.world_from_camera[:, :3, :2].to(rate_px)
    return torch.einsum("nij,njhw->nihw", turn, across) / RATE_UNIT


def _carried(
    depth: Float[Tensor, "b k h w"], posed_video: PosedVideo, frames: Int[Tensor, " k"]
) -> Float[Tensor, "n 3 h w"]:
    """One frame for each key frame, as that one's camera would have seen it."""
    own, other = (
        flat_cameras(c)
        for c in (posed_video.key_cameras, camera_frames(posed_video.cameras, frames))
    )
    pixels, _ = other_pixels(own, other, 1 / depth.flatten(0, 1)[:, None])
    neighbour = posed_video.rgb[:, :, frames].transpose(1, 2).flatten(0, 1)
    return sampled(neighbour, pixels)[:, :, 0].float()
