"""Colour and depth metrics of the target images.

Axes: ``p`` target images, ``h w`` pixels. A constant depth map has no correlation, and an image
without true depth has no depth error: means skip and count both.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.evaluation.columns import PSNR_CAP_DB
from diff4splat.evaluation.measures.regions import ComparedImages, TrueRegions, region_entries
from diff4splat.evaluation.protocols.sample import EvalSample
from diff4splat.evaluation.records import Embedding, Score, Skip, score
from diff4splat.evaluation.systems.predictions import Prediction, RenderedView
from diff4splat.metrics.depth import depth_pearson, relative_error
from diff4splat.metrics.features.protocol import PerceptualFeatures
from diff4splat.metrics.image import psnr
from diff4splat.metrics.perceptual import perceptual_distance
from diff4splat.metrics.ssim import ssim
from diff4splat.training.batches.normalise_scale import valid_depth

Entries = list[Score | Skip | Embedding]


def image_entries(
    row: str,
    sample: EvalSample,
    views: list[RenderedView],
    regions: TrueRegions | None,
    features: PerceptualFeatures | None,
) -> Entries:
    """Colour and depth metrics of the target images of one prediction; empty without images."""
    if not views:
        return []
    rgb, truth = stacked_rgb(views), true_images(sample)
    entries = [
        score(row, "psnr", psnr(rgb, truth).clamp_max(PSNR_CAP_DB).tolist()),
        *region_entries(row, ComparedImages(rgb=rgb, truth=truth, regions=regions), features),
        score(row, "ssim", ssim(rgb, truth).tolist()),
    ]
    if features is not None:
        with torch.no_grad():
            distances = perceptual_distance(rgb, truth, features)
        entries.append(score(row, "perceptual", distances.tolist()))
    return entries + _depth_entries(row, sample, views)


def target_views(sample: EvalSample, prediction: Prediction) -> list[RenderedView]:
    """Every target image of a prediction; none if it has no images."""
    views = (
        prediction.render(sample.camera(pair), sample.time_s(pair[1]), pair[1])
        for pair in sample.targets.pairs
    )
    return [view for view in views if view is not None]


def stacked_rgb(views: list[RenderedView]) -> Float[Tensor, "p h w 3"]:
    """Colours of rendered views."""
    return torch.stack([view.rgb.cpu().float() for view in views])


def true_images(sample: EvalSample) -> Float[Tensor, "p h w 3"]:
    """The target images."""
    return torch.stack([sample.true_rgb(pair) for pair in sample.targets.pairs])


def _depth_entries(row: str, sample: EvalSample, views: list[RenderedView]) -> Entries:
    if any(view.depth is None for view in views):
        return []
    if not sample.has_depth:
        return [
            Skip(row=row, key=key, why="the clip has no depth")
            for key in ("depth_pearson", "depth_absrel")
        ]
    depth = torch.stack([view.depth.cpu().float() for view in views])
    truth = torch.stack([sample.true_depth(pair) for pair in sample.targets.pairs])
    valid = valid_depth(truth)
    return [
        score(row, "depth_pearson", depth_pearson(depth, truth, valid).tolist()),
        score(row, "depth_absrel", relative_error(depth, truth, valid).tolist()),
    ]
