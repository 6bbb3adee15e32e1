"""What a moving camera disoccludes behind depth edges, at the size of the image (ours, ADR 31, 52).

    pixels ─┬─ depth edges ─ cells within reach of one, behind what is nearer than its far side
            └─ figure and ground
    behind figures                       ground goes on: inverse depth evenly, colours inpainted
    behind what is before a figure       that figure goes on, in a layer of its own
    behind relief within one surface     its own colours go on evenly, in a third

Axes: ``h w`` pixels. The other layers continue the image in cells of the smaller copy, in which
both sides of an edge are mixed: blots in the foreground's colours beside it.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.generation.layered_image.disoccluded.depth_edges import (
    DEPTH_STEP,
    NearestEdge,
    far_side_of_edges,
    nearest_edge,
    within,
)
from diff4splat.generation.layered_image.disoccluded.even_extension import even_colors
from diff4splat.generation.layered_image.disoccluded.figure_ground import (
    MOST_SIDE_PX,
    FigureGround,
    figure_ground,
)
from diff4splat.generation.layered_image.disoccluded.static_layer import static_layer
from diff4splat.generation.layered_image.disoccluded.texture import textured
from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.inpainting import Inpaint, on_copy
from diff4splat.generation.layered_image.types import ImageLayer, moving_mask
from diff4splat.generation.layered_image.windows import largest_around

MARGIN_SHARE = 1 / 64
"""Of the image's longer side: beside an edge, colours of the foreground are mixed in."""
REACH_SHARE = 1 / 6
"""Of the image's longer side: what a camera path disoccludes behind an edge."""
NARROW_SHARE, NARROW_PX = 1 / 2, 256
"""Of the image's longer side, and at most: the copy in which figures go on, in narrow strips."""
EVEN_SHARE = 1 / 8
"""Of the image's longer side: farther from all cells, colours are even. What is inpainted in a
large hole is an object that is not there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OccludedLayers:
    """Static layers behind depth edges."""

    ground: ImageLayer | None = None
    """Behind figures; None where nothing is."""
    figures: tuple[ImageLayer, ...] = ()
    """Behind what is in front of a figure, and behind the relief of one surface."""

    @property
    def all(self) -> list[ImageLayer]:
        """Those that there are."""
        return [*([] if self.ground is None else [self.ground]), *self.figures]


@torch.no_grad()
def occluded_layers(pixels: ImageLayer, inpaint: Inpaint = textured) -> OccludedLayers:
    """The layers behind the depth edges of ``pixels``, as far as a camera path looks."""
    edge = far_side_of_edges(pixels.depth)
    if not bool(edge.any()):
        return OccludedLayers()
    nearest = nearest_edge(edge)
    nearer = nearest.of(pixels.depth).log() - pixels.depth.log() > DEPTH_STEP / 2
    # Another layer lies behind what moves.
    moving = grown(moving_mask(pixels.depth, pixels.displacement), 1)
    cells = grown(nearer, 1) & (nearest.distance_px < REACH_SHARE * max(edge.shape)) & ~moving
    division = figure_ground(pixels.rgb, pixels.depth)
    level = occlusion_level(division, nearest)
    # A network that knows places would paint another object behind the relief of one.
    narrow = on_copy(inpaint, min(math.ceil(NARROW_SHARE * max(edge.shape)), NARROW_PX))
    hiding = ((division.figure, inpaint), (division.before_figure, narrow), (moving, None))
    layers = []
    for count, (in_front, fill) in enumerate(hiding):
        beside = nearer & (level == count) & (nearest.distance_px < 2 * _margin_px(edge))
        known = ~grown(in_front | beside, _margin_px(edge)) & ~moving
        layers.append(_layer(pixels, known, cells & (level == count) & ~known, fill))
    return OccludedLayers(ground=layers[0], figures=tuple(one for one in layers[1:] if one))


def occlusion_level(division: FigureGround, nearest: NearestEdge) -> Int[Tensor, "h w"]:
    """How many figures lie one behind the other at the far side of each pixel's edge, 0 to 2.

    The outline of a mask is off by a cell, so its rim does not count.
    """
    rim_px = 2 * math.ceil(max(division.figure.shape) / MOST_SIDE_PX)
    counts = (~grown(~mask, rim_px) for mask in (division.figure, division.before_figure))
    return nearest.of(sum(one.int() for one in counts))


def _layer(
    pixels: ImageLayer,
    known: Bool[Tensor, "h w"],
    mask: Bool[Tensor, "h w"],
    inpaint: Inpaint | None,
) -> ImageLayer | None:
    if not bool(known.any()) or not bool(mask.any()):
        return None
    near = within(mask, EVEN_SHARE * max(mask.shape))
    rgb = _colors(pixels.rgb, known, near, inpaint)
    # A footprint covers the neighbours too.
    return static_layer(pixels, known, mask, largest_around(pixels.depth, 1), rgb)


def _colors(
    rgb: Float[Tensor, "h w 3"],
    known: Bool[Tensor, "h w"],
    near: Bool[Tensor, "h w"],
    inpaint: Inpaint | None,
) -> Float[Tensor, "h w 3"]:
    """Known colours, inpainted ones ``near``, and even ones elsewhere; all even without network."""
    if inpaint is not None and bool((known | near).all()):
        return inpaint(rgb, known)
    even = even_colors(rgb, known)
    return even if inpaint is None else inpaint(even, known | ~near)


def _margin_px(edge: Bool[Tensor, "h w"]) -> int:
    return math.ceil(MARGIN_SHARE * max(edge.shape))
