"""Where key frames start: the depth prior's depth, brought to agree with the other frames (ADR 38).

Axes: ``b`` batch, ``k`` key frames, ``h w`` pixels.

    key frames ─ depth prior ─ distance ─ parallax ─ distance, confidence
"""

import math
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.config.networks import ActivationConfig
from diff4splat.models.config.priors import BACKBONE_MULTIPLE_PX
from diff4splat.models.ldrm.activations import log_ratio, raw_log_ratio
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.models.ldrm.refinement.parallax import parallax_depth
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo, StartDistance
from diff4splat.models.protocols import DepthPrior

PLANE_LOG_DEPTH = math.log(PLANE_DEPTH)
ENLARGEMENT = 1.5
"""Sides that the prior sees against the frame's: small frames gain, and 2 gains no more."""


@torch.no_grad()
def with_start_distance(
    video: PosedVideo, prior: DepthPrior | None, config: ActivationConfig
) -> PosedVideo:
    """The same video with raw distances of its key frames; without a prior they are planes."""
    if prior is None:
        return video
    with torch.autocast(video.rgb.device.type, enabled=False):
        raw = _prior_distance(video, prior)
        log_depth = PLANE_LOG_DEPTH + log_ratio(raw, config.log_distance_limit)
        log_depth, confidence = parallax_depth(log_depth, video)
        parallax = raw_log_ratio(log_depth - PLANE_LOG_DEPTH, config.log_distance_limit)
    start = StartDistance(prior=raw, parallax=parallax, confidence=confidence)
    return replace(video, start=start)


def _prior_distance(video: PosedVideo, prior: DepthPrior) -> Float[Tensor, "b k h w"]:
    frames = video.key_rgb.flatten(0, 1)
    raw, size = prior(_enlarged(frames)).float(), tuple(frames.shape[2:])
    raw = torch.nn.functional.interpolate(raw, size, mode="bilinear", antialias=True)[:, 0]
    return raw.unflatten(0, (len(video.rgb), -1))


def _enlarged(frames: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "n 3 h2 w2"]:
    sides = [
        BACKBONE_MULTIPLE_PX * max(round(side * ENLARGEMENT / BACKBONE_MULTIPLE_PX), 1)
        for side in frames.shape[2:]
    ]
    enlarged = torch.nn.functional.interpolate(frames, sides, mode="bicubic", align_corners=False)
    return enlarged.clamp(0, 1)
