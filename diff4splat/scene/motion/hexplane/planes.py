"""Six feature planes per level: what a point of space-time looks up.

Axes: ``n`` points, ``t`` times, ``c`` channels, ``l`` levels; a plane of axes ``i`` and ``j`` is
``rj ri c``: the later axis in rows, the earlier in columns, channels last, so that one node is one
run of memory. Order: xy, xz, xt, yz, yt, zt. The feature of a point is

    ⊕_l Π_ij R_l,ij(i, j)        (product over planes, concatenation over levels)

with bilinear interpolation between nodes; the first and last node lie on the bounds, and what lies
outside is looked up on the border (HexPlane, arXiv 2301.09632; 4D Gaussians, arXiv 2310.08528).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ConfigError, InputError, ShapeError
from diff4splat.scene.motion.hexplane import sampling

PLANE_NAMES = ("xy", "xz", "xt", "yz", "yt", "zt")
SPATIAL = (0, 1, 3)
"""Which planes hold no time."""
TEMPORAL = (2, 4, 5)
"""Which planes have time in their rows, and x, y, z in their columns."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HexPlaneSize:
    """How fine the planes are."""

    space: tuple[int, int, int] = (64, 64, 64)
    """Nodes along x, y, z on the first level."""
    time: int = 25
    """Nodes along time, on every level."""
    channels: int = 16
    multipliers: tuple[int, ...] = (1, 2)
    """One level each; multiplies the nodes along x, y, z, never those along time."""

    def __post_init__(self) -> None:
        numbers = (*self.space, self.time, self.channels, *self.multipliers)
        if not self.multipliers or min(numbers) < 1:
            raise ConfigError(f"HexPlaneSize: expected whole numbers above 0, got {self}")


@dataclass(frozen=True, slots=True, kw_only=True)
class HexPlanes:
    """Feature planes over a box and a range of time."""

    levels: tuple[tuple[Tensor, ...], ...]
    """Per level six planes ``rj ri c``; all have the same channels."""
    bounds: Float[Tensor, "2 3"]
    """Where the first and the last node lie, scene units. Usually low and high; 4DGaussians files
    have high and low."""
    time_range_s: tuple[float, float]
    time_mapping: Literal["full", "half"] = "full"
    """``full`` spreads all time nodes over the range; ``half`` the upper half of them, which is all
    that 4DGaussians ever reads."""

    def __post_init__(self) -> None:
        if not self.levels:
            raise ShapeError("HexPlanes.levels: expected at least one level, got none")
        for level in self.levels:
            _require_planes(level, level[0].shape[-1] if level else 0)
        if len({level[0].shape[-1] for level in self.levels}) != 1:
            raise ShapeError("HexPlanes.levels: expected equal channels on all levels")
        if tuple(self.bounds.shape) != (2, 3):
            raise ShapeError(f"HexPlanes.bounds: expected (2, 3), got {tuple(self.bounds.shape)}")
        first, last = self.time_range_s
        if not first <= last:
            raise InputError(f"HexPlanes.time_range_s: expected first ≤ last, got {first}, {last}")

    @property
    def channels(self) -> int:
        """Channels of each plane."""
        return self.levels[0][0].shape[-1]

    @property
    def feature_count(self) -> int:
        """Length of a feature: levels times channels."""
        return len(self.levels) * self.channels

    @property
    def node_times_s(self) -> list[float]:
        """When a node of the time planes is passed: between two of them nothing has a kink."""
        first, last = self.time_range_s
        steps = max(self.levels[0][TEMPORAL[0]].shape[0] - 1, 1)
        parts = (k / steps for k in range(steps + 1))
        if self.time_mapping == "half":
            parts = (2 * part - 1 for part in parts if part >= 0.5)
        return [first + part * (last - first) for part in parts]

    def features(self, points: Float[Tensor, "n 3"], time_s: float) -> Float[Tensor, "n f"]:
        """Features of points at one time; times outside the range count as its ends."""
        return self.features_at_times(points, (time_s,))[0]

    def features_at_times(
        self, points: Float[Tensor, "n 3"], times_s: Sequence[float]
    ) -> Float[Tensor, "t n f"]:
        """Features of the same points at several times, for less than one call per time."""
        rows = tuple(self._progress(time_s) for time_s in times_s)
        return sampling.features(self.levels, self._unit(points), rows)

    def to(self, target: torch.device | torch.dtype) -> "HexPlanes":
        """Move or cast planes and bounds."""
        levels = tuple(tuple(plane.to(target) for plane in level) for level in self.levels)
        return replace(self, levels=levels, bounds=self.bounds.to(target))

    def _unit(self, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        """0 at the first node, 1 at the last."""
        first, last = self.bounds.to(points).unbind(0)
        extent = last - first
        # A flat box has one place only along that axis: its first node.
        flat = extent == 0
        return torch.where(flat, 0.0, (points - first) / torch.where(flat, 1.0, extent))

    def _progress(self, time_s: float) -> float:
        """0 at the first time node, 1 at the last."""
        first, last = self.time_range_s
        part = (time_s - first) / (last - first) if last > first else 0.0
        part = min(max(part, 0.0), 1.0)
        return part if self.time_mapping == "full" else 0.5 + 0.5 * part


def make_planes(
    size: HexPlaneSize,
    bounds: Float[Tensor, "2 3"],
    time_range_s: tuple[float, float],
    generator: torch.Generator | None = None,
    time_mapping: Literal["full", "half"] = "full",
) -> HexPlanes:
    """Float32 planes at their start: spatial ones uniform in [0.1, 0.5), those with time all 1.

    Features do not depend on time then.
    """
    levels = []
    for multiplier in size.multipliers:
        nodes = (*(multiplier * count for count in size.space), size.time)
        shapes = [(nodes[row], nodes[column], size.channels) for column, row in sampling.AXES]
        drawn = [torch.rand(shape, generator=generator) * 0.4 + 0.1 for shape in shapes]
        level = [torch.ones_like(p) if k in TEMPORAL else p for k, p in enumerate(drawn)]
        levels.append(tuple(level))
    return HexPlanes(
        levels=tuple(levels),
        bounds=bounds.float(),
        time_range_s=time_range_s,
        time_mapping=time_mapping,
    )


def _require_planes(level: tuple[Tensor, ...], channels: int) -> None:
    shapes = [tuple(plane.shape) for plane in level]
    if len(shapes) != len(PLANE_NAMES) or any(len(shape) != 3 for shape in shapes):
        raise ShapeError(f"HexPlanes.levels: expected six planes (rj, ri, c), got {shapes}")
    nodes = (shapes[0][1], shapes[0][0], shapes[1][0], shapes[2][0])
    want = [(nodes[row], nodes[column], channels) for column, row in sampling.AXES]
    if shapes != want:
        raise ShapeError(f"HexPlanes.levels: expected {want} (x, y, z, t agree), got {shapes}")
