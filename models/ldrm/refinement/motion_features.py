"""Image-plane motion of each key frame's pixels, with the camera's motion removed.

Axes: ``b`` batch, ``k`` key frames, ``h w`` pixels, ``h4 w4`` cells of 4 pixels, ``s`` slots: other
frames, by distance in time, later ones first. Other frames are warped into the view of the key
frame through the predicted depth, so static points keep their pixel. Optical flow tracks moving
points from one distance to the next, initialised with constant velocity. The deformation network
need learn neither to subtract the camera's motion nor to match images. Per slot

    rate = R · (flow / focal, 0) / (slot time − key time),     R = world_from_camera

so that a point at depth z moves by z · rate per clip, and the colour difference that remains. No
gradient passes.
"""

from collections.abc import Callable

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.models.blocks.conv_block import CELL_PX
from diff4splat.models.blocks.precision import at_least_float32
from diff4splat.models.config.networks import TIME_STRIDE, ActivationConfig
from diff4splat.models.ldrm import activations
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.models.ldrm.refinement.lucas_kanade import warp
from diff4splat.models.ldrm.refinement.optical_flow import optical_flow
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo, camera_frames, flat_cameras
from diff4splat.models.ldrm.refinement.warping import other_pixels, sampled

DISTANCES = tuple(range(1, 9))
"""In frames; clamped to the ends of the video."""
SLOTS = 2 * len(DISTANCES)
RATE_UNIT, DIFFERENCE_UNIT = 0.25, 0.1
"""Value that is 1 in a feature: typical of moving points."""
SLOT_CUES = 4
"""Rate (x, y, z), difference."""
MOTION_CHANNELS = SLOT_CUES * SLOTS + 1
"""Channels appended to the features: those of the slots, then the logarithm of depth."""
INPUT_SLOTS = tuple(
    sign + distance - 1 for sign in (0, len(DISTANCES)) for distance in (1, 2, 4, 8)
)
"""Distances of 1, 2, 4 and 8 to both sides: the deformation network sees these slots at once, and
all of them at the time that it is asked for."""
INPUT_CHANNELS = SLOT_CUES * len(INPUT_SLOTS) + 1


def track_slot(
    depth: Float[Tensor, "b k h w"],
    posed_video: PosedVideo,
    frames: Int[Tensor, " k"],
    rate_px: Float[Tensor, "n 2 h w"],
) -> tuple[Float[Tensor, "n 2 h w"], Float[Tensor, "n 4 h w"]]:
    """Rate in pixels per frame until ``frames``, initialised with ``rate_px``; and the slot."""
    source = at_least_float32(posed_video.key_rgb.flatten(0, 1))
    elapsed = (frames - posed_video.keys).repeat(depth.shape[0]).to(source)[:, None, None, None]
    target = _warped_frames(depth, posed_video, frames)
    flow = optical_flow(source, target, rate_px * elapsed)
    difference = (warp(target, flow) - source).abs().mean(1, keepdim=True)
    nearest = torch.where(elapsed == 0, 1, elapsed)
    rate_px = torch.where(elapsed == 0, rate_px, flow / nearest)
    slot = torch.cat([_rate(rate_px, posed_video), difference / DIFFERENCE_UNIT], 1)
    return rate_px, slot


TrackSlot = Callable[[Tensor, PosedVideo, Tensor, Tensor], tuple[Tensor, Tensor]]
"""``track_slot``, or a graph of it."""


def motion_features(
    features: Float[Tensor, "b k c h4 w4"],
    raw_distance: Float[Tensor, "b k h w"],
    posed_video: PosedVideo,
    config: ActivationConfig,
    track: TrackSlot = track_slot,
) -> Float[Tensor, "b d k h4 w4"]:
    """Features of the key frames, then their motion features."""
    with torch.no_grad(), torch.autocast(features.device.type, enabled=False):
        depth = key_depth(raw_distance, config)
        relative = (depth / PLANE_DEPTH).log()[:, :, None]
        flow = warped_flow(depth, posed_video, track).flatten(2, 3)
        pixels = torch.cat([flow, relative], 2)
        cues = torch.nn.functional.avg_pool2d(pixels.flatten(0, 1), CELL_PX)
        cues = cues.unflatten(0, depth.shape[:2])
    return torch.cat([features, cues.to(features.dtype)], 2).transpose(1, 2)


def key_depth(
    raw_distance: Float[Tensor, "*b k h w"], config: ActivationConfig
) -> Float[Tensor, "*b k h w"]:
    """Depth z of the key frames' pixels: their base is a plane in front of their camera."""
    raw = at_least_float32(raw_distance)
    return PLANE_DEPTH * activations.bounded_factor(raw, config.log_distance_limit)


def warped_flow(
    depth: Float[Tensor, "b k h w"], posed_video: PosedVideo, track: TrackSlot = track_slot
) -> Float[Tensor, "b k s 4 h w"]:
    """Rate and difference per pixel and slot; beyond an end, those of the other direction."""
    later, earlier = (_one_direction(depth, posed_video, sign, track) for sign in (1, -1))
    last = posed_video.rgb.shape[2] - 1
    ends = [(posed_video.keys == end)[:, None, None, None, None] for end in (last, 0)]
    return torch.cat(
        [torch.where(ends[0], earlier, later), torch.where(ends[1], later, earlier)], 2
    )


def slot_weights(elapsed: Float[Tensor, "*b"]) -> Float[Tensor, "*b s"]:
    """Weights of the two nearest slots at an offset in frames."""
    distance = elapsed.abs().clamp(DISTANCES[0], DISTANCES[-1])[..., None]
    near = (1 - (distance - torch.tensor(DISTANCES).to(distance)).abs()).clamp_min(0)
    later = (elapsed >= 0)[..., None]
    return torch.cat([near * later, near * ~later], -1)


def input_motion(motion: Float[Tensor, "n c h w"]) -> Float[Tensor, "n c2 h w"]:
    """Of all motion channels those that the deformation network sees at once."""
    slots = motion[:, :-1].unflatten(1, (SLOTS, SLOT_CUES))[:, list(INPUT_SLOTS)]
    return torch.cat([slots.flatten(1, 2), motion[:, -1:]], 1)


def keyframe_span(keys: int) -> int:
    """Frames from the first key frame to the last."""
    return TIME_STRIDE * (keys - 1)


def _one_direction(
    depth: Float[Tensor, "b k h w"], posed_video: PosedVideo, sign: int, track: TrackSlot
) -> Float[Tensor, "b k s 4 h w"]:
    """Slots at growing distance, each initialised with the velocity of the one before."""
    rate_px = torch.zeros_like(at_least_float32(posed_video.key_rgb[:, :, :2].flatten(0, 1)))
    slots = []
    for distance in DISTANCES:
        frames = (posed_video.keys + sign * distance).clamp(0, posed_video.rgb.shape[2] - 1)
        rate_px, slot = track(depth, posed_video, frames, rate_px)
        slots.append(slot)
    return torch.stack(slots, 1).unflatten(0, depth.shape[:2])


def _rate(rate_px: Float[Tensor, "n 2 h w"], posed_video: PosedVideo) -> Float[Tensor, "n 3 h w"]:
    """Pixels per frame as depths per clip, along the axes of the first camera."""
    cameras = flat_cameras(posed_video.key_cameras)
    count = posed_video.rgb.shape[2] - 1
    image_rate = count * rate_px / cameras.focal_px[:, :, None, None].to(rate_px)
    rotation = cameras.world_from_camera[:, :3, :2].to(rate_px)
    return torch.einsum("nij,njhw->nihw", rotation, image_rate) / RATE_UNIT


def _warped_frames(
    depth: Float[Tensor, "b k h w"], posed_video: PosedVideo, frames: Int[Tensor, " k"]
) -> Float[Tensor, "n 3 h w"]:
    """One frame for each key frame, warped into the view of its camera."""
    source = flat_cameras(posed_video.key_cameras)
    target = flat_cameras(camera_frames(posed_video.cameras, frames))
    pixels, _ = other_pixels(source, target, 1 / depth.flatten(0, 1)[:, None])
    neighbour = posed_video.rgb[:, :, frames].transpose(1, 2).flatten(0, 1)
    return at_least_float32(sampled(neighbour, pixels)[:, :, 0])
