"""Metrics over parts of the target images: what the input shows, and what it hides.

Axes: ``p`` target images, ``h w`` pixels. A PSNR over almost no pixel is left out, and counted.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.evaluation.columns import PSNR_CAP_DB
from diff4splat.evaluation.measures.covisibility import covisible_masks
from diff4splat.evaluation.measures.hidden_classes import CLASSES, HiddenPixels, hidden_pixels
from diff4splat.evaluation.protocols.sample import EvalSample
from diff4splat.evaluation.records import Score, Skip, score
from diff4splat.metrics.features.protocol import PerceptualFeatures
from diff4splat.metrics.masked import mean_or_nan
from diff4splat.metrics.perceptual import perceptual_distance

MIN_PIXELS = 16
"""Smallest number of pixels for a PSNR."""
HIDDEN_KEYS = tuple(
    f"{region}_{measure}" for region in ("hidden", *CLASSES) for measure in ("share", "psnr")
)
KEYS = ("covisible_psnr", "covisible_share", *HIDDEN_KEYS)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueRegions:
    """Regions of the target images, from ground truth alone."""

    covisible: Bool[Tensor, "p h w"]
    """Pixels whose surface the input shows."""
    hidden: HiddenPixels
    """Pixels whose surface it does not show."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedImages:
    """Predicted and true images, and their regions."""

    rgb: Float[Tensor, "p h w 3"]
    truth: Float[Tensor, "p h w 3"]
    regions: TrueRegions | None
    """None without true depth."""


def true_regions(sample: EvalSample) -> TrueRegions | None:
    """Regions of the target images; None for clips without depth."""
    covisible = covisible_masks(sample)
    if covisible is None:
        return None
    return TrueRegions(covisible=covisible, hidden=hidden_pixels(sample, covisible))


def region_entries(
    row: str, images: ComparedImages, features: PerceptualFeatures | None
) -> list[Score | Skip]:
    """Metrics of all regions; skipped without true depth."""
    if images.regions is None:
        return [Skip(row=row, key=key, why="the clip has no depth") for key in KEYS]
    seen = images.regions.covisible
    entries = [
        score(row, "covisible_psnr", masked_psnr(images.rgb, images.truth, seen).tolist()),
        score(row, "covisible_share", seen.double().mean((-2, -1)).tolist()),
    ]
    for region, mask in images.regions.hidden.regions.items():
        error = masked_psnr(images.rgb, images.truth, mask)
        entries.append(score(row, f"{region}_share", mask.double().mean((-2, -1)).tolist()))
        entries.append(score(row, f"{region}_psnr", error.tolist()))
        if features is not None:
            distance = masked_distance(images, mask, features)
            entries.append(score(row, f"{region}_perceptual", distance.tolist()))
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
def masked_distance(
    images: ComparedImages, mask: Bool[Tensor, "p h w"], features: PerceptualFeatures
) -> Float[Tensor, " p"]:
    """Perceptual distance of the true image whose pixels in ``mask`` alone are the predicted ones.

    NaN for images with too few such pixels.
    """
    enough = mask.sum((-2, -1)) >= MIN_PIXELS
    distances = torch.full((len(mask),), math.nan)
    if bool(enough.any()):
        truth = images.truth[enough]
        only_masked = torch.where(mask[enough, ..., None], images.rgb[enough], truth)
        distances[enough] = perceptual_distance(only_masked, truth, features)
    return distances
