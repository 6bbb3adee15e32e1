"""Axes of files whose y points up: half a turn about x from ours.

Ours are x right, y down, z forward (OpenCV). Half a turn about x gives x right, y up, z back
(OpenGL, glTF, SPZ). It changes the sign of whatever is odd in y and z together.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.scene.gaussians import Gaussians

_BANDS = ("", "y", "z", "x", "xy", "yz", "", "xz", "", "y", "xyz", "y", "z", "x", "z", "x")
"""What each harmonic is odd in."""


def half_turn_about_x(gaussians: Gaussians) -> Gaussians:
    """The same Gaussians in axes with y up; applied twice, nothing changes."""
    return half_turn(gaussians, "x")


def half_turn(gaussians: Gaussians, axis: str) -> Gaussians:
    """The same Gaussians after half a turn about x, y or z."""
    odd = {name: 1.0 if name == axis else -1.0 for name in "xyz"}
    vector = torch.tensor(list(odd.values())).to(gaussians.means)
    quats = gaussians.quats * torch.tensor([1.0, *odd.values()]).to(gaussians.quats)
    signs = _signs(gaussians.sh.shape[1], odd).to(gaussians.sh)
    return replace(
        gaussians, means=gaussians.means * vector, quats=quats, sh=gaussians.sh * signs[:, None]
    )


def _signs(count: int, odd: dict[str, float]) -> Float[Tensor, " k"]:
    signs = [1.0] * count
    for index, axes in enumerate(_BANDS[:count]):
        for axis in axes:
            signs[index] *= odd[axis]
    return torch.tensor(signs)
