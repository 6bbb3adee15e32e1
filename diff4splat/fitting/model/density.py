"""Density control: splits Gaussians with large gradients and removes transparent ones.

Axes: ``n`` Gaussians. A split replaces one Gaussian by two with 0.6 of its standard deviation along
its longest axis, or along time, shifted by ±0.8 deviations. 0.6² + 0.8² = 1, so the pair has the
mean and covariance of the original.
"""

import math
from collections.abc import Mapping

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.fitting.model.scene_model import SceneModel
from diff4splat.fitting.motions.spacetime import SPLIT_DEVIATION, SPLIT_SHIFT
from diff4splat.fitting.settings import DensitySettings
from diff4splat.geometry import quaternion


def densify_and_prune(
    model: SceneModel,
    mean_gradient: Float[Tensor, " n"],
    settings: DensitySettings,
    generator: torch.Generator,
) -> tuple[int, int]:
    """Remove transparent Gaussians, split those with the largest gradients; returns both counts."""
    keep = _opaque(model, settings.min_opacity)
    model.keep(keep)
    removed, mean_gradient = int((~keep).sum()), mean_gradient[keep]
    limit = min(settings.budget - len(model), int(settings.growth * len(model)) + 1)
    candidates = int((mean_gradient > settings.min_gradient).sum())
    count = max(min(limit, candidates), 0)
    if count:
        split(model, mean_gradient.topk(count).indices, generator)
    return removed, count


def split(model: SceneModel, index: Int[Tensor, " m"], generator: torch.Generator) -> None:
    """Replace each Gaussian at ``index`` by two; a random half of the moving ones split in time."""
    rows, moving = model.rows(index), model.moving_mask[index]
    in_time = moving & (torch.rand(len(index), generator=generator) < 0.5)
    halves = model.learned_motion.split_in_time(rows, in_time, generator)
    if halves is None:
        in_time = torch.zeros_like(in_time)
        halves = (rows, rows)
    first, second = _split_in_space(halves, rows, ~in_time)
    model.table.rewrite(index, first)
    model.append(second, moving)


def _opaque(model: SceneModel, min_opacity: float) -> Bool[Tensor, " n"]:
    """Finite Gaussians above ``min_opacity``; at least the most opaque one."""
    opacities = model.table["opacity_logits"].detach().sigmoid()
    finite = torch.isfinite(model.table["means"].detach()).all(-1)
    keep = (opacities >= min_opacity) & finite
    if not bool(keep.any()):
        keep[opacities.argmax()] = True
    return keep


def _split_in_space(
    halves: tuple[Mapping[str, Tensor], Mapping[str, Tensor]],
    rows: Mapping[str, Tensor],
    selected: Tensor,
) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
    """Shift and shrink the selected rows along their longest axis."""
    longest = rows["log_scales"].argmax(-1, keepdim=True)
    deviation = rows["log_scales"].gather(1, longest).exp()
    local_shift = torch.zeros_like(rows["log_scales"]).scatter(1, longest, SPLIT_SHIFT * deviation)
    shift = quaternion.rotate(quaternion.normalize(rows["quats"]), local_shift)
    shift = torch.where(selected[:, None], shift, 0.0)
    shrink = torch.zeros_like(rows["log_scales"]).scatter(1, longest, math.log(SPLIT_DEVIATION))
    shrink = torch.where(selected[:, None], shrink, 0.0)
    pair = []
    for side, half in zip((-1.0, 1.0), halves, strict=True):
        shifted = dict(half)
        shifted["means"] = half["means"] + side * shift
        shifted["log_scales"] = half["log_scales"] + shrink
        pair.append(shifted)
    return pair[0], pair[1]
