"""Extremes and mean of a window around every pixel; beyond the border lie its pixels.

Axes: ``h w`` pixels.
"""

from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import avg_pool2d, max_pool2d, pad


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
