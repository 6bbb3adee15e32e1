"""Gaussians as the columns of an INRIA PLY, which stores values before their activation.

Columns: x y z, nx ny nz (zero), f_dc_0..2, f_rest_0.. (channel-major: all of red, then green, then
blue), opacity (logit), scale_0..2 (natural logarithm), rot_0..3 (w x y z). Kerbl et al. 2023, code.
Axes: ``n`` Gaussians, ``k`` harmonics, ``c`` columns.
"""

from collections.abc import Mapping

import numpy as np
import torch
from jaxtyping import Float, Float32
from torch import Tensor

from diff4splat.errors import FileFormatError
from diff4splat.geometry import quaternion
from diff4splat.scene.gaussians import Gaussians

_DOUBLE = torch.float64
_TINY = 1.1754944e-38
"""Smallest normal float32: its logarithm and logit are finite and come back as good as zero."""
_NEARLY_ONE = 1 - 1e-9
"""Comes back as exactly 1 in float32."""
_LARGEST = float(np.finfo(np.float32).max)
_LARGEST_LOG = 88.0
"""exp of more is infinite in float32."""
_FLAT_SCALE = 1e-6
"""Third standard deviation of surfels (2DGS), whose files have only two."""
_REST_COUNTS = (0, 9, 24, 45, 72)
_KEPT_REST = 15
"""Coefficients per channel that we use, up to degree 3."""
_REQUIRED = (
    *("x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity"),
    *("scale_0", "scale_1", "rot_0", "rot_1", "rot_2", "rot_3"),
)


def column_names(k: int) -> list[str]:
    """The columns of Gaussians with ``k`` harmonics, in the order of the original files."""
    return [
        *("x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"),
        *(f"f_rest_{i}" for i in range(3 * (k - 1))),
        *("opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"),
    ]


def to_table(gaussians: Gaussians) -> Float32[np.ndarray, "n c"]:
    """The stored values; opacity 0 and 1 and scale 0 stay finite."""
    exact = gaussians.to(_DOUBLE).to(torch.device("cpu"))
    columns = [
        exact.means,
        torch.zeros_like(exact.means),
        exact.sh[:, 0],
        exact.sh[:, 1:].transpose(1, 2).flatten(1),
        exact.opacities.clamp(_TINY, _NEARLY_ONE).logit()[:, None],
        exact.scales.clamp_min(_TINY).log(),
        # NaN means "no rotation" to normalize; adding it back lets the caller refuse it.
        quaternion.normalize(exact.quats) + 0 * exact.quats,
    ]
    return torch.cat(columns, 1).detach().float().numpy()


def from_columns(columns: Mapping[str, np.ndarray]) -> Gaussians:
    """float32 Gaussians of stored columns; columns of other names are ignored.

    Raises:
        FileFormatError: a column is missing, the harmonics are of no known degree, or NaN occurs.
    """
    for name in _REQUIRED:
        if name not in columns:
            raise FileFormatError(_missing(name, columns))
    rest_names = _rest_names(columns)
    dc = _read(columns, ["f_dc_0", "f_dc_1", "f_dc_2"])
    kept = _kept(rest_names)
    rest = _read(columns, kept).reshape(len(dc), 3, len(kept) // 3)
    return Gaussians(
        means=_read(columns, ["x", "y", "z"]).float(),
        quats=quaternion.normalize(_read(columns, ["rot_0", "rot_1", "rot_2", "rot_3"])).float(),
        scales=_read_scales(columns),
        opacities=_read(columns, ["opacity"])[:, 0].sigmoid().float(),
        sh=torch.cat([dc[:, None], rest.transpose(1, 2)], 1).float(),
    )


def has_fourth_degree(columns: Mapping[str, np.ndarray]) -> bool:
    """Whether there are harmonics of degree 4, which ``from_columns`` leaves out."""
    return f"f_rest_{3 * _KEPT_REST}" in columns


def _missing(name: str, columns: Mapping[str, np.ndarray]) -> str:
    kind = "a point cloud or mesh" if "x" in columns else "other data"
    return (
        f"expected property '{name}', got {kind} without it; it does not hold Gaussians, "
        "which the program that trained them can export"
    )


def _kept(rest_names: list[str]) -> list[str]:
    """Those up to degree 3, of each channel."""
    per_channel = len(rest_names) // 3
    return [name for i, name in enumerate(rest_names) if i % max(per_channel, 1) < _KEPT_REST]


def _rest_names(columns: Mapping[str, np.ndarray]) -> list[str]:
    count = sum(name.startswith("f_rest_") for name in columns)
    names = [f"f_rest_{i}" for i in range(count)]
    if count not in _REST_COUNTS or any(name not in columns for name in names):
        raise FileFormatError(
            f"expected 0, 9, 24, 45 or 72 properties f_rest_0, f_rest_1, ..., got {count}"
        )
    return names


def _read_scales(columns: Mapping[str, np.ndarray]) -> Float[Tensor, "n 3"]:
    names = [name for name in ("scale_0", "scale_1", "scale_2") if name in columns]
    scales = _read(columns, names).exp().float()
    return scales if len(names) == 3 else torch.nn.functional.pad(scales, (0, 1), value=_FLAT_SCALE)


def _read(columns: Mapping[str, np.ndarray], names: list[str]) -> Float[Tensor, "n c"]:
    """The named columns in float64, once they are known to be usable."""
    count = len(columns["x"])
    table = np.empty((count, len(names)))
    for i, name in enumerate(names):
        table[:, i] = columns[name]
        broken = _broken(name, table[:, i])
        if broken:
            raise FileFormatError(
                f"property '{name}': expected finite numbers, got {broken} of {count} NaN, "
                "infinite or too large; repair or make the file again"
            )
    return torch.from_numpy(table)


def _broken(name: str, values: np.ndarray) -> int:
    """How many values no Gaussian can have; an infinite logit is a probability of 0 or 1."""
    if name == "opacity":
        usable = ~np.isnan(values)
    elif name.startswith("scale_"):
        usable = values < _LARGEST_LOG
    else:
        usable = np.abs(values) <= _LARGEST
    return int((~usable).sum())
