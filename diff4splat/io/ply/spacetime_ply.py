"""PLY of Spacetime Gaussians (Li et al., CVPR 2024): INRIA columns and a motion in columns.

    trbf_center trbf_scale      time centre; logarithm of the width w of the pulse exp(−(dt / w)²)
    motion_0 … motion_8         x y z of degree 1, then 2, then 3, in time
    omega_0 … omega_3           change of the quaternion (w, x, y, z) with time
    f_dc_0 … f_dc_2             red, green, blue, not harmonics
    f_t_0 …                     input of a colour network in a second file, which is not read

Times run from 0 to 1.
"""

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import FileFormatError
from diff4splat.io.ply.ply_columns import from_columns
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import dc_from_color
from diff4splat.scene.motion.polynomial import PolynomialMotion

MARK = "trbf_center"
TIME_RANGE_S = (0.0, 1.0)
_SHORTEST, _LONGEST = -12.0, 12.0
"""Logarithms of pulse widths; shorter ones show nothing, longer ones everything."""
_LARGEST = 1e12


def is_spacetime(names: Collection[str]) -> bool:
    """Whether these are the columns of Spacetime Gaussians."""
    return MARK in names


def has_color_network(names: Collection[str]) -> bool:
    """Whether the colours go through a network that is not in the file."""
    return "f_t_0" in names


def from_spacetime_columns(
    columns: Mapping[str, np.ndarray],
) -> tuple[Gaussians, PolynomialMotion]:
    """Float32 Gaussians at their time centres, and their motion.

    Raises:
        FileFormatError: a column is missing, or a number is not finite.
    """
    gaussians = from_columns({k: v for k, v in columns.items() if not k.startswith("f_rest_")})
    rgb = gaussians.sh[:, :1]
    width = _columns(columns, ["trbf_scale"])[:, 0].clamp(_SHORTEST, _LONGEST).exp()
    names = sorted(int(name[7:]) for name in columns if _is_motion(name))
    if names != list(range(len(names))) or not names or len(names) % 3:
        raise FileFormatError(f"expected motion_0 to motion_8, got {len(names)} such properties")
    motion = _columns(columns, [f"motion_{i}" for i in names])
    stored = _columns(columns, [f"rot_{i}" for i in range(4)])
    moving = PolynomialMotion(
        coefficients=motion.view(len(motion), -1, 3),
        spins=_columns(columns, [f"omega_{i}" for i in range(4)]),
        time_centers_s=_columns(columns, [MARK])[:, 0],
        time_deviations_s=width / 2**0.5,
        time_range_s=TIME_RANGE_S,
    )
    # The change of a quaternion is added to its stored length.
    return replace(gaussians, sh=dc_from_color(rgb.double()).float(), quats=stored), moving


def _is_motion(name: str) -> bool:
    return (
        name.startswith("motion_") and name[7:].isascii() and name[7:].isdigit() and len(name) < 9
    )


def _columns(columns: Mapping[str, np.ndarray], names: list[str]) -> Float[Tensor, "n c"]:
    for name in names:
        if name not in columns:
            raise FileFormatError(f"expected property '{name}', got Spacetime Gaussians without it")
        if not (np.abs(columns[name].astype(np.float64)) < _LARGEST).all():
            raise FileFormatError(f"property '{name}': expected finite numbers, got others")
    return torch.from_numpy(np.stack([columns[name] for name in names], 1).astype(np.float32))
