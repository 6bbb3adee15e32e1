"""Which cells of a generated video the image hides, and at which depth they lie.

Axes: ``f h w`` frames, rows and columns of LDRM's grid.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.generation.layered_image.visibility import (
    nearest_pixel,
    visible_in_earlier_frame,
)
from diff4splat.generation.video.render_condition import RenderedImage
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.depth import depth_from_distance
from diff4splat.models.config.networks import ActivationConfig
from diff4splat.models.ldrm.activations import bounded_factor
from diff4splat.models.ldrm.gaussian_head import PixelBase
from diff4splat.models.ldrm.refinement.warping import inside, other_pixels


@dataclass(frozen=True, slots=True, kw_only=True)
class FillGrid:
    """LDRM's grid: its base, its predicted depth, and the cells to fill."""

    base: PixelBase
    depth: Float[Tensor, "f h w"]
    """z that LDRM predicts on this base."""
    filled: Bool[Tensor, "f h w"]

    @property
    def cameras(self) -> Camera:
        """Of the grid's frames, batch shape (f,)."""
        return self.base.cameras


def full_grid(
    raw: Float[Tensor, "12 f h w"], base: PixelBase, config: ActivationConfig
) -> FillGrid:
    """Every cell is filled: the image has no geometry of its own."""
    factor = bounded_factor(raw[-1].float(), config.log_distance_limit)
    depth = depth_from_distance(base.cameras, base.distance * factor)
    return FillGrid(base=base, depth=depth, filled=torch.ones_like(depth, dtype=torch.bool))


def hidden_grid(grid: FillGrid, rendered: RenderedImage) -> FillGrid:
    """Only cells that neither the image nor an earlier frame shows, at the image's depth scale."""
    ratio = depth_ratio(grid.depth, rendered)
    depth, unseen = grid.depth * ratio, ~rendered.valid
    unseen = unseen & ~in_front_of_image(depth, grid.cameras, rendered.depth[0])
    return FillGrid(
        base=replace(grid.base, distance=grid.base.distance * ratio),
        depth=depth,
        filled=unseen & ~visible_in_earlier_frame(depth, grid.cameras, unseen),
    )


def in_front_of_image(
    depth: Float[Tensor, "f h w"], cameras: Camera, image_depth: Float[Tensor, "h w"]
) -> Bool[Tensor, "f h w"]:
    """Cells that the first camera would see in front of the image: no image could hide them."""
    first = cameras[:1]
    rows = []
    for index in range(len(depth)):
        own = cameras[index : index + 1]
        pixels, relative = other_pixels(own, first, 1 / depth[index, None, None])
        surface = nearest_pixel(image_depth, pixels)
        z = relative[0, 0] * depth[index]
        rows.append(inside(pixels, relative)[0, 0] & (z < surface))
    return torch.stack(rows)


def depth_ratio(depth: Float[Tensor, "f h w"], rendered: RenderedImage) -> Float[Tensor, "f 1 1"]:
    """The ratio that brings each frame to the image's depth; 1 where they share no cell."""
    ratios = []
    for predicted, valid, reference in zip(depth, rendered.valid, rendered.depth, strict=True):
        both = valid & (reference > 0)
        ratio = reference[both] / predicted[both]
        ratios.append(middle_mean(ratio) if len(ratio) else predicted.new_ones(()))
    return torch.stack(ratios)[:, None, None]


def middle_mean(values: Float[Tensor, " n"]) -> Float[Tensor, ""]:
    """Mean of the middle half: as robust as a median, and one value more hardly moves it."""
    ordered, quarter = values.sort().values, len(values) // 4
    return ordered[quarter : len(values) - quarter].mean()


def every_nth(cells: Bool[Tensor, "f h w"], stride: int) -> Bool[Tensor, "f h w"]:
    """The cells of every ``stride``-th row and column."""
    chosen = torch.zeros_like(cells)
    chosen[:, ::stride, ::stride] = True
    return cells & chosen


def at_grid(rendered: RenderedImage, frames: Int[Tensor, " f"], stride: int) -> RenderedImage:
    """The render at LDRM's frames and cells."""
    cells = (frames, slice(None, None, stride), slice(None, None, stride))
    return RenderedImage(
        rgb=rendered.rgb[cells],
        valid=rendered.valid[cells],
        depth=rendered.depth[cells],
        surface_depth=rendered.surface_depth[cells],
    )
