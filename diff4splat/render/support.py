"""Which Gaussians can be seen, and where.

Axes: ``n`` Gaussians, ``m`` visible ones. A contribution o exp(-q / 2) reaches the cutoff c where
q ≤ 2 ln(o / c), so the support of a footprint is an ellipse whose exact half extents are σ_x r and
σ_y r, r² = 2 ln(o / c); an opacity below the cutoff has no support.
"""

from dataclasses import fields

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.errors import InputError
from diff4splat.geometry.camera import Camera
from diff4splat.render.projection import (
    TOO_LARGE,
    Footprints,
    camera_space,
    footprints,
    largest_number,
)
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians

_THINNEST_PX = 1e-6
"""Footprints with a thinner axis pass between all pixel centres and have no usable gradient."""


@torch.no_grad()
def visible_order(
    gaussians: Gaussians, camera: Camera, settings: RenderSettings
) -> tuple[Int[Tensor, " m"], dict[str, int]]:
    """Indices of the Gaussians that touch the image, nearest first, and what was not finite.

    Equal depths keep the order of their indices.
    """
    usable, dropped = renderable_gaussians(gaussians)
    depth = camera_space(camera, gaussians.means)[:, 2]
    candidate = (
        usable & (depth > settings.near_depth) & (gaussians.opacities >= settings.alpha_cutoff)
    )
    index = candidate.nonzero().squeeze(1)
    prints = footprints(gaussians.select(index), camera, settings)
    box = pixel_boxes(prints, camera.size_px, settings.alpha_cutoff)
    seen = (box[:, 2:] > box[:, :2]).all(-1) & (_thin_axis_px(prints) >= _THINNEST_PX)
    index, depth = index[seen], prints.depth[seen]
    return index[depth.argsort(stable=True)], dropped


@torch.no_grad()
def pixel_boxes(
    prints: Footprints, size_px: tuple[int, int], alpha_cutoff: float
) -> Int[Tensor, "n 4"]:
    """Half-open boxes (left, top, right, bottom) of the pixels that a support may contain.

    A shade too large, because the cutoff is decided per pixel: were it decided by the rounding of
    the box, the image would depend on the tile size. A support off the image has an empty box.
    """
    radius = (2 * (prints.opacities / alpha_cutoff).log().clamp_min(0)).sqrt()
    extent = 1.001 * prints.sigma_px * radius[:, None] + 0.01
    last = prints.center_px.new_tensor([size_px[1], size_px[0]])
    start = torch.minimum((prints.center_px - extent - 0.5).ceil().clamp_min(0), last)
    stop = torch.minimum((prints.center_px + extent + 0.5).floor().clamp_min(0), last)
    reachable = prints.opacities >= alpha_cutoff
    return torch.where(reachable[:, None], torch.cat([start, stop], -1), 0).nan_to_num().long()


def require_finite_camera(camera: Camera) -> None:
    """Require numbers with which images can be computed.

    Raises:
        InputError: NaN, infinity, numbers of ``TOO_LARGE`` or more, or a focal length of 0 or less.
    """
    focal_px = camera.focal_px.detach()
    values = (camera.world_from_camera.detach(), focal_px, camera.center_px.detach())
    numbers = torch.cat([value.flatten() for value in values])
    if not bool((numbers.abs() < TOO_LARGE).all() & (focal_px > 0).all()):
        raise InputError(
            "camera: expected finite pose and intrinsics and focal lengths above 0, "
            f"all below {TOO_LARGE:g}"
        )


@torch.no_grad()
def renderable_gaussians(gaussians: Gaussians) -> tuple[Bool[Tensor, " n"], dict[str, int]]:
    """Those whose parameters are finite and can be squared, and what was wrong with the others.

    The counts go by the first such parameter, so that they add up to the Gaussians left out.
    """
    largest = largest_number(gaussians.means)
    usable = torch.ones(len(gaussians), dtype=torch.bool, device=gaussians.means.device)
    dropped = {}
    for field in fields(gaussians):
        values = getattr(gaussians, field.name)[:, None].flatten(1)
        if _all_below(values, largest):
            continue
        fine = usable & (values.abs() < largest).all(1)
        if count := int(usable.sum() - fine.sum()):
            dropped[field.name] = count
        usable = fine
    return usable, dropped


def _all_below(values: Float[Tensor, "n c"], largest: float) -> bool:
    """Whether all are finite and can be squared: one pass, which is nearly always enough."""
    if values.numel() == 0:
        return True
    low, high = torch.aminmax(values)
    # Both comparisons fail for NaN.
    return bool((high < largest) & (low > -largest))


def _thin_axis_px(prints: Footprints) -> Float[Tensor, " n"]:
    """A lower bound on the standard deviation along the thin axis: sqrt(determinant / trace)."""
    return 1 / (prints.whitening[:, 0] * prints.whitening[:, 2] * prints.sigma_px.norm(dim=-1))
