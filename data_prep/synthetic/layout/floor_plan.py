"""Occupied and visible space of a world, seen from above.

Axes: ``n`` discs, ``c`` cameras. Every object is a disc (x, z, radius) with a height. An object may
not touch another one or a camera, nor occlude a moving object.
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.synthetic.motions.context import PartPositions
from diff4splat.data_prep.synthetic.shapes.shape import Shape


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedObject:
    """An object with its positions in the world."""

    family: str
    """Key of ``FAMILIES``, or the caption name of a part of the scene."""
    shape: Shape
    parts: PartPositions
    motion: str = ""
    """Key of ``MOTIONS``; empty for a static object."""
    size_m: float = 1.0
    """Size that scales its textures."""


@dataclass(slots=True)
class FloorPlan:
    """The floor plan of one world; filled as objects are placed."""

    eyes: Float64[np.ndarray, "c 3"]
    """Camera positions that must stay free and keep their view."""
    margin_m: float
    discs: list[tuple[float, float, float]] = field(default_factory=list)
    watched: list[tuple[float, float, float, float]] = field(default_factory=list)
    """(x, height, z, radius) of regions that must stay visible."""

    def is_free(self, x: float, z: float, radius: float) -> bool:
        """Whether a disc overlaps no other."""
        if not self.discs:
            return True
        occupied = np.array(self.discs)
        gap = np.hypot(occupied[:, 0] - x, occupied[:, 1] - z) - occupied[:, 2] - radius
        return bool(gap.min() > 0.0)

    def is_clear(self, x: float, z: float, radius: float, height: float) -> bool:
        """Whether an object there leaves every camera free and every watched region visible."""
        away = np.hypot(self.eyes[:, 0] - x, self.eyes[:, 2] - z) - radius
        if bool((away < self.margin_m).any()):
            return False
        return not any(self._occludes(x, z, radius, height, target) for target in self.watched)

    def _occludes(
        self,
        x: float,
        z: float,
        radius: float,
        height: float,
        target: tuple[float, float, float, float],
    ) -> bool:
        tx, th, tz, tr = target
        along = np.stack([tx - self.eyes[:, 0], tz - self.eyes[:, 2]], -1)
        length = np.maximum(np.linalg.norm(along, axis=1), 1e-9)
        unit = along / length[:, None]
        to = np.stack([x - self.eyes[:, 0], z - self.eyes[:, 2]], -1)
        depth = (to * unit).sum(1)
        aside = np.abs(to[:, 0] * unit[:, 1] - to[:, 1] * unit[:, 0])
        share = np.clip((depth - radius) / length, 0.0, 1.0)
        sight = -self.eyes[:, 1] + (th - -self.eyes[:, 1]) * share
        between = (depth > 0) & (depth - radius < length)
        return bool((between & (aside < radius + 0.7 * tr) & (height > sight)).any())

    def take(self, x: float, z: float, radius: float) -> None:
        """Mark a disc as occupied."""
        self.discs.append((x, z, radius))

    def watch(self, parts: PartPositions, height: float) -> None:
        """Keep the trajectory of a moving object free and visible."""
        low = np.min([part.min(1) for part in parts], axis=0)
        high = np.max([part.max(1) for part in parts], axis=0)
        for k in range(0, len(low), max(1, len(low) // 8)):
            x, z = 0.5 * (low[k, [0, 2]] + high[k, [0, 2]])
            radius = 0.5 * float(np.hypot(*(high[k, [0, 2]] - low[k, [0, 2]])))
            self.take(float(x), float(z), radius)
            middle = -0.5 * float(low[k, 1] + high[k, 1])
            self.watched.append((float(x), max(middle, 0.3 * height), float(z), 0.7 * radius))
