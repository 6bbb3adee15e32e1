"""More Gaussians where the picture pulls at them, none where they are not seen.

Axes: ``n`` Gaussians. The pull of a step is |∂L/∂mean| · z · (picture width / 2) / focal length, z
meaned over the pictures of the step: the gradient of the loss in half pictures, as Kerbl et al.
2023 measure it, without a renderer that tells it (3DGRT, arXiv 2407.07090). Where rays make the
picture it is |∂L/∂mean| · distance · half the picture in radians, and the mean is the canonical
one: the same numbers near the optical axis. Splitting replaces one
Gaussian by two of 0.6 of its deviation along its longest axis, or along time, 0.8 deviations to
both sides: 0.6² + 0.8² = 1, so mean and covariance of the pair are those of the one.
"""

import math
from collections.abc import Mapping

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.fitting.model import SceneModel
from diff4splat.fitting.motions.spacetime import HALF, SHIFT
from diff4splat.fitting.settings import Density
from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import Camera


class Pull:
    """Mean pull on each Gaussian over the pictures that show it."""

    def __init__(self, count: int) -> None:
        self.total, self.seen = torch.zeros(count), torch.zeros(count)

    def add(self, means: Float[Tensor, "n 3"], half_pictures: Float[Tensor, " n"]) -> None:
        """Take the gradient that one step left at ``means``, where half a picture is so long."""
        gradient = means.grad
        if gradient is None:
            return
        pull = gradient.norm(dim=-1) * half_pictures
        self.total += pull
        self.seen += pull > 0

    def forget(self, count: int | None = None) -> None:
        """Start again, for ``count`` Gaussians if their number changed."""
        self.__init__(len(self.total) if count is None else count)

    def mean(self) -> Float[Tensor, " n"]:
        """0 for what no picture showed."""
        return self.total / self.seen.clamp_min(1)


def flat_half_pictures(places: Float[Tensor, "n 3"], cameras: Camera) -> Float[Tensor, " n"]:
    """Scene units per half picture at each place, meaned over pinhole cameras."""
    poses = cameras.world_from_camera.to(places)
    toward = places - poses[:, None, :3, 3]
    z = (toward * poses[:, None, :3, 2]).sum(-1).clamp_min(0).mean(0)
    return z * (0.5 * cameras.size_px[1] / float(cameras.focal_px[:, 0].mean()))


def grow_and_prune(
    model: SceneModel, pull: Float[Tensor, " n"], settings: Density, generator: torch.Generator
) -> tuple[int, int]:
    """Drop faint Gaussians, split those pulled most; returns how many were dropped and split."""
    opacities = model.table["opacity_logits"].detach().sigmoid()
    finite = torch.isfinite(model.table["means"].detach()).all(-1)
    kept = (opacities >= settings.min_opacity) & finite
    if not bool(kept.any()):
        kept[opacities.argmax()] = True
    model.keep(kept)
    dropped, pull = int((~kept).sum()), pull[kept]
    room = min(settings.budget - len(model), int(settings.growth * len(model)) + 1)
    wanted = int((pull > settings.min_gradient).sum())
    count = max(min(room, wanted), 0)
    if count:
        split(model, pull.topk(count).indices, generator)
    return dropped, count


def split(model: SceneModel, index: Int[Tensor, " m"], generator: torch.Generator) -> None:
    """Two Gaussians in place of each at ``index``; half of the moving ones are split in time."""
    rows, moves = model.rows(index), model.moves[index]
    in_time = moves & (torch.rand(len(index), generator=generator) < 0.5)
    halves = model.learned.split_in_time(rows, in_time, generator)
    if halves is None:
        in_time = torch.zeros_like(in_time)
        halves = (rows, rows)
    first, second = _split_in_space(halves, rows, ~in_time)
    model.table.rewrite(index, first)
    model.append(second, moves)


def _split_in_space(
    halves: tuple[Mapping[str, Tensor], Mapping[str, Tensor]],
    rows: Mapping[str, Tensor],
    chosen: Tensor,
) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
    """Shift and narrow the chosen rows along their longest axis."""
    longest = rows["log_scales"].argmax(-1, keepdim=True)
    deviation = rows["log_scales"].gather(1, longest).exp()
    unit = torch.zeros_like(rows["log_scales"]).scatter(1, longest, SHIFT * deviation)
    shift = quaternion.rotate(quaternion.normalize(rows["quats"]), unit)
    shift = torch.where(chosen[:, None], shift, 0.0)
    narrower = torch.zeros_like(rows["log_scales"]).scatter(1, longest, math.log(HALF))
    narrower = torch.where(chosen[:, None], narrower, 0.0)
    made = []
    for side, half in zip((-1.0, 1.0), halves, strict=True):
        moved = dict(half)
        moved["means"] = half["means"] + side * shift
        moved["log_scales"] = half["log_scales"] + narrower
        made.append(moved)
    return made[0], made[1]
