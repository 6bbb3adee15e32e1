"""Extremes and mean of a window around every pixel; beyond the border lie its pixels.

Axes: ``h w`` pixels, ``hs ws`` of a smaller copy, ``c`` channels.
"""

import math
from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import avg_pool2d, interpolate, max_pool2d, pad

MOST_SIDE_PX = 256
"""Of the copy in which means of wide windows are taken: they are smooth, and time is quadratic."""


def largest_around(values: Float[Tensor, "h w"], radius_px: int) -> Float[Tensor, "h w"]:
    """Of the square that reaches ``radius_px`` to every side."""
    padded = pad(values[None, None], (radius_px,) * 4, mode="replicate")
    rows = max_pool2d(padded, (2 * radius_px + 1, 1), 1)
    return max_pool2d(rows, (1, 2 * radius_px + 1), 1)[0, 0]


def smallest_around(values: Float[Tensor, "h w"], radius_px: int) -> Float[Tensor, "h w"]:
    """Of the same square."""
    return -largest_around(-values, radius_px)


def mean_around(values: Float[Tensor, "h w"], radius_px: int) -> Float[Tensor, "h w"]:
    """Of the same square."""
    padded = pad(values[None, None], (radius_px,) * 4, mode="replicate")
    rows = avg_pool2d(padded, (2 * radius_px + 1, 1), 1)
    return avg_pool2d(rows, (1, 2 * radius_px + 1), 1)[0, 0]


def means_around(values: Float[Tensor, "h w c"], share: float) -> Float[Tensor, "h w c"]:
    """Of the square that reaches ``share`` of the longer side to every side."""

    def means(copy: Float[Tensor, "hs ws c"]) -> Float[Tensor, "hs ws c"]:
        reach = math.ceil(share * max(copy.shape[:2]))
        return torch.stack([mean_around(channel, reach) for channel in copy.unbind(-1)], -1)

    return on_copy_of(values, means)


def on_copy_of(
    values: Float[Tensor, "h w c"],
    smooth: Callable[[Float[Tensor, "hs ws c"]], Float[Tensor, "hs ws c"]],
) -> Float[Tensor, "h w c"]:
    """``smooth`` of a copy of at most ``MOST_SIDE_PX``, enlarged again."""
    height, width = values.shape[:2]
    step = math.ceil(max(height, width) / MOST_SIDE_PX)
    if step == 1:
        return smooth(values)
    planes = smooth(block_means(values, step)).movedim(-1, 0)[None]
    large = interpolate(planes, scale_factor=float(step), mode="bilinear")[0]
    return large[:, :height, :width].movedim(0, -1)


def block_means(values: Float[Tensor, "h w c"], step: int) -> Float[Tensor, "hs ws c"]:
    """Means of ``step`` × ``step`` pixels; blocks at the border may have fewer."""
    planes = values.movedim(-1, 0)[None]
    small = avg_pool2d(planes, step, ceil_mode=True, count_include_pad=False)
    return small[0].movedim(0, -1)
