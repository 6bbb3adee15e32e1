"""Depth of single images: every frame of a clip is one sample, and nothing is rendered.

    frames of a clip, with random colours ─ depth network ─ log depth ─┐
    their true depths, each in its own unit ───────────────────────────┴─ losses

An image has no scale: its median depth becomes the depth of the plane prior. The sky is farther
than everything else.
"""

import math
from dataclasses import replace
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.io.pixels import unit_rgb
from diff4splat.metrics.depth import depth_pearson
from diff4splat.metrics.masked import masked_mean, mean_or_nan
from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.models.networks import Networks
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.batches.random_images.cutouts import read_cutouts
from diff4splat.training.batches.random_images.photographs import read_photographs
from diff4splat.training.batches.random_images.random_cutouts import CUTOUT_DRAWS, with_cutouts
from diff4splat.training.batches.random_images.random_sky import SKY_DRAWS, random_sky
from diff4splat.training.batches.random_images.random_views import (
    DRAWS,
    PHOTO_DRAWS,
    DepthImages,
    depth_images,
    random_photo,
    random_views,
)
from diff4splat.training.losses.log_depth import (
    gradient_error,
    inverse_depth_error,
    laplace_error,
)
from diff4splat.training.stages.loss_terms import LossTerm, weighted_sum
from diff4splat.training.stages.model_stage import ModelStage, StagePlan, Terms
from diff4splat.training.stages.photo_windows import window_difference
from diff4splat.training.stages.previews import depth_preview
from diff4splat.training.stages.scene_prediction import log_depth

SKY_DEPTH = 10 * PLANE_DEPTH
"""Pixels without depth are at least as far."""
GAMMA, GAIN = 0.4, 0.24
"""Half the range of the logarithms of exponent and factor of a channel."""


class MonocularDepthStage(ModelStage):
    """The depth network alone."""

    parts = ("monocular_depth",)

    def __init__(self, networks: Networks, plan: StagePlan) -> None:
        super().__init__(networks, plan)
        # Processors differentiate depthwise convolutions faster so.
        self.monocular_depth.to(memory_format=torch.channels_last)
        data, weight = plan.recipe.data, plan.recipe.losses.window_consistency
        self.cutouts = read_cutouts(Path(data.cutouts)) if data.cutouts else None
        self.photographs = None
        if weight:
            side_px = max(data.view_sides_px or data.size_px)
            self.photographs = read_photographs(Path(data.photographs), side_px)

    def compilable(self) -> tuple[nn.Module, ...]:
        """The depth network."""
        return (self.monocular_depth,)

    def forward(self, batch: ClipBatch) -> Terms:
        """The terms ``depth_log``, ``depth_gradient``, ``inverse_depth`` and ``sky_margin``.

        With a weight also ``uncertainty`` and ``window_consistency``.
        """
        images, weights = self._views(batch), self.plan.recipe.losses
        rgb, values = self._random_colors(images.rgb, batch), {}
        if weights.uncertainty:
            predicted, log_scale = self.depth_and_uncertainty(rgb)
            difference = predicted - images.depth.log()
            values["uncertainty"] = laplace_error(difference, log_scale, images.known)
        else:
            predicted = self.log_depth(rgb)
        values |= depth_terms(predicted, images)
        terms = {
            name: lambda value=value: _per_sample(value, batch) for name, value in values.items()
        }
        if self.photographs is not None:
            terms["window_consistency"] = lambda: self._window_consistency(batch, images)
        return weighted_sum(
            [
                LossTerm(name=name, weight=getattr(weights, name), compute=compute)
                for name, compute in terms.items()
            ]
        )

    def _window_consistency(self, batch: ClipBatch, images: DepthImages) -> Float[Tensor, " b"]:
        """One photograph per sample: its window, as large as the views, against the whole."""
        draws = self._draws(batch, "photograph", len(batch), 1 + DRAWS).to(images.rgb)
        chosen = (draws[:, 0] * len(self.photographs)).long().cpu()
        photographs = unit_rgb(self.photographs[chosen].to(images.rgb.device))
        return window_difference(
            self.log_depth,
            photographs,
            images.rgb.shape[2:],
            draws[:, 1:],
            lambda rgb: self._random_colors(rgb, batch, "window light"),
        )

    def log_depth(self, rgb: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "n h w"]:
        """Logarithm of the depth z of every pixel."""
        raw = self.monocular_depth(rgb.contiguous(memory_format=torch.channels_last))
        with torch.autocast(rgb.device.type, enabled=False):
            return log_depth(raw, self.plan.model)

    def depth_and_uncertainty(
        self, rgb: Float[Tensor, "n 3 h w"]
    ) -> tuple[Float[Tensor, "n h w"], Float[Tensor, "n h w"]]:
        """The same, and the logarithm of how far off it may be."""
        rgb = rgb.contiguous(memory_format=torch.channels_last)
        raw, log_scale = self.monocular_depth.predict_distance_and_uncertainty(rgb)
        with torch.autocast(rgb.device.type, enabled=False):
            depth = log_depth(raw.float().mean(1, keepdim=True), self.plan.model)
            return depth, log_scale[:, 0].float()

    def _views(self, batch: ClipBatch) -> DepthImages:
        """Every image whole, or a random view of it where the recipe names sides of views."""
        images, sides = batch_images(batch), self.plan.recipe.data.view_sides_px
        if not sides:
            return images
        generator = self.random.per_step(batch, "view size")
        height, width = (
            sides[int(i)] for i in torch.randint(len(sides), (2,), generator=generator)
        )
        count = DRAWS + PHOTO_DRAWS + SKY_DRAWS
        draws = self._draws(batch, "view", len(images.rgb), count).to(images.rgb)
        view, photo, sky = draws.split([DRAWS, PHOTO_DRAWS, SKY_DRAWS], 1)
        views = random_views(images, (height, width), view)
        if self.cutouts is not None:
            draws = self._draws(batch, "cutout", len(images.rgb), CUTOUT_DRAWS).to(images.rgb)
            views = with_cutouts(views, self.cutouts, draws)
        noise = torch.randn(views.rgb.shape, generator=self.random.per_step(batch, "noise"))
        rgb = random_sky(views.rgb, views.known, sky)
        return replace(views, rgb=random_photo(rgb, photo, noise.to(rgb)))

    def _draws(
        self, batch: ClipBatch, purpose: str, images: int, count: int
    ) -> Float[Tensor, "n c"]:
        """Uniform numbers for every image."""
        generators = self.random.per_sample(batch, purpose)
        rows = [torch.rand(images // len(batch), count, generator=own) for own in generators]
        return torch.cat(rows)

    def _random_colors(
        self, rgb: Float[Tensor, "n 3 h w"], batch: ClipBatch, purpose: str = "light"
    ) -> Float[Tensor, "n 3 h w"]:
        """Every image with a random gamma and random gains: depth does not follow from colour."""
        spread = 2 * self._draws(batch, purpose, len(rgb), 4).to(rgb)[:, :, None, None] - 1
        gamma, gain = (GAMMA * spread[:, :1]).exp(), (GAIN * spread[:, 1:]).exp()
        return (rgb.clamp_min(1e-3) ** gamma * gain).clamp(0, 1)

    @torch.no_grad()
    def measure(self, batch: ClipBatch) -> Terms:
        """``depth_correlation``, and ``depth_error``: the mean of |log depth − log truth|."""
        images = batch_images(batch)
        predicted, known = self.log_depth(images.rgb), images.known
        error = (predicted - images.depth.log()).abs()
        values = {
            "depth_error": mean_or_nan(error.flatten(1), known.flatten(1)),
            "depth_correlation": depth_pearson(predicted.exp(), images.depth, known),
        }
        return {name: _per_sample(value, batch) for name, value in values.items()}

    @torch.no_grad()
    def panel(self, batch: ClipBatch) -> Float[Tensor, "h w 3"]:
        """Images, true depths and predicted depths."""
        images = batch_images(batch)
        truth = torch.where(images.known, images.depth.log(), math.inf)
        return depth_preview(images.rgb, truth, self.log_depth(images.rgb))


def batch_images(batch: ClipBatch) -> DepthImages:
    """Keyframes and targets of every sample, those of one sample after another."""
    rgb = torch.cat([batch.video[:, ::TIME_STRIDE], batch.target_rgb.flatten(1, 2)], 1)
    depth = torch.cat([batch.depth, batch.target_depth.flatten(1, 2)], 1)
    return depth_images(unit_rgb(rgb.flatten(0, 1)).movedim(-1, 1), depth.flatten(0, 1))


def depth_terms(
    log_depth: Float[Tensor, "n h w"], images: DepthImages
) -> dict[str, Float[Tensor, " n"]]:
    """Every loss of every image."""
    known, difference = images.known, log_depth - images.depth.log()
    # Without any depth nothing tells sky from the rest.
    sky = ~known & known.flatten(1).any(1)[:, None, None]
    too_near = (math.log(SKY_DEPTH) - log_depth).clamp_min(0)
    return {
        "depth_log": masked_mean(difference.abs().flatten(1), known.flatten(1)),
        "depth_gradient": gradient_error(difference, known),
        "inverse_depth": inverse_depth_error(log_depth, images.depth, known, PLANE_DEPTH),
        "sky_margin": masked_mean(too_near.flatten(1), sky.flatten(1)),
    }


def _per_sample(values: Float[Tensor, " n"], batch: ClipBatch) -> Float[Tensor, " b"]:
    return values.unflatten(0, (len(batch), -1)).nanmean(1)
