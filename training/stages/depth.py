"""The depth of single pictures: every picture of a clip is one, and no scene is rendered.

    pictures of a clip, in another light ─ picture depth ─ log depth ─┐
    their true depths, each in its own unit ──────────────────────────┴─ losses

A picture has no scale: its median depth is where models put the plane. Sky is farther than
anything else, no matter how far.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from diff4splat.io.pixels import unit_rgb
from diff4splat.metrics.depth import depth_pearson
from diff4splat.metrics.masked import masked_mean, mean_or_nan
from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.models.factory import Networks
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.models.ldrm.refinement.motion_features import key_depth
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.losses.log_depth import edge_error, own_scale
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.model_stage import ModelStage, StagePlan
from diff4splat.training.stages.panels import panel

Terms = Mapping[str, Float[Tensor, " b"]]
SKY_DEPTH = 10 * PLANE_DEPTH
"""What has no depth is at least as far."""
GAMMA, GAIN = 0.25, 0.15
"""Half the range of the logarithms of exponent and factor of a channel's light."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthPictures:
    """Pictures and their depths, ``p`` of every sample."""

    rgb: Float[Tensor, "n 3 h w"]
    depth: Float[Tensor, "n h w"]
    """In the picture's own unit; 1 where it is not known."""
    known: Bool[Tensor, "n h w"]


class DepthStage(ModelStage):
    """One network of the reconstruction."""

    parts = ("ldrm",)

    def __init__(self, networks: Networks, plan: StagePlan) -> None:
        super().__init__(networks, plan)
        self.ldrm.requires_grad_(False)
        self.ldrm.detail.picture_depth.requires_grad_(True)

    def compilable(self) -> tuple[nn.Module, ...]:
        """The one network."""
        return (self.ldrm.detail.picture_depth,)

    def forward(self, batch: ClipBatch) -> Terms:
        """The terms ``depth_log``, ``depth_edges``, ``depth_shift`` and ``sky``."""
        shown, weights = depth_pictures(batch), self.plan.recipe.losses
        log_depth = self.log_depth(self._in_other_light(shown.rgb, batch))
        difference = log_depth - shown.depth.log()
        too_near = (math.log(SKY_DEPTH) - log_depth).clamp_min(0)
        terms = {
            "depth_log": masked_mean(difference.abs().flatten(1), shown.known.flatten(1)),
            "depth_edges": edge_error(difference, shown.known),
            "depth_shift": _shift_error(log_depth, shown),
            "sky": masked_mean(too_near.flatten(1), ~shown.known.flatten(1)),
        }
        terms = {name: _by_sample(term, batch) for name, term in terms.items()}
        return terms | {TOTAL: sum(getattr(weights, name) * term for name, term in terms.items())}

    def log_depth(self, rgb: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "n h w"]:
        """Logarithm of the depth z of every pixel."""
        raw = self.ldrm.detail.picture_depth(rgb)
        with torch.autocast(rgb.device.type, enabled=False):
            return key_depth(raw.float(), self.plan.model.activation)[:, 0].log()

    def _in_other_light(
        self, rgb: Float[Tensor, "n 3 h w"], batch: ClipBatch
    ) -> Float[Tensor, "n 3 h w"]:
        """Every picture with a gamma and gains of its own: depth is not a matter of colour."""
        count = len(rgb) // len(batch)
        draws = [torch.rand(count, 4, generator=own) for own in self.draw(batch, "light")]
        spread = 2 * torch.cat(draws).to(rgb)[:, :, None, None] - 1
        gamma, gain = (GAMMA * spread[:, :1]).exp(), (GAIN * spread[:, 1:]).exp()
        return (rgb.clamp_min(1e-3) ** gamma * gain).clamp(0, 1)

    @torch.no_grad()
    def measure(self, batch: ClipBatch) -> Terms:
        """``depth_correlation``, and ``depth_error``: the mean of |log depth − log truth|."""
        shown = depth_pictures(batch)
        log_depth, known = self.log_depth(shown.rgb), shown.known
        error = (log_depth - shown.depth.log()).abs()
        found = {
            "depth_error": mean_or_nan(error.flatten(1), known.flatten(1)),
            "depth_correlation": depth_pearson(log_depth.exp(), shown.depth, known),
        }
        return {name: _by_sample(values, batch) for name, values in found.items()}

    @torch.no_grad()
    def panel(self, batch: ClipBatch) -> Float[Tensor, "h w 3"]:
        """Pictures, their depths, and what is told of them: near is bright."""
        shown = depth_pictures(batch)
        told = self.log_depth(shown.rgb)
        return panel(
            [
                ("picture", list(shown.rgb.movedim(1, -1).cpu())),
                ("true depth", _tinted(shown.depth.log(), shown.known)),
                ("depth", _tinted(told, torch.ones_like(shown.known))),
            ]
        )


def depth_pictures(batch: ClipBatch) -> DepthPictures:
    """Key frames and targets of every sample, those of one sample after another."""
    rgb = torch.cat([batch.video[:, ::TIME_STRIDE], batch.target_rgb.flatten(1, 2)], 1)
    depth = torch.cat([batch.depth, batch.target_depth.flatten(1, 2)], 1)
    scaled, known = own_scale(depth.flatten(0, 1), PLANE_DEPTH)
    pictures = unit_rgb(rgb.flatten(0, 1)).movedim(-1, 1)
    return DepthPictures(rgb=pictures, depth=scaled, known=known)


def _shift_error(log_depth: Float[Tensor, "n h w"], shown: DepthPictures) -> Float[Tensor, " n"]:
    """Difference of PLANE_DEPTH / depth, where a truth is known."""
    told, true = PLANE_DEPTH * (-log_depth).exp(), PLANE_DEPTH / shown.depth
    return masked_mean((told - true).abs().flatten(1), shown.known.flatten(1))


def _by_sample(values: Float[Tensor, " n"], batch: ClipBatch) -> Float[Tensor, " b"]:
    return values.unflatten(0, (len(batch), -1)).nanmean(1)


def _tinted(log_depth: Float[Tensor, "n h w"], known: Bool[Tensor, "n h w"]) -> list[Tensor]:
    near = torch.sigmoid(math.log(PLANE_DEPTH) - log_depth)
    return list(torch.where(known, near, 0.0)[..., None].expand(-1, -1, -1, 3).cpu())
