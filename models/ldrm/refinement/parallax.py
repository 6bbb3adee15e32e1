"""Depth of key frames from parallax: a depth that other frames agree with, near a first one.

Axes: ``b`` batch, ``k`` key frames, ``n`` = b k, ``h w`` pixels. For the logarithm L of depth with
the correction c = L − L₀, Gauss and Newton's steps minimise per pixel x of the key frame

    mean_W Σ_s weight · (I_s(x_s(L)) − I(x))²  +  SMOOTHNESS · |c − mean c|²

where x_s(L) is where the other frame s shows the pixel's point (Lucas and Kanade along epipolar
lines). weight = 1 / (1 + (difference / RESIDUAL_SCALE)²): points that are occluded, or that move
across epipolar lines, hardly count; motion along them is taken for depth. Where colours do not
determine the depth, the correction is that of the neighbourhood; without any parallax it is 0.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.models.ldrm.refinement.other_frames import (
    OtherFrames,
    blurred_key_frames,
    other_frames,
)
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo, flat_cameras
from diff4splat.models.ldrm.window_mean import window_mean

STEPS = 6
WINDOW_PX, SMOOTHING_WINDOW_PX = 9, 17
SMOOTHNESS, RESIDUAL_SCALE = 0.03, 0.05
PROBE = 0.02
"""Change of L over which the image's derivative is taken."""
LONGEST_STEP = 0.1


def parallax_depth(
    log_depth: Float[Tensor, "b k h w"], video: PosedVideo
) -> tuple[Float[Tensor, "b k h w"], Float[Tensor, "b k h w"]]:
    """Logarithm of depth that the video agrees with, and a confidence from 0 to 1."""
    key_rgb = blurred_key_frames(video)
    cameras, others = flat_cameras(video.key_cameras), list(other_frames(video))
    first = log_depth.flatten(0, 1)
    correction, curvature = torch.zeros_like(first), torch.zeros_like(first)
    for _ in range(STEPS):
        slope, curvature = _equation(first + correction, key_rgb, cameras, others)
        pull = SMOOTHNESS * (_mean(correction, SMOOTHING_WINDOW_PX) - correction)
        step = (pull - slope) / (curvature + SMOOTHNESS)
        correction = correction + step.clamp(-LONGEST_STEP, LONGEST_STEP)
    confidence = curvature / (curvature + SMOOTHNESS)
    batch = log_depth.shape[:2]
    return (first + correction).unflatten(0, batch), confidence.unflatten(0, batch)


def _equation(
    log_depth: Float[Tensor, "n h w"],
    key_rgb: Float[Tensor, "n 3 h w"],
    cameras: Camera,
    others: list[OtherFrames],
) -> tuple[Float[Tensor, "n h w"], Float[Tensor, "n h w"]]:
    """Slope and curvature of half the squared error, averaged over the window."""
    slope, curvature = torch.zeros_like(log_depth), torch.zeros_like(log_depth)
    for other in others:
        seen, visible = other.colors_at(log_depth, cameras)
        probed, _ = other.colors_at(log_depth + PROBE, cameras)
        derivative, error = (probed - seen) / PROBE, seen - key_rgb
        weight = _weight(error) * (visible & other.exists[:, None, None])
        slope = slope + weight * (derivative * error).sum(1)
        curvature = curvature + weight * derivative.square().sum(1)
    return _mean(slope, WINDOW_PX), _mean(curvature, WINDOW_PX)


def _weight(error: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "n h w"]:
    squared = _mean(error.square().mean(1), WINDOW_PX)
    return 1 / (1 + squared / RESIDUAL_SCALE**2)


def _mean(maps: Float[Tensor, "n h w"], side_px: int) -> Float[Tensor, "n h w"]:
    return window_mean(maps[:, None], side_px)[:, 0]
