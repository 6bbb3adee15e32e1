"""Axes of files whose y points up: half a turn about x from ours.

Ours are x right, y down, z forward (OpenCV). Half a turn about x gives x right, y up, z back
(OpenGL, glTF, SPZ). It changes the sign of whatever is odd in y and z together.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.scene.gaussians import Gaussians

_ODD = {"y": -1.0, "z": -1.0, "x": 1.0}
_BANDS = ("", "y", "z", "x", "xy", "yz", "", "xz", "", "y", "xyz", "y", "z", "x", "z", "x")
"""What each harmonic is odd in."""


def half_turn_about_x(gaussians: Gaussians) -> Gaussians:
    """The same Gaussians in axes with y up; applied twice, nothing changes."""
    vector = torch.tensor([1.0, -1.0, -1.0]).to(gaussians.means)
    quats = gaussians.quats * torch.tensor([1.0, 1.0, -1.0, -1.0]).to(gaussians.quats)
    signs = _signs(gaussians.sh.shape[1]).to(gaussians.sh)
    return replace(
        gaussians, means=gaussians.means * vector, quats=quats, sh=gaussians.sh * signs[:, None]
    )


def _signs(count: int) -> Float[Tensor, " k"]:
    signs = [1.0] * count
    for index, axes in enumerate(_BANDS[:count]):
        for axis in axes:
            signs[index] *= _ODD[axis]
    return torch.tensor(signs)
