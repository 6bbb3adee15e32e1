"""An object: parts of different materials on one skeleton.

Axes: ``v`` vertices, ``j`` joints. Joint 0 is the object itself; the others turn about an axis
through a pivot and carry along whatever hangs on them.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64, UInt8

from diff4splat.data_prep.synthetic.shapes.surfaces.surface import Surface


@dataclass(frozen=True, slots=True, kw_only=True)
class PartImage:
    """An image on a part, in place of a texture of its role."""

    pixels: UInt8[np.ndarray, "s s 3"]
    """sRGB; it repeats."""
    repeats: float
    """Per height of the object."""
    gloss: float
    color: str = ""
    """Name of the object's main colour; empty for several."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """One surface of one material."""

    role: str
    """What it is made of: a key of ``materials.ROLES``."""
    surface: Surface
    smooth: bool = True
    image: PartImage | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """Turns about ``axis`` through ``pivot``, both in the rest pose."""

    name: str
    parent: int
    pivot: tuple[float, float, float]
    axis: tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """Parts that move together; the first names the object's colour."""

    parts: tuple[Part, ...]
    joints: tuple[Joint, ...] = ()
    """Joints 1, 2, ...: joint 0, the root, is not listed."""
    bounds: tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]] = field(init=False)
    """Lowest and highest x, y, z at rest."""

    def __post_init__(self) -> None:
        everything = np.concatenate([part.surface.vertices for part in self.parts])
        object.__setattr__(self, "bounds", (everything.min(0), everything.max(0)))

    @property
    def height(self) -> float:
        """Metres."""
        return float(self.bounds[1][1] - self.bounds[0][1])

    @property
    def radius(self) -> float:
        """Of the upright cylinder about the own axis that holds it; metres."""
        low, high = self.bounds
        far = np.maximum(np.abs(low), np.abs(high))
        return float(np.hypot(far[0], far[2]))

    @property
    def triangles(self) -> int:
        """How many there are in all parts."""
        return sum(len(part.surface.triangles) for part in self.parts)

    def of_height(self, height_m: float) -> "Shape":
        """The same, so large that it is ``height_m`` high, centred, with its bottom on y = 0."""
        factor = height_m / self.height
        low, high = self.bounds
        shift = -factor * np.array([(low[0] + high[0]) / 2, high[1], (low[2] + high[2]) / 2])
        parts = (
            replace(part, surface=part.surface.scaled(factor).at(*shift.tolist()))
            for part in self.parts
        )
        joints = (
            replace(joint, pivot=tuple((factor * np.array(joint.pivot) + shift).tolist()))
            for joint in self.joints
        )
        return Shape(parts=tuple(parts), joints=tuple(joints))


def one(role: str, surface: Surface, *, smooth: bool = True) -> Shape:
    """An object of a single part."""
    return Shape(parts=(Part(role=role, surface=surface, smooth=smooth),))


def several(**surfaces: Surface) -> Shape:
    """An object of several parts, named by what they are made of."""
    return Shape(parts=tuple(Part(role=role, surface=s) for role, s in surfaces.items()))
