"""Where pixels of one picture are found in another one: Lucas and Kanade's method, coarse to fine.

Axes: ``n`` pairs of pictures, ``h w`` pixels. With the flow f₀ so far, each step solves

    min_f  mean_W weight · (∇own · (f − f₀) + other(x + f₀) − own(x))²  +  DAMPING · |f − mean f₀|²

per pixel x, over a window W around it and all colours. weight = 1 / (1 + (difference / DOUBT)²)
trusts what looks alike. Where nothing can be told the flow is that of the surroundings.
"""

import torch
from jaxtyping import Float
from torch import Tensor

LEVELS = (2, 1)
"""Pixels per side that are one, coarse first."""
STEPS = 3
"""Per level."""
WINDOW, SURROUNDINGS = 7, 3
DAMPING, DOUBT = 1e-3, 0.05
LONGEST_STEP_PX = 2.0


def track_flow(
    own: Float[Tensor, "n 3 h w"],
    other: Float[Tensor, "n 3 h w"],
    start: Float[Tensor, "n 2 h w"],
) -> Float[Tensor, "n 2 h w"]:
    """Flow (right, down) in pixels from ``own`` to ``other``, begun at ``start``."""
    flow = start
    for level in LEVELS:
        here, there = _smaller(own, level), _smaller(other, level)
        coarse = _smaller(flow, level) / level
        slopes = _slopes(here)
        for _ in range(STEPS):
            coarse = coarse + _step(slopes, warp(there, coarse) - here, coarse)
        flow = _larger(coarse, level) * level
    return flow


def warp(
    picture: Float[Tensor, "n c h w"], flow: Float[Tensor, "n 2 h w"]
) -> Float[Tensor, "n c h w"]:
    """The picture sampled at x + flow; its borders continue outwards."""
    height, width = picture.shape[-2:]
    down, right = (torch.arange(side).to(flow) + 0.5 for side in (height, width))
    x = 2 * (right + flow[:, 0]) / width - 1
    y = 2 * (down[:, None] + flow[:, 1]) / height - 1
    return torch.nn.functional.grid_sample(
        picture, torch.stack([x, y], -1), padding_mode="border", align_corners=False
    )


def _step(
    slopes: tuple[Tensor, Tensor], difference: Float[Tensor, "n 3 h w"], flow: Tensor
) -> Float[Tensor, "n 2 h w"]:
    """What is added to the flow: the solution of two equations per pixel."""
    weight = 1 / (1 + (difference.abs().mean(1, keepdim=True) / DOUBT) ** 2)
    right, down = slopes
    products = (right * right, right * down, down * down, right * difference, down * difference)
    sums = [(weight * product).sum(1) for product in products]
    a, b, c, p, q = _mean(torch.stack(sums, 1), WINDOW).unbind(1)
    pull_x, pull_y = (DAMPING * (_mean(flow, SURROUNDINGS) - flow)).unbind(1)
    a, c, p, q = a + DAMPING, c + DAMPING, pull_x - p, pull_y - q
    change = torch.stack([c * p - b * q, a * q - b * p], 1) / (a * c - b * b)[:, None]
    return change.clamp(-LONGEST_STEP_PX, LONGEST_STEP_PX)


def _slopes(picture: Float[Tensor, "n c h w"]) -> tuple[Tensor, Tensor]:
    """Central differences to the right and down."""
    padded = torch.nn.functional.pad(picture, (1, 1, 1, 1), mode="replicate")
    right = (padded[..., 1:-1, 2:] - padded[..., 1:-1, :-2]) / 2
    return right, (padded[..., 2:, 1:-1] - padded[..., :-2, 1:-1]) / 2


def _mean(maps: Float[Tensor, "n c h w"], side: int) -> Float[Tensor, "n c h w"]:
    """Over a window within the picture; as two products, for pooling visits every window anew."""
    rows, columns = (_averaging(length, side).to(maps) for length in maps.shape[-2:])
    return rows @ maps @ columns.mT


def _averaging(length: int, side: int) -> Float[Tensor, "l l"]:
    """Rows that average a window around their own place."""
    place = torch.arange(length)
    within = ((place[:, None] - place).abs() <= side // 2).float()
    return within / within.sum(1, keepdim=True)


def _smaller(maps: Float[Tensor, "n c h w"], factor: int) -> Float[Tensor, "n c h2 w2"]:
    return maps if factor == 1 else torch.nn.functional.avg_pool2d(maps, factor)


def _larger(maps: Float[Tensor, "n c h w"], factor: int) -> Float[Tensor, "n c h2 w2"]:
    if factor == 1:
        return maps
    return torch.nn.functional.interpolate(
        maps, scale_factor=factor, mode="bilinear", align_corners=False
    )
