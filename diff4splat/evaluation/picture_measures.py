"""Colour and depth of the judged pictures.

Axes: ``p`` judged pictures, ``h w`` pixels. A depth map that is constant has no correlation, and a
picture without true depth has no depth error: both are left out of means, and counted. So are
pictures of which the input shows next to nothing, where the error over what it shows is asked for.
"""

import math

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.evaluation.columns import PSNR_CAP_DB
from diff4splat.evaluation.predictions import Answer, Look
from diff4splat.evaluation.records import Score, Skip, score
from diff4splat.evaluation.sample import Case
from diff4splat.metrics.depth import depth_pearson, relative_error
from diff4splat.metrics.features.protocol import PerceptualFeatures
from diff4splat.metrics.image import psnr
from diff4splat.metrics.masked import mean_or_nan
from diff4splat.metrics.perceptual import perceptual_distance
from diff4splat.metrics.structure import ssim
from diff4splat.training.batches.normalise_scale import valid_depth

Entries = list[Score | Skip]
LEAST_SEEN_PX = 16
"""Fewer pixels that the input shows say nothing about a picture."""


def picture_entries(
    row: str,
    case: Case,
    answer: Answer,
    seen: Bool[Tensor, "p h w"] | None,
    features: PerceptualFeatures | None,
) -> Entries:
    """Every measure of colour and depth of one answer; none without looks.

    ``seen`` are the pixels that the input shows; None without true depth.
    """
    looks = [answer.look(case.camera(p), case.time_s(p[1]), p[1]) for p in case.judged.pairs]
    shown = [look for look in looks if look is not None]
    if not shown:
        return []
    rgb = torch.stack([look.rgb.cpu().float() for look in shown])
    truth = torch.stack([case.true_rgb(pair) for pair in case.judged.pairs])
    entries = [
        score(row, "psnr", psnr(rgb, truth).clamp_max(PSNR_CAP_DB).tolist()),
        *_seen_entries(row, rgb, truth, seen),
        score(row, "ssim", ssim(rgb, truth).tolist()),
    ]
    if features is not None:
        with torch.no_grad():
            distances = perceptual_distance(rgb, truth, features)
        entries.append(score(row, "perceptual", distances.tolist()))
    return entries + _depth_entries(row, case, shown)


def _seen_entries(
    row: str,
    rgb: Float[Tensor, "p h w 3"],
    truth: Float[Tensor, "p h w 3"],
    seen: Bool[Tensor, "p h w"] | None,
) -> Entries:
    if seen is None:
        return [
            Skip(row=row, key=key, why="the clip has no depth")
            for key in ("covisible_psnr", "covisible_share")
        ]
    return [
        score(row, "covisible_psnr", seen_psnr(rgb, truth, seen).tolist()),
        score(row, "covisible_share", seen.double().mean((-2, -1)).tolist()),
    ]


def seen_psnr(
    rgb: Float[Tensor, "p h w 3"], truth: Float[Tensor, "p h w 3"], seen: Bool[Tensor, "p h w"]
) -> Float[Tensor, " p"]:
    """PSNR over the pixels in ``seen``, capped; NaN for pictures with too few of them."""
    squares = (rgb - truth).square().mean(-1)
    error = mean_or_nan(squares.flatten(1), seen.flatten(1))
    enough = seen.sum((-2, -1)) >= LEAST_SEEN_PX
    return torch.where(enough, (-10 * error.log10()).clamp_max(PSNR_CAP_DB), math.nan)


def _depth_entries(row: str, case: Case, looks: list[Look]) -> Entries:
    if any(look.depth is None for look in looks):
        return []
    if not case.has_depth:
        return [
            Skip(row=row, key=key, why="the clip has no depth")
            for key in ("depth_pearson", "depth_absrel")
        ]
    depth = torch.stack([look.depth.cpu().float() for look in looks])
    truth = torch.stack([case.true_depth(pair) for pair in case.judged.pairs])
    known = valid_depth(truth)
    return [
        score(row, "depth_pearson", depth_pearson(depth, truth, known).tolist()),
        score(row, "depth_absrel", relative_error(depth, truth, known).tolist()),
    ]
