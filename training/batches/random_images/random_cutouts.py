"""Cutouts in images with depth: objects of photographs and drawings, upright and flat.

Axes: ``n`` images, ``h w`` pixels, ``m`` cutouts, ``s`` their side in pixels. Networks that
see nothing but drawn worlds give a textured object several depths, and it comes apart when the
camera moves. A cutout has one depth z: that of the surface at its foot, or a nearer one.

    alpha, colours = cutout at the pixel     visible = alpha > 1/2 and surface farther than z
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor

from diff4splat.data_prep.cutouts.cutout import OPAQUE
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.training.batches.random_images.random_views import DepthImages, depth_images

CUTOUT_DRAWS = 9
"""Random numbers per image: other cutout, which, height, x, foot, mirrored, high, near, light."""
CUTOUT_SHARE, HIGH_SHARE = 0.4, 0.3
"""Share of images with a cutout; share of cutouts that do not stand on the surface."""
HEIGHTS, FEET, CENTERS = (0.2, 1.3), (0.4, 1.2), (0.1, 0.9)
"""Shares of the image's sides; heights evenly by the logarithm. 1 is the lower edge."""
NEARNESS, LIGHTS = (0.35, 0.9), (0.5, 1.1)
LEAST_SHARE = 0.01
"""Images that would show less of their cutout stay as they are."""


def with_cutouts(
    images: DepthImages, cutouts: UInt8[Tensor, "m 4 s s"], draws: Float[Tensor, "n 9"]
) -> DepthImages:
    """Some of the images with one cutout each; ``draws`` are uniform in [0, 1)."""
    place = _place(images, draws)
    chosen = (draws[:, 1] * len(cutouts)).long().cpu()
    layer = _layer(cutouts[chosen].to(images.rgb) / 255, place, images.rgb.shape[2:])
    color, alpha = layer[:, :3] * _between(LIGHTS, draws[:, 8, None, None, None]), layer[:, 3]
    z = _depth_of(images, place, alpha > OPAQUE, draws)[:, None, None]
    alpha = alpha * (~images.known | (images.depth > z))
    visible = alpha > OPAQUE
    is_shown = visible.flatten(1).float().mean(1) >= LEAST_SHARE
    used = (draws[:, 0] < CUTOUT_SHARE) & is_shown & images.known.flatten(1).any(1)
    alpha, visible = alpha * used[:, None, None], visible & used[:, None, None]
    depth = torch.where(images.known, images.depth, 0.0)
    rgb = images.rgb + alpha[:, None] * (color.clamp(0, 1) - images.rgb)
    return depth_images(rgb, torch.where(visible, z, depth))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Place:
    """Squares of cutouts in pixels of their images."""

    side: Float[Tensor, " n"]
    center_x: Float[Tensor, " n"]
    foot_y: Float[Tensor, " n"]
    """Lower edge."""
    sign: Float[Tensor, " n"]
    """−1 for mirrored ones."""


def _place(images: DepthImages, draws: Float[Tensor, "n 9"]) -> _Place:
    height, width = images.rgb.shape[2:]
    share = HEIGHTS[0] * (HEIGHTS[1] / HEIGHTS[0]) ** draws[:, 2]
    return _Place(
        side=share * height,
        center_x=width * _between(CENTERS, draws[:, 3]),
        foot_y=height * _between(FEET, draws[:, 4]),
        sign=torch.where(draws[:, 5] < 0.5, 1.0, -1.0),
    )


def _between(ends: tuple[float, float], draw: Tensor) -> Tensor:
    return ends[0] + (ends[1] - ends[0]) * draw


def _layer(
    rgba: Float[Tensor, "n 4 s s"], place: _Place, size_px: tuple[int, ...]
) -> Float[Tensor, "n 4 h w"]:
    """Every cutout in its place, the mean of 2 × 2 samples per pixel."""
    height, width = size_px
    down = (torch.arange(2 * height).to(rgba) + 0.5) / 2
    right = (torch.arange(2 * width).to(rgba) + 0.5) / 2
    half = place.side[:, None] / 2
    y = (down - place.foot_y[:, None]) / half + 1
    x = place.sign[:, None] * (right - place.center_x[:, None]) / half
    shape = (len(rgba), len(down), len(right))
    grid = torch.stack([x[:, None].expand(shape), y[:, :, None].expand(shape)], -1)
    fine = torch.nn.functional.grid_sample(rgba, grid, align_corners=False)
    return torch.nn.functional.avg_pool2d(fine, 2)


def _depth_of(
    images: DepthImages, place: _Place, mask: Bool[Tensor, "n h w"], draws: Float[Tensor, "n 9"]
) -> Float[Tensor, " n"]:
    """That of the surface at the foot; nearer if it is below the image, or nothing is there."""
    height, width = images.rgb.shape[2:]
    row = place.foot_y.long().clamp(0, height - 1)
    column = place.center_x.long().clamp(0, width - 1)
    number = torch.arange(len(row), device=row.device)
    foot, stands = images.depth[number, row, column], images.known[number, row, column]
    nearness = _between(NEARNESS, draws[:, 7])
    foot = torch.where(place.foot_y < height, foot, foot * nearness)
    far = torch.where(images.known & mask, images.depth, torch.inf).flatten(1).amin(1)
    near = torch.where(far.isfinite(), far, PLANE_DEPTH) * nearness
    return torch.where(stands & (draws[:, 6] >= HIGH_SHARE), foot, near)
