"""Depth as colours for people: the Turbo map, near warm and far cold, over a robust range.

Axes: ``h w`` pixels, any leading ones. Zero, negative and non-finite depth is "no depth". Colours
are even in inverse depth, as parallax is: a far sky does not take all of them from what is near.
Depths that differ by less than a hundredth have one colour; their noise would look like shape.
"""

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.io.pixels import from_bytes

_NO_DEPTH_LEVEL = 0.16
"""Grey of pixels without depth, darker than any colour of the map."""
_MAX_SAMPLES = 1_000_000
FLAT_SHARE = 0.01
"""Range over nearest depth up to which depth is flat."""


def robust_range(depth: Float[Tensor, "*b"]) -> tuple[float, float] | None:
    """The 2 % and 98 % quantiles of the valid depth; None when there is none."""
    valid = depth[_valid(depth)].double()
    if len(valid) == 0:
        return None
    sample = valid[:: -(-len(valid) // _MAX_SAMPLES)]
    low, high = torch.quantile(sample, sample.new_tensor([0.02, 0.98])).tolist()
    return low, high


def is_flat(limits: tuple[float, float]) -> bool:
    """Whether a range of depths is one depth to the eye."""
    low, high = limits
    return not high > low * (1 + FLAT_SHARE)


def colorize(
    depth: Float[Tensor, "*b h w"], limits: tuple[float, float] | None
) -> Float[Tensor, "*b h w 3"]:
    """RGB of a depth map; depth outside ``limits`` gets the colour of the nearer end."""
    low, high = limits or (1.0, 1.0)
    valid = _valid(depth)
    known = torch.where(valid, depth.double(), low)
    if is_flat((low, high)):
        share = torch.full_like(known, 0.5)
    else:
        share = (1 / low - 1 / known) / (1 / low - 1 / high)
    levels = ((1 - share.clamp(0, 1)) * 255 + 0.5).to(torch.uint8)
    bgr = cv2.applyColorMap(levels.reshape(-1, 1).cpu().numpy(), cv2.COLORMAP_TURBO)
    rgb = from_bytes(bgr[:, 0, ::-1]).reshape(*depth.shape, 3)
    return torch.where(valid.cpu()[..., None], rgb, _NO_DEPTH_LEVEL)


def _valid(depth: Float[Tensor, "*b"]) -> Bool[Tensor, "*b"]:
    return torch.isfinite(depth) & (depth > 0)


def color_bar(
    width: int, height: int, limits: tuple[float, float] = (1.0, 2.0)
) -> Float[Tensor, "h w 3"]:
    """The map itself, near on the left, even in inverse depth between ``limits``."""
    low, high = limits
    ramp = torch.from_numpy(1 / np.linspace(1 / low, 1 / high, width)).expand(height, width)
    return colorize(ramp, limits)
