"""Figure and ground: which pixels are surfaces that hide others, and which may be hidden (ours).

    image, depth ─ copy ─ depth edges: near sides 1, far sides 0
                        ─ weighted least squares within colours and depth ─ label in [0, 1]
                        ─ above a threshold between the sides of the edges around ─ figure

Axes: ``h w`` pixels, ``y x`` pixels of the copy. Depth alone does not say it: a floor is nearer
than the wall behind it and hides nothing, and a face has edges of its own whose far sides are as
near as the face. The label of an object comes from all its edges, the larger ones first.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import interpolate

from diff4splat.generation.depth.weighted_least_squares import (
    TINY,
    Grid,
    between_colors,
    least_squares,
)
from diff4splat.generation.layered_image.disoccluded.depth_edges import (
    WINDOW_RADIUS_PX,
    far_side_of_edges,
)
from diff4splat.generation.layered_image.other_grid import copy_size
from diff4splat.generation.layered_image.windows import largest_around, smallest_around

MOST_SIDE_PX = 128
"""Of the copy: figures are wider than its cells."""
LARGEST_STEP = 0.5
"""Of inverse depth, over its median: larger edges weigh no more."""
GROUND_WEIGHT = 1e-3
"""Of ground, at every pixel: what has no edge is ground."""
REACH_SHARE = 0.3
"""Of the copy's shorter side: how far the label of an edge reaches within a colour."""
COLOR_STEP, THROUGH_EDGES = 0.1, 1e-3
"""Difference of colours, in [0, 1], through which a label goes on with 1/e; and through any."""
DEPTH_DIFFERENCE = 0.05
"""Of log depth between neighbours, through which a label goes on with 1/e."""
FIGURE_SHARE = 0.6
"""Of the way from far to near sides: a label above it is a figure's."""
AROUND_SHARE = 1 / 2
"""Of the copy's longer side: deviation of the window in which edges are compared."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FigureGround:
    """What hides something; ``before_figure`` is a part of ``figure``."""

    figure: Bool[Tensor, "h w"]
    """In front of the ground."""
    before_figure: Bool[Tensor, "h w"]
    """In front of another figure: a cup on its saucer."""


@torch.no_grad()
def figure_ground(rgb: Float[Tensor, "h w 3"], depth: Float[Tensor, "h w"]) -> FigureGround:
    """Of every pixel; nothing is figure where there are no edges."""
    copy_rgb, copy_depth = copies(rgb, depth)
    near, far = seeds(copy_depth)
    label = labels(near, far, (copy_rgb, copy_depth))
    figure = label > figure_threshold(label, near, far)
    inner = figure & (largest_around((figure & (far > near)).to(label), WINDOW_RADIUS_PX) > 0)
    before = figure & (label > figure_threshold(label, near * inner, far * inner))
    return FigureGround(
        figure=_enlarged(figure, depth.shape), before_figure=_enlarged(before, depth.shape)
    )


def seeds(
    depth: Float[Tensor, "y x"],
) -> tuple[Float[Tensor, "y x"], Float[Tensor, "y x"]]:
    """Near and far sides of depth edges, by how much a camera that moves would disocclude.

    That is the difference of inverse depth: a floor that ends at the sky hides next to nothing.
    """
    inverse = depth.double().median() / depth.double()
    near = far_side_of_edges(1 / depth) * (inverse - smallest_around(inverse, WINDOW_RADIUS_PX))
    far = far_side_of_edges(depth) * (largest_around(inverse, WINDOW_RADIUS_PX) - inverse)
    return near.clamp_max(LARGEST_STEP), far.clamp_max(LARGEST_STEP)


def labels(
    near: Float[Tensor, "y x"],
    far: Float[Tensor, "y x"],
    image: tuple[Float[Tensor, "y x 3"], Float[Tensor, "y x"]],
) -> Float[Tensor, "y x"]:
    """1 at near sides of depth edges, 0 at far sides, as far as colours and depth go on."""
    weight = near + far
    reach = (REACH_SHARE * min(near.shape)) ** 2
    links = [reach * link for link in _between_pixels(*image)]
    grid = Grid(weight=weight + GROUND_WEIGHT, across=links[0], down=links[1])
    return least_squares(near / weight.clamp_min(TINY), grid)


def figure_threshold(
    label: Float[Tensor, "y x"], near: Float[Tensor, "y x"], far: Float[Tensor, "y x"]
) -> Float[Tensor, "y x"]:
    """Between the mean labels of near and far sides around; infinite without both."""
    above, below = (_mean_around(label, weight) for weight in (near, far))
    return FIGURE_SHARE * above + (1 - FIGURE_SHARE) * below


def _mean_around(label: Float[Tensor, "y x"], weight: Float[Tensor, "y x"]) -> Float[Tensor, "y x"]:
    deviation = AROUND_SHARE * max(label.shape)
    rows, columns = (_gaussian(side, deviation) for side in label.shape)
    total, share = (rows @ one @ columns for one in (weight * label, weight))
    return torch.where(share > 0, total / share.clamp_min(TINY), torch.inf)


def _gaussian(side: int, deviation: float) -> Float[Tensor, "s s"]:
    place = torch.arange(side, dtype=torch.float64) / deviation
    return (-(place[:, None] - place).square() / 2).exp()


def _between_pixels(
    rgb: Float[Tensor, "y x 3"], depth: Float[Tensor, "y x"]
) -> tuple[Float[Tensor, "y x-1"], Float[Tensor, "y-1 x"]]:
    """How much neighbours across and down are one surface, up to 1."""
    steps = (depth.double().log().diff(dim=axis) / DEPTH_DIFFERENCE for axis in (1, 0))
    colors = between_colors(rgb, COLOR_STEP, THROUGH_EDGES)
    across, down = (one * (-step.square()).exp() for one, step in zip(colors, steps, strict=True))
    return across, down


def copies(
    rgb: Float[Tensor, "h w 3"], depth: Float[Tensor, "h w"]
) -> tuple[Float[Tensor, "y x 3"], Float[Tensor, "y x"]]:
    """Means of colours, and single depths: no surface lies between two sides of an edge."""
    size = copy_size((depth.shape[0], depth.shape[1]), MOST_SIDE_PX)
    if depth.shape == size:
        return rgb, depth
    small = interpolate(rgb.movedim(-1, 0)[None], size, mode="area")[0].movedim(0, -1)
    return small, interpolate(depth[None, None], size, mode="nearest-exact")[0, 0]


def _enlarged(mask: Bool[Tensor, "y x"], shape: torch.Size) -> Bool[Tensor, "h w"]:
    if mask.shape == shape:
        return mask
    return interpolate(mask[None, None].float(), shape, mode="bilinear")[0, 0] > 0.5
