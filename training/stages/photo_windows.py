"""Windows of photographs get the depth that the whole photograph gives them.

    photograph ─ depth network, no gradient ─ log depth ─ its window ─┐
    window of it, in another light ─ depth network ─ log depth ───────┴─ difference

Axes: ``n`` photographs, ``h w`` pixels of a photograph, ``vh vw`` of a window. A photograph has no
known depth, but a window shows the same surfaces as the whole, and z does not change by cropping or
roll. The unit may, so the median of the difference is free. The whole sees more, so it decides.
"""

from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.training.batches.random_images.random_views import placement, sample_view, view_rgb
from diff4splat.training.losses.log_depth import gradient_error

LogDepth = Callable[[Float[Tensor, "n 3 h w"]], Float[Tensor, "n h w"]]
GRADIENT_WEIGHT = 0.5
"""Of the difference's steps beside its size, as for known depth."""


def window_difference(
    log_depth: LogDepth,
    photographs: Float[Tensor, "n 3 h w"],
    size_px: tuple[int, int],
    draws: Float[Tensor, "n 5"],
    change: Callable[[Float[Tensor, "n 3 vh vw"]], Float[Tensor, "n 3 vh vw"]],
) -> Float[Tensor, " n"]:
    """Error of windows of ``size_px`` (height, width), which ``change`` lights anew."""
    place = placement(photographs.shape[2:], size_px, _never_whole(draws))
    with torch.no_grad():
        whole = sample_view(log_depth(photographs)[:, None], place, size_px, "bilinear")[:, 0]
    window = log_depth(change(view_rgb(photographs, place, size_px)))
    return consistency_error(window, whole)


def consistency_error(
    log_depth: Float[Tensor, "n vh vw"], other: Float[Tensor, "n vh vw"]
) -> Float[Tensor, " n"]:
    """Mean size and steps of the difference of two log depths, whose median is free."""
    difference = log_depth - other
    middle = difference.detach().flatten(1).median(1).values[:, None, None]
    size = (difference - middle).abs().flatten(1).mean(1)
    everywhere = torch.ones_like(difference, dtype=torch.bool)
    return size + GRADIENT_WEIGHT * gradient_error(difference, everywhere)


def _never_whole(draws: Float[Tensor, "n 5"]) -> Float[Tensor, "n 5"]:
    return torch.cat([torch.ones_like(draws[:, :1]), draws[:, 1:]], 1)
