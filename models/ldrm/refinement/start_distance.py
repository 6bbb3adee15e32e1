"""Where key frames start: the depth prior's depth, brought to agree with the other frames (ADR 38).

Axes: ``b`` batch, ``k`` key frames, ``h w`` pixels.

    key frames ─ depth prior ─ distance ─ parallax ─ distance, confidence
"""

import math
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.blocks.resize import enlarged
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.priors import BACKBONE_MULTIPLE_PX
from diff4splat.models.ldrm.activations import raw_log_ratio
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.models.ldrm.refinement.motion_features import key_depth
from diff4splat.models.ldrm.refinement.parallax import parallax_depth
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo, StartDistance
from diff4splat.models.protocols import DepthPrior

ENLARGEMENT = 1.5
"""Sides that the prior sees against the frame's: small frames gain, and 2 gains no more."""


@torch.no_grad()
def with_start_distance(
    video: PosedVideo, prior: DepthPrior | None, config: ModelConfig
) -> PosedVideo:
    """The same video with raw distances of its key frames, if LDRM starts from the prior.

    Without a prior key frames start at planes.
    """
    if not config.refinement.depth_prior or prior is None:
        return video
    with torch.autocast(video.rgb.device.type, enabled=False):
        raw = _prior_distance(video, prior)
        first = key_depth(raw, config.activation).log()
        log_depth, confidence = parallax_depth(first, video)
        ratio = log_depth - math.log(PLANE_DEPTH)
        parallax = raw_log_ratio(ratio, config.activation.log_distance_limit)
    start = StartDistance(prior=raw, parallax=parallax, confidence=confidence)
    return replace(video, start=start)


@torch.no_grad()
def prior_log_depth(
    video: PosedVideo, prior: DepthPrior, config: ModelConfig
) -> Float[Tensor, "b k h w"]:
    """Natural logarithm of z of the key frames by the depth prior alone."""
    return key_depth(_prior_distance(video, prior), config.activation).log()


def _prior_distance(video: PosedVideo, prior: DepthPrior) -> Float[Tensor, "b k h w"]:
    frames = video.key_rgb.flatten(0, 1)
    raw = prior(enlarged(frames, ENLARGEMENT, BACKBONE_MULTIPLE_PX)).float()
    size = tuple(frames.shape[2:])
    raw = torch.nn.functional.interpolate(raw, size, mode="bilinear", antialias=True)[:, 0]
    return raw.unflatten(0, (len(video.rgb), -1))
