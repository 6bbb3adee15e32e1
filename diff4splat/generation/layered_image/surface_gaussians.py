"""Gaussians of an image's pixels that lie along its surface (ours, ADR 33).

Axes: ``h w`` cells of a layer, ``n`` Gaussians, those of its valid cells. A Gaussian that faces the
camera leaves gaps to its neighbours on a slanted surface when it is seen from another side. Spanned
by the steps of the surface from cell to cell, it has the same footprint in the image and none of
the gaps. Steps at depth edges are those of the smoother side.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.layered_image.types import DEPTH_STEP, ImageLayer
from diff4splat.geometry import quaternion
from diff4splat.geometry.rays import camera_rays
from diff4splat.scene.gaussians import Gaussians

SLOPE_UNIT = 2.0
"""Steps in depth, over those across the image, are multiples: few shapes make a small file."""
MOST_UNITS = 3
"""Steeper surfaces are as good as edges."""


@torch.no_grad()
def along_surface(gaussians: Gaussians, layer: ImageLayer) -> Gaussians:
    """Those of ``layer``'s valid cells, with the shape of the surface.

    A wall has spheres; the longer they are along the surface, the thinner across.
    """
    across, down = (steps[layer.mask] for steps in surface_steps(layer))
    axes, lengths = principal_axes(across, down)
    rotation = layer.camera.world_from_camera[:3, :3].to(axes) @ axes
    thickness = lengths.amin(-1).square() / lengths.amax(-1)
    size = layer.footprint_px * layer.depth[layer.mask]
    return replace(
        gaussians,
        quats=quaternion.from_matrix(rotation),
        scales=size[:, None] * torch.cat([lengths, thickness[:, None]], -1),
    )


def surface_steps(layer: ImageLayer) -> tuple[Float[Tensor, "h w 3"], Float[Tensor, "h w 3"]]:
    """From each cell to the next one to the right and below, over its depth, in camera axes.

    A point is z · ray, so a step is z · (ray · slope of log z + step of the ray).
    """
    rays, focal_px = camera_rays(layer.camera), layer.camera.focal_px
    log_depth = layer.depth.log()
    steps = []
    for axis, dim in ((0, 1), (1, 0)):
        unit = SLOPE_UNIT / focal_px[axis]
        slope = (_slope(log_depth, dim) / unit).round().clamp(-MOST_UNITS, MOST_UNITS) * unit
        steps.append(rays * slope[..., None] + torch.eye(3).to(rays)[axis] / focal_px[axis])
    return steps[0], steps[1]


def principal_axes(
    first: Float[Tensor, "n 3"], second: Float[Tensor, "n 3"]
) -> tuple[Float[Tensor, "n 3 3"], Float[Tensor, "n 2"]]:
    """Axes (columns) of the ellipse that two vectors span, and the lengths of two of them.

    The covariance first firstᵀ + second secondᵀ has them as eigenvectors; the third is the normal.
    """
    between = (first * second).sum(-1)
    excess = first.square().sum(-1) - second.square().sum(-1)
    angle = torch.atan2(2 * between, excess)[:, None] / 2
    spanned = torch.stack(
        [
            first * angle.cos() + second * angle.sin(),
            second * angle.cos() - first * angle.sin(),
        ],
        -1,
    )
    lengths = spanned.norm(dim=1)
    axes = spanned / lengths[:, None]
    normal = torch.linalg.cross(axes[..., 0], axes[..., 1])
    return torch.cat([axes, normal[..., None]], -1), lengths


def _slope(log_depth: Float[Tensor, "h w"], dim: int) -> Float[Tensor, "h w"]:
    """The smaller of the differences to both neighbours; 0 at edges and where they disagree."""
    difference = log_depth.diff(dim=dim)
    nothing = torch.zeros_like(log_depth.narrow(dim, 0, 1))
    after, before = torch.cat([difference, nothing], dim), torch.cat([nothing, difference], dim)
    smaller = torch.where(after.abs() < before.abs(), after, before)
    return smaller.where((after * before > 0) & (smaller.abs() <= DEPTH_STEP), 0.0)
