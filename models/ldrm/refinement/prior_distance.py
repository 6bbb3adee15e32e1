"""Where key frames start: at the depth that the depth prior sees in each of them (ours, ADR 38).

Axes: ``b`` batch, ``k`` key frames, ``h w`` pixels.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.models.protocols import DepthPrior

ENLARGED = 2
"""Sides that the prior sees against the frame's: it is best at 128 px, and wants multiples of 32
where frames have multiples of 16."""


@torch.no_grad()
def with_prior_distance(video: PosedVideo, prior: DepthPrior | None) -> PosedVideo:
    """The same video with the raw distance of its key frames; without a prior they are planes."""
    if prior is None:
        return video
    raw = prior(_enlarged(video.key_rgb.flatten(0, 1))).float()
    raw = torch.nn.functional.avg_pool2d(raw, ENLARGED)[:, 0]
    return replace(video, prior_distance=raw.unflatten(0, (len(video.rgb), -1)))


def _enlarged(frames: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "n 3 h2 w2"]:
    enlarged = torch.nn.functional.interpolate(
        frames, scale_factor=ENLARGED, mode="bicubic", align_corners=False
    )
    return enlarged.clamp(0, 1)
