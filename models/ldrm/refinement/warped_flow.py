"""Optical flow of each key frame's pixels to the other frames, with the camera's motion removed.

Axes: ``b`` batch, ``k`` key frames, ``p`` pairs of a key frame and another frame, ``h w`` pixels,
``s`` slots: other frames, by distance in time, later ones first. Other frames are warped into the
view of the key frame through the predicted depth, so static points keep their pixel. Optical flow
tracks moving points from one distance to the next, initialised with constant velocity. Per slot

    rate = R · (flow / focal, 0) / (slot time − key time),     R = world_from_camera

so that a point at depth z moves by z · rate per clip, and the colour difference that remains.
"""

from collections.abc import Callable

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.models.blocks.precision import at_least_float32
from diff4splat.models.ldrm.optical_flow.lucas_kanade import warp
from diff4splat.models.ldrm.optical_flow.optical_flow import optical_flow
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo, camera_frames, flat_cameras
from diff4splat.models.ldrm.refinement.warping import other_pixels, sampled

DISTANCES = tuple(range(1, 9))
"""In frames."""
SLOTS = 2 * len(DISTANCES)
RATE_UNIT, DIFFERENCE_UNIT = 0.25, 0.1
"""Value that is 1 in a slot: typical of moving points."""
SLOT_CUES = 4
"""Rate (x, y, z), difference."""

OpticalFlow = Callable[[Tensor, Tensor, Tensor], Tensor]
"""``optical_flow``, or a graph of it."""


def warped_flow(
    depth: Float[Tensor, "b k h w"], posed_video: PosedVideo, flow: OpticalFlow = optical_flow
) -> Float[Tensor, "b k s 4 h w"]:
    """Rate and difference per pixel and slot, in their units.

    Frames beyond an end of the video are not computed: their slots repeat the last frame before
    the end, and at the first and the last key frame those of the other direction.
    """
    later, earlier = _tracks(depth, posed_video, flow).chunk(2, 1)
    first, last = (posed_video.keys == end for end in (0, posed_video.rgb.shape[2] - 1))
    ends = [end[:, None, None, None, None] for end in (last, first)]
    tracks = [torch.where(ends[0], earlier, later), torch.where(ends[1], later, earlier)]
    rate_px, difference = torch.cat(tracks, 2).split([2, 1], 3)
    return torch.cat([_rate(rate_px, posed_video), difference / DIFFERENCE_UNIT], 3)


def _tracks(
    depth: Float[Tensor, "b k h w"], posed_video: PosedVideo, flow: OpticalFlow
) -> Float[Tensor, "b k2 d 3 h w"]:
    """Pixels per frame and difference per distance ``d``, later frames first, then earlier ones.

    Each is initialised with the velocity at the distance before.
    """
    keys, last = posed_video.keys, posed_video.rgb.shape[2] - 1
    track = torch.zeros_like(at_least_float32(posed_video.key_rgb.repeat(1, 2, 1, 1, 1)))
    tracks = []
    for distance in DISTANCES:
        frames = torch.cat([keys + distance, keys - distance])
        (inside,) = torch.where((frames >= 0) & (frames <= last))
        if len(inside):
            pairs = torch.stack([inside % len(keys), frames[inside]])
            found = _tracked(depth, posed_video, pairs, track[:, inside, :2], flow)
            track = track.index_copy(1, inside, found)
        tracks.append(track)
    return torch.stack(tracks, 2)


def _tracked(
    depth: Float[Tensor, "b k h w"],
    posed_video: PosedVideo,
    pairs: Int[Tensor, "2 p"],
    rate_px: Float[Tensor, "b p 2 h w"],
    flow: OpticalFlow,
) -> Float[Tensor, "b p 3 h w"]:
    """Pixels per frame and difference from key frames to frames, initialised with ``rate_px``."""
    keys, frames = pairs
    elapsed = (frames - posed_video.keys[keys]).to(rate_px)[:, None, None, None]
    source = at_least_float32(posed_video.key_rgb[:, keys].flatten(0, 1))
    target = _warped_frames(depth, posed_video, pairs)
    found = flow(source, target, (rate_px * elapsed).flatten(0, 1))
    difference = (warp(target, found) - source).abs().mean(1, keepdim=True)
    found, difference = (x.unflatten(0, (len(depth), -1)) for x in (found, difference))
    return torch.cat([found / elapsed, difference], 2)


def _warped_frames(
    depth: Float[Tensor, "b k h w"], posed_video: PosedVideo, pairs: Int[Tensor, "2 p"]
) -> Float[Tensor, "n 3 h w"]:
    """The frame of every pair, warped into the view of its key frame's camera."""
    keys, frames = pairs
    source = flat_cameras(camera_frames(posed_video.key_cameras, keys))
    target = flat_cameras(camera_frames(posed_video.cameras, frames))
    pixels, _ = other_pixels(source, target, 1 / depth[:, keys].flatten(0, 1)[:, None])
    neighbour = posed_video.rgb[:, :, frames].transpose(1, 2).flatten(0, 1)
    return at_least_float32(sampled(neighbour, pixels)[:, :, 0])


def _rate(
    rate_px: Float[Tensor, "b k s 2 h w"], posed_video: PosedVideo
) -> Float[Tensor, "b k s 3 h w"]:
    """Pixels per frame as depths per clip, along the axes of the first camera."""
    count, cameras = posed_video.rgb.shape[2] - 1, posed_video.key_cameras
    image_rate = count * rate_px / cameras.focal_px[:, :, None, :, None, None].to(rate_px)
    rotation = cameras.world_from_camera[..., :3, :2].to(rate_px)
    return torch.einsum("bkij,bksjhw->bksihw", rotation, image_rate) / RATE_UNIT
