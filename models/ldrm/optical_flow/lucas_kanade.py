"""Optical flow by the method of Lucas and Kanade, coarse to fine.

Axes: ``n`` pairs of images, ``h w`` pixels. With the flow f₀ so far, each step solves

    min_f  mean_W weight · (∇s · (f − f₀) + t(x + f₀) − s(x))²  +  DAMPING · |f − mean f₀|²

per pixel x of the source s and the target t, over a window W centred on it and all colours.
weight = 1 / (1 + (difference / RESIDUAL_SCALE)²) favours similar colours. In regions without
texture the flow is the mean of its neighbourhood.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.models.blocks.resize import upsample_bilinear
from diff4splat.models.ldrm.window_mean import window_mean

PYRAMID = (2, 1)
"""Downsampling factors, coarse first."""
STEPS = 3
"""Per level."""
WINDOW, SMOOTHING_WINDOW = 7, 3
DAMPING, RESIDUAL_SCALE = 1e-3, 0.05
LONGEST_STEP_PX = 2.0


def track_flow(
    source: Float[Tensor, "n 3 h w"],
    target: Float[Tensor, "n 3 h w"],
    start: Float[Tensor, "n 2 h w"],
    pyramid: tuple[int, ...] = PYRAMID,
) -> Float[Tensor, "n 2 h w"]:
    """Flow (right, down) in pixels from ``source`` to ``target``, initialised with ``start``."""
    flow = start
    for level in pyramid:
        fixed, moving = _downsample(source, level), _downsample(target, level)
        coarse = _downsample(flow, level) / level
        gradients = _gradients(fixed)
        for _ in range(STEPS):
            coarse = coarse + _step(gradients, warp(moving, coarse) - fixed, coarse)
        flow = upsample_bilinear(coarse, level) * level
    return flow


def warp(
    image: Float[Tensor, "n c h w"], flow: Float[Tensor, "n 2 h w"]
) -> Float[Tensor, "n c h w"]:
    """The image sampled at x + flow; its border is replicated."""
    height, width = image.shape[-2:]
    down, right = (torch.arange(side).to(flow) + 0.5 for side in (height, width))
    x = 2 * (right + flow[:, 0]) / width - 1
    y = 2 * (down[:, None] + flow[:, 1]) / height - 1
    return torch.nn.functional.grid_sample(
        image, torch.stack([x, y], -1), padding_mode="border", align_corners=False
    )


def _step(
    gradients: tuple[Tensor, Tensor], difference: Float[Tensor, "n 3 h w"], flow: Tensor
) -> Float[Tensor, "n 2 h w"]:
    """The update of the flow: the solution of two equations per pixel."""
    weight = 1 / (1 + (difference.abs().mean(1, keepdim=True) / RESIDUAL_SCALE) ** 2)
    right, down = gradients
    products = (right * right, right * down, down * down, right * difference, down * difference)
    sums = [(weight * product).sum(1) for product in products]
    a, b, c, p, q = window_mean(torch.stack(sums, 1), WINDOW).unbind(1)
    pull_x, pull_y = (DAMPING * (window_mean(flow, SMOOTHING_WINDOW) - flow)).unbind(1)
    a, c, p, q = a + DAMPING, c + DAMPING, pull_x - p, pull_y - q
    change = torch.stack([c * p - b * q, a * q - b * p], 1) / (a * c - b * b)[:, None]
    return change.clamp(-LONGEST_STEP_PX, LONGEST_STEP_PX)


def _gradients(image: Float[Tensor, "n c h w"]) -> tuple[Tensor, Tensor]:
    """Central differences to the right and down."""
    padded = torch.nn.functional.pad(image, (1, 1, 1, 1), mode="replicate")
    right = (padded[..., 1:-1, 2:] - padded[..., 1:-1, :-2]) / 2
    return right, (padded[..., 2:, 1:-1] - padded[..., :-2, 1:-1]) / 2


def _downsample(maps: Float[Tensor, "n c h w"], factor: int) -> Float[Tensor, "n c h2 w2"]:
    return maps if factor == 1 else torch.nn.functional.avg_pool2d(maps, factor)
