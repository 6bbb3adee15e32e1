"""Gaussians of steep surfaces, sheared along the ray until they lie in them (ours, ADR 56).

Axes: ``h w`` cells of a layer, ``n`` its valid cells, ``m`` those that are steep. Round Gaussians
of neighbouring cells part as soon as a camera from beside sees a steep surface. A shear by the
slope k along the unit ray r, in the direction w across it in which the surface recedes,

    x → x + k r (w · x),   σ = (k + √(k² + 4)) / 2,
    axes  (w + σ r) / √(1 + σ²),  (σ w − r) / √(1 + σ²),  w × r   with scales σ, 1 / σ, 1,

moves along the ray alone: the input view sees what it saw. What moves stays round: displacements
turn no Gaussian.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import normalize

from diff4splat.generation.layered_image.types import DEPTH_STEP, ImageLayer, moving_mask
from diff4splat.geometry import quaternion
from diff4splat.geometry.rays import camera_rays, world_rays
from diff4splat.scene.gaussians import Gaussians

LEAST_SLOPE = 2.0
"""Tangent of the angle to a plane that faces the ray, from which Gaussians are sheared: from 15
degrees beside, less steep cells lie close enough. Sheared ones take more bytes in a file."""


def in_steep_surface(gaussians: Gaussians, layer: ImageLayer) -> Gaussians:
    """The round ``gaussians`` of the valid cells of ``layer``, sheared where it is steep."""
    slope, direction = _slopes(layer)
    _, rays = world_rays(layer.camera)
    steep = (slope > LEAST_SLOPE) & ~moving_mask(layer.depth, layer.displacement)
    found, chosen = layer.mask & steep, steep[layer.mask]
    quats, factors = _shear(slope[found], direction[found], rays[found])
    scales, rotations = gaussians.scales.clone(), gaussians.quats.clone()
    scales[chosen], rotations[chosen] = scales[chosen] * factors, quats
    return replace(gaussians, scales=scales, quats=rotations)


def _shear(
    slope: Float[Tensor, " m"], direction: Float[Tensor, "m 3"], rays: Float[Tensor, "m 3"]
) -> tuple[Float[Tensor, "m 4"], Float[Tensor, "m 3"]]:
    """Rotation and factors of the scales of a round Gaussian after the shear."""
    across = normalize(direction - (direction * rays).sum(-1, keepdim=True) * rays, dim=-1)
    stretch = ((slope + (slope.square() + 4).sqrt()) / 2)[:, None]
    length = (1 + stretch.square()).sqrt()
    long, short = (across + stretch * rays) / length, (stretch * across - rays) / length
    axes = torch.stack([long, short, torch.linalg.cross(long, short)], -1)
    factors = torch.cat([stretch, 1 / stretch, torch.ones_like(stretch)], -1)
    return quaternion.from_matrix(axes), factors


def _slopes(layer: ImageLayer) -> tuple[Float[Tensor, "h w"], Float[Tensor, "h w 3"]]:
    """Slope against the ray, and the direction in space in which log depth grows."""
    log_depth = layer.depth.log()
    growth = torch.stack([_change(log_depth), _change(log_depth.mT).mT], -1)
    growth = growth * layer.camera.focal_px
    slope = growth.norm(dim=-1) * camera_rays(layer.camera).norm(dim=-1)
    return slope, growth @ layer.camera.world_from_camera[:3, :2].mT


def _change(log_depth: Float[Tensor, "h w"]) -> Float[Tensor, "h w"]:
    """From cell to cell of a row: the smaller of both sides, and none beside an edge or a ridge."""
    if log_depth.shape[1] < 2:
        return torch.zeros_like(log_depth)
    step = log_depth.diff(dim=1)
    before, after = torch.cat([step[:, :1], step], 1), torch.cat([step, step[:, -1:]], 1)
    smaller = torch.where(before.abs() < after.abs(), before, after)
    goes_on = (before * after > 0) & (smaller.abs() < DEPTH_STEP)
    return smaller.where(goes_on, 0.0)
