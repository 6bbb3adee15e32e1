"""Views of single images that another lens, or a tilted camera, would have taken.

Axes: ``n`` images, ``h w`` pixels, ``vh vw`` pixels of a view. A network that always sees whole
level images learns depth from the image row. A random window, zoom and roll take that from it
(depth z stays what it is: roll and zoom do not change it, and a window only shifts the principal
point).

    source = centre + zoom · R(roll) · (pixel − centre of the view)

with ``zoom`` in source pixels per pixel of the view. Colours are the mean of 2 × 2 samples per
pixel, depth is that of the nearest source pixel.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.training.losses.log_depth import rescale_median

MAX_ROLL_RAD = math.radians(25)
LEAST_ZOOM = 0.5
"""Source pixels per pixel of a view; fewer would only be blur."""
WHOLE_SHARE, LEVEL_SHARE = 0.25, 0.5
"""Share of views that show as much as fits, level and centred; share of the others without roll."""
DRAWS = 5
"""Random numbers per view: whole, roll, zoom, x, y."""
PHOTO_DRAWS = 5
"""Random numbers per photo: saturation, vignette, grain, without colour, soft."""
GREY_SHARE, SOFT_SHARE = 0.1, 0.25
"""Share of photos without colour, and of those as soft as an enlarged image."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthImages:
    """Images and their depths."""

    rgb: Float[Tensor, "n 3 h w"]
    depth: Float[Tensor, "n h w"]
    """In the image's own unit: the median is that of the plane prior; 1 where it is not known."""
    known: Bool[Tensor, "n h w"]


def depth_images(rgb: Float[Tensor, "n 3 h w"], depth: Float[Tensor, "n h w"]) -> DepthImages:
    """Images with depth z in any unit; 0 or infinite where it is not known."""
    scaled, known = rescale_median(depth, PLANE_DEPTH)
    return DepthImages(rgb=rgb, depth=scaled, known=known)


def random_views(
    images: DepthImages, size_px: tuple[int, int], draws: Float[Tensor, "n 5"]
) -> DepthImages:
    """One view of (height, width) of every image; ``draws`` are uniform in [0, 1)."""
    place = placement(images.rgb.shape[2:], size_px, draws)
    depth = torch.where(images.known, images.depth, 0.0)[:, None]
    return depth_images(
        view_rgb(images.rgb, place, size_px), sample_view(depth, place, size_px, "nearest")[:, 0]
    )


def view_rgb(
    rgb: Float[Tensor, "n 3 h w"], place: "Placement", size_px: tuple[int, int]
) -> Float[Tensor, "n 3 vh vw"]:
    """Colours of views: the mean of 2 × 2 samples per pixel."""
    fine = sample_view(rgb, place, (2 * size_px[0], 2 * size_px[1]), "bilinear")
    return torch.nn.functional.avg_pool2d(fine, 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """Where the views lie in their images, in units of half the image's sides."""

    center: Float[Tensor, "n 2"]
    axes: Float[Tensor, "n 2 2"]
    """Columns: from the view's centre to its right and to its lower edge."""


def placement(
    source_px: tuple[int, ...], size_px: tuple[int, int], draws: Float[Tensor, "n 5"]
) -> Placement:
    """Where views of ``size_px`` lie in images of ``source_px`` (both height, width)."""
    whole, roll, zoom, *shift = draws.unbind(1)
    whole = whole < WHOLE_SHARE
    roll = torch.where(whole, 0.0, _random_roll(roll))
    source = draws.new_tensor(source_px[::-1])
    half = draws.new_tensor(size_px[::-1]) / 2
    turn = torch.stack([roll.cos(), -roll.sin(), roll.sin(), roll.cos()], -1).view(-1, 2, 2)
    reach = (turn.abs() @ half).clamp_min(1e-6)
    largest = (source / 2 / reach).min(1).values
    least = largest.clamp_max(LEAST_ZOOM)
    zoom = torch.where(whole, largest, least * (largest / least) ** zoom)
    room = (1 - 2 * zoom[:, None] * reach / source).clamp_min(0)
    center = torch.where(whole[:, None], 0.0, (2 * torch.stack(shift, 1) - 1) * room)
    axes = zoom[:, None, None] * turn * half / (source[:, None] / 2)
    return Placement(center=center, axes=axes)


def _random_roll(draw: Float[Tensor, " n"]) -> Float[Tensor, " n"]:
    """None for some; the others have any roll up to the largest."""
    rolled = (draw - LEVEL_SHARE) / (1 - LEVEL_SHARE)
    return torch.where(rolled < 0, 0.0, (2 * rolled - 1) * MAX_ROLL_RAD)


def sample_view(
    maps: Float[Tensor, "n c h w"], place: Placement, size_px: tuple[int, int], mode: str
) -> Float[Tensor, "n c vh vw"]:
    """Values of maps at the pixels of views, by interpolation of ``mode``."""
    matrix = torch.cat([place.axes, place.center[:, :, None]], 2)
    shape = [len(maps), maps.shape[1], *size_px]
    grid = torch.nn.functional.affine_grid(matrix, shape, align_corners=False)
    return torch.nn.functional.grid_sample(
        maps, grid, mode=mode, padding_mode="border", align_corners=False
    )


def random_photo(
    rgb: Float[Tensor, "n 3 h w"], draws: Float[Tensor, "n 5"], noise: Float[Tensor, "n 3 h w"]
) -> Float[Tensor, "n 3 h w"]:
    """Other saturation and sharpness, a vignette and sensor noise, as photographs have them.

    ``draws`` are uniform in [0, 1); sides must be even.
    """
    saturation, vignette, grain, colorless, soft = (
        draw[:, None, None, None] for draw in draws.unbind(1)
    )
    grey = rgb.mean(1, keepdim=True)
    strength = torch.where(colorless < GREY_SHARE, 0.0, 1.4 * saturation.sqrt())
    rgb = grey + strength * (rgb - grey)
    rgb = rgb * (1 - 0.5 * vignette**2 * _squared_radius(rgb))
    rgb = (rgb + 0.06 * grain**2 * noise).clamp(0, 1)
    return torch.where(soft < SOFT_SHARE, _soft(rgb), rgb)


def _soft(rgb: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "n 3 h w"]:
    """Reduced to half the size, and enlarged again."""
    half = torch.nn.functional.avg_pool2d(rgb, 2)
    return torch.nn.functional.interpolate(half, scale_factor=2, mode="bilinear")


def _squared_radius(rgb: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "h w"]:
    """0 in the centre, 1 in the corners."""
    y, x = (torch.linspace(-1, 1, side).to(rgb) for side in rgb.shape[2:])
    return (y[:, None] ** 2 + x**2) / 2
