"""What lies around a picture must not stand before it (ours).

Axes: ``h w`` cells of the input view as networks see it, ``n`` Gaussians. The layer behind the
first picture is coarse, and where it is unsure of its depth it may come to lie before the surface
that the picture shows. From the picture's own camera such a Gaussian hides what is known by what is
guessed. It is pushed along its ray, and grown, until all that its footprint covers lies before it.
"""

from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.geometry.camera import Camera, project
from diff4splat.scene.gaussians import Gaussians

BEHIND = 1.1
"""Depth over that of the farthest cell of the picture under the footprint."""
DEVIATIONS = 3.0
"""How far a footprint reaches, in standard deviations."""
WIDEST_CELLS = 32
"""Reach beyond which nothing is looked for: half of the picture that networks see."""


def push_behind_surface(
    gaussians: Gaussians, surface: Float[Tensor, "h w"], camera: Camera
) -> Gaussians:
    """The Gaussians, none before what it covers of ``surface``: depth z as ``camera`` sees it.

    Cells of ``surface`` that are 0 show nothing, and ask for nothing.
    """
    pixels, depth = project(camera, gaussians.means)
    ahead = depth > 0
    depth = depth.clamp_min(1e-6)
    sigma_px = gaussians.scales.amax(-1) * camera.focal_px.prod().sqrt() / depth
    farthest = _farthest(surface, pixels.detach(), DEVIATIONS * sigma_px.detach(), ahead)
    push = (BEHIND * farthest / depth).clamp_min(1)[:, None]
    center = camera.world_from_camera[:3, 3]
    return replace(
        gaussians,
        means=center + push * (gaussians.means - center),
        scales=push * gaussians.scales,
    )


def _farthest(
    surface: Float[Tensor, "h w"],
    pixels: Float[Tensor, "n 2"],
    reach_px: Float[Tensor, " n"],
    ahead: Bool[Tensor, " n"],
) -> Float[Tensor, " n"]:
    """Depth of the farthest cell within reach of every Gaussian; 0 where there is none."""
    border = WIDEST_CELLS + 1
    padded = torch.nn.functional.pad(surface[None, None], (border,) * 4)
    last = pixels.new_tensor([surface.shape[1], surface.shape[0]]) + border - 1
    column, row = (
        (pixels.nan_to_num(-border) + border).floor().clamp_min(0).minimum(last + border).long().T
    )
    cells = reach_px.nan_to_num(0).ceil().clamp(1, WIDEST_CELLS).long()
    found = torch.zeros_like(reach_px)
    for reach in cells[ahead].unique().tolist():
        own = ahead & (cells == reach)
        around = torch.nn.functional.max_pool2d(padded, 2 * reach + 1, 1, reach)[0, 0]
        found[own] = around[row[own], column[own]]
    return found
