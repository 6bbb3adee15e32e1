"""Depth of single images: every frame of a clip is one sample, and nothing is rendered.

    frames of a clip, with random colours ─ depth network ─ log depth ─┐
    their true depths, each in its own unit ───────────────────────────┴─ losses

An image has no scale: its median depth becomes the depth of the plane prior. The sky is farther
than everything else.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from diff4splat.io.pixels import unit_rgb
from diff4splat.metrics.depth import depth_pearson
from diff4splat.metrics.masked import masked_mean, mean_or_nan
from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.losses.log_depth import gradient_error, inverse_depth_error, rescale_median
from diff4splat.training.stages.loss_terms import LossTerm, weighted_sum
from diff4splat.training.stages.model_stage import ModelStage, Terms
from diff4splat.training.stages.previews import depth_preview
from diff4splat.training.stages.scene_prediction import log_depth

SKY_DEPTH = 10 * PLANE_DEPTH
"""Pixels without depth are at least as far."""
GAMMA, GAIN = 0.25, 0.15
"""Half the range of the logarithms of exponent and factor of a channel."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthImages:
    """Images and their depths, the same number of every sample."""

    rgb: Float[Tensor, "n 3 h w"]
    depth: Float[Tensor, "n h w"]
    """In the image's own unit; 1 where it is not known."""
    known: Bool[Tensor, "n h w"]


class MonocularDepthStage(ModelStage):
    """The depth network alone."""

    parts = ("monocular_depth",)

    def compilable(self) -> tuple[nn.Module, ...]:
        """The depth network."""
        return (self.monocular_depth,)

    def forward(self, batch: ClipBatch) -> Terms:
        """The terms ``depth_log``, ``depth_gradient``, ``inverse_depth`` and ``sky_margin``."""
        images, weights = depth_images(batch), self.plan.recipe.losses
        predicted = self.log_depth(self._random_colors(images.rgb, batch))
        terms = depth_terms(predicted, images)
        return weighted_sum(
            [
                LossTerm(
                    name=name,
                    weight=getattr(weights, name),
                    compute=lambda value=value: _per_sample(value, batch),
                )
                for name, value in terms.items()
            ]
        )

    def log_depth(self, rgb: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "n h w"]:
        """Logarithm of the depth z of every pixel."""
        raw = self.monocular_depth(rgb)
        with torch.autocast(rgb.device.type, enabled=False):
            return log_depth(raw, self.plan.model)

    def _random_colors(
        self, rgb: Float[Tensor, "n 3 h w"], batch: ClipBatch
    ) -> Float[Tensor, "n 3 h w"]:
        """Every image with a random gamma and random gains: depth does not follow from colour."""
        count, generators = len(rgb) // len(batch), self.random.per_sample(batch, "light")
        draws = [torch.rand(count, 4, generator=own) for own in generators]
        spread = 2 * torch.cat(draws).to(rgb)[:, :, None, None] - 1
        gamma, gain = (GAMMA * spread[:, :1]).exp(), (GAIN * spread[:, 1:]).exp()
        return (rgb.clamp_min(1e-3) ** gamma * gain).clamp(0, 1)

    @torch.no_grad()
    def measure(self, batch: ClipBatch) -> Terms:
        """``depth_correlation``, and ``depth_error``: the mean of |log depth − log truth|."""
        images = depth_images(batch)
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
        images = depth_images(batch)
        truth = torch.where(images.known, images.depth.log(), math.inf)
        return depth_preview(images.rgb, truth, self.log_depth(images.rgb))


def depth_images(batch: ClipBatch) -> DepthImages:
    """Keyframes and targets of every sample, those of one sample after another."""
    rgb = torch.cat([batch.video[:, ::TIME_STRIDE], batch.target_rgb.flatten(1, 2)], 1)
    depth = torch.cat([batch.depth, batch.target_depth.flatten(1, 2)], 1)
    scaled, known = rescale_median(depth.flatten(0, 1), PLANE_DEPTH)
    images = unit_rgb(rgb.flatten(0, 1)).movedim(-1, 1)
    return DepthImages(rgb=images, depth=scaled, known=known)


def depth_terms(
    log_depth: Float[Tensor, "n h w"], images: DepthImages
) -> dict[str, Float[Tensor, " n"]]:
    """Every loss of every image."""
    known, difference = images.known, log_depth - images.depth.log()
    too_near = (math.log(SKY_DEPTH) - log_depth).clamp_min(0)
    return {
        "depth_log": masked_mean(difference.abs().flatten(1), known.flatten(1)),
        "depth_gradient": gradient_error(difference, known),
        "inverse_depth": inverse_depth_error(log_depth, images.depth, known, PLANE_DEPTH),
        "sky_margin": masked_mean(too_near.flatten(1), ~known.flatten(1)),
    }


def _per_sample(values: Float[Tensor, " n"], batch: ClipBatch) -> Float[Tensor, " b"]:
    return values.unflatten(0, (len(batch), -1)).nanmean(1)
