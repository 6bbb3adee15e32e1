"""Inputs that the compiled tracer supports, and validity of Gaussians.

Axes: ``n`` Gaussians.
"""

from importlib.util import find_spec

import torch
from jaxtyping import Bool
from torch import Tensor

from diff4splat.render.support import renderable_gaussians
from diff4splat.render.trace.moving import MovingCloud, valid_motion
from diff4splat.scene.gaussians import Gaussians

_MOST_GAUSSIANS = 1 << 24


def unsupported_reason(gaussians: Gaussians) -> str | None:
    """Why the compiled tracer does not support ``gaussians``, or None."""
    means = gaussians.means
    if means.device.type != "cpu":
        return f"expected CPU tensors, got {means.device}"
    if means.dtype != torch.float32:
        return f"expected float32, got {means.dtype}"
    if len(gaussians) >= _MOST_GAUSSIANS:
        return f"expected fewer than {_MOST_GAUSSIANS} Gaussians, got {len(gaussians)}"
    if find_spec("numba") is None:
        return "expected the package numba, got none; install it"
    return None


def valid_gaussians(
    gaussians: Gaussians, moving: MovingCloud | None
) -> tuple[Bool[Tensor, " n"], dict[str, int]]:
    """Which Gaussians are valid, and counts of the others by their first invalid parameter."""
    valid, dropped = renderable_gaussians(gaussians)
    if moving is not None:
        valid, more = valid_motion(moving, valid)
        dropped = dropped | more
    return valid, dropped
