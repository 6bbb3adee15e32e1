"""Pixels at the outline of what turns whose colours are none of its own (ours, ADR 47).

Axes: ``h w`` pixels. Beside grass an outline is greenish, and would be a line across the front as
the object turns. A textured object has many colours: a pixel of it is one that some pixel of the
interior near by has, too.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.rigid_components import box_around
from diff4splat.generation.layered_image.windows import largest_around, smallest_around

OTHER_COLOR = 0.15
"""Difference from the nearest of the interior, in [0, 1], of a pixel that is not all of it."""
BEYOND_RANGE = 0.05
"""Outside of the range of the interior around, of such a pixel."""
REACH = 2
"""Of that range, over the width of the outline."""


def has_other_color(
    rgb: Float[Tensor, "h w 3"],
    inside: Bool[Tensor, "h w"],
    interior: Float[Tensor, "h w 3"],
    mixed_px: int,
) -> Bool[Tensor, "h w"]:
    """Pixels ``inside``, and of other colours; ``interior`` has those of the nearest of it.

    The interior is farther than ``mixed_px`` from the outline.
    """
    found = inside & ((rgb - interior).abs().amax(-1) > OTHER_COLOR)
    if bool(found.any()):
        pure, box = ~grown(~inside, mixed_px), box_around(inside)
        found[box] &= _is_beyond_range(rgb[box], pure[box], REACH * mixed_px)
    return found


def _is_beyond_range(
    rgb: Float[Tensor, "h w 3"], pure: Bool[Tensor, "h w"], radius_px: int
) -> Bool[Tensor, "h w"]:
    """In some channel; everywhere where no ``pure`` pixel is around."""
    beyond = torch.zeros_like(pure)
    for channel in rgb.unbind(-1):
        most = largest_around(torch.where(pure, channel, -torch.inf), radius_px)
        least = smallest_around(torch.where(pure, channel, torch.inf), radius_px)
        beyond |= (channel > most + BEYOND_RANGE) | (channel < least - BEYOND_RANGE)
    return beyond
