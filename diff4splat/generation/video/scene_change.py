"""What photometric steps change of a reconstructed scene.

    block_depths  log distance from the key camera, one value per block of 8 × 8 cells, between
                  them bilinear: what one pixel alone cannot tell
    means         offset in model units
    scales        logarithm, so that 0 stays 0
    opacities     logit
    colors        first harmonic

Axes: ``n`` Gaussians; the first ``m`` have a cell; ``k h w`` key frames, rows and columns of cells.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import ceil

import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn import functional

from diff4splat.generation.video.canonical_scene import CanonicalScene
from diff4splat.geometry.camera import Camera
from diff4splat.scene.gaussians import Gaussians

RATES: Mapping[str, float] = {
    "block_depths": 0.01,
    "means": 0.01,
    "scales": 0.03,
    "opacities": 0.05,
    "colors": 0.05,
}
"""Learning rates of the first step, chosen on validation worlds."""
BLOCK_CELLS = 8
OPACITY_EPS = 1e-4
"""Opacities nearer to 0 or 1 count as this far from it: a logit must be finite."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CellRays:
    """From where each cell's Gaussian was placed."""

    origins: Float[Tensor, "m 3"]
    """Positions of the cells' cameras."""
    cell_index: Int[Tensor, " m"]
    grid: tuple[int, int, int]
    """k, h and w."""


def cell_rays(scene: CanonicalScene, cameras: Camera) -> CellRays:
    """Rays of a scene whose key frames lie evenly among the video's ``cameras``."""
    count, height, width = scene.maps.gaussians.shape[2:]
    every = torch.linspace(0, len(cameras.world_from_camera) - 1, count).round().long()
    key = torch.div(scene.cell_index, height * width, rounding_mode="floor")
    return CellRays(
        origins=cameras.position[every.to(key.device)][key],
        cell_index=scene.cell_index,
        grid=(count, height, width),
    )


def zero_change(gaussians: Gaussians, rays: CellRays) -> dict[str, Tensor]:
    """No change, to be learnt; one tensor for each of ``RATES``."""
    count, *sides = rays.grid
    blocks = [ceil(side / BLOCK_CELLS) for side in sides]
    start = {
        "block_depths": gaussians.means.new_zeros(count, 1, *blocks),
        "means": torch.zeros_like(gaussians.means),
        "scales": torch.zeros_like(gaussians.scales),
        "opacities": torch.zeros_like(gaussians.opacities),
        "colors": torch.zeros_like(gaussians.sh[:, 0]),
    }
    return {name: value.requires_grad_() for name, value in start.items()}


def changed(gaussians: Gaussians, change: Mapping[str, Tensor], rays: CellRays) -> Gaussians:
    """The Gaussians with a change; differentiable in it."""
    farther = farther_cells(change["block_depths"], rays)
    cells = len(rays.cell_index)
    moved = rays.origins + (gaussians.means[:cells] - rays.origins) * farther
    means = torch.cat([moved, gaussians.means[cells:]]) + change["means"]
    growth = torch.cat([farther, farther.new_ones(len(gaussians) - cells, 1)])
    color = (gaussians.sh[:, 0] + change["colors"])[:, None]
    return replace(
        gaussians,
        means=means,
        scales=gaussians.scales * growth * change["scales"].exp(),
        opacities=torch.sigmoid(gaussians.opacities.logit(OPACITY_EPS) + change["opacities"]),
        sh=torch.cat([color, gaussians.sh[:, 1:]], 1),
    )


def farther_cells(block_depths: Float[Tensor, "k 1 _h _w"], rays: CellRays) -> Float[Tensor, "m 1"]:
    """Factor of each cell's distance from its camera."""
    fine = functional.interpolate(block_depths, rays.grid[1:], mode="bilinear", align_corners=False)
    return fine.flatten()[rays.cell_index, None].exp()
