"""Metrics over parts of the target images: what the input shows, and what it hides.

Axes: ``p`` target images, ``h w`` pixels. A PSNR over almost no pixel is left out, and counted.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.evaluation.columns import PSNR_CAP_DB
from diff4splat.evaluation.records import Score, Skip, score
from diff4splat.metrics.features.protocol import PerceptualFeatures
from diff4splat.metrics.masked import mean_or_nan
from diff4splat.metrics.perceptual import perceptual_distance

MIN_PIXELS = 16
"""Smallest number of pixels for a PSNR."""
KEYS = ("covisible_psnr", "covisible_share", "hidden_psnr")


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedImages:
    """Predicted and true images, and their regions."""

    rgb: Float[Tensor, "p h w 3"]
    truth: Float[Tensor, "p h w 3"]
    covisible: Bool[Tensor, "p h w"] | None
    """Pixels whose surface the input shows; None without true depth."""
    hidden: Bool[Tensor, "p h w"] | None
    """Pixels whose surface it does not show."""


def region_entries(
    row: str, images: ComparedImages, features: PerceptualFeatures | None
) -> list[Score | Skip]:
    """Metrics of both regions; skipped without true depth."""
    if images.covisible is None:
        return [Skip(row=row, key=key, why="the clip has no depth") for key in KEYS]
    seen = masked_psnr(images.rgb, images.truth, images.covisible)
    hidden = masked_psnr(images.rgb, images.truth, images.hidden)
    entries = [
        score(row, "covisible_psnr", seen.tolist()),
        score(row, "covisible_share", images.covisible.double().mean((-2, -1)).tolist()),
        score(row, "hidden_psnr", hidden.tolist()),
    ]
    if features is not None:
        distances = hidden_distance(images, features)
        entries.append(score(row, "hidden_perceptual", distances.tolist()))
    return entries


def masked_psnr(
    rgb: Float[Tensor, "p h w 3"], truth: Float[Tensor, "p h w 3"], mask: Bool[Tensor, "p h w"]
) -> Float[Tensor, " p"]:
    """PSNR over the pixels of ``mask``, capped; NaN for images with too few of them."""
    squares = (rgb - truth).square().mean(-1)
    error = mean_or_nan(squares.flatten(1), mask.flatten(1))
    enough = mask.sum((-2, -1)) >= MIN_PIXELS
    return torch.where(enough, (-10 * error.log10()).clamp_max(PSNR_CAP_DB), math.nan)


@torch.no_grad()
def hidden_distance(images: ComparedImages, features: PerceptualFeatures) -> Float[Tensor, " p"]:
    """Perceptual distance of the true image whose hidden pixels alone are the predicted ones.

    NaN for images with too few hidden pixels.
    """
    only_hidden = torch.where(images.hidden[..., None], images.rgb, images.truth)
    distances = perceptual_distance(only_hidden, images.truth, features)
    enough = images.hidden.sum((-2, -1)) >= MIN_PIXELS
    return torch.where(enough, distances, math.nan)
