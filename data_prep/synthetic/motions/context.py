"""Input and output of a motion, and shared vertex transforms.

Axes: ``t`` frames, ``v`` vertices. A motion takes place on the plane y = 0 in a local frame.
Travelling objects move along +x, from −travel/2 to +travel/2. Progress u runs from 0 to 1 over the
clip.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import Shape

GRAVITY = 9.81
PartPositions = tuple[Float64[np.ndarray, "_ _ 3"], ...]
"""Positions of every part: frames (1 if static), vertices, coordinates."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionContext:
    """Shape, times and travel distance of a motion."""

    shape: Shape
    times_s: Float64[np.ndarray, " t"]
    travel_m: float
    rng: Rng

    @property
    def progress(self) -> Float64[np.ndarray, " t"]:
        """0 at the first frame, 1 at the last."""
        since = self.times_s - self.times_s[0]
        return since / max(float(since[-1]), 1e-9)

    @property
    def seconds(self) -> float:
        """Duration of the clip."""
        return float(self.times_s[-1] - self.times_s[0])

    def along(self) -> Float64[np.ndarray, " t"]:
        """X over time of an object that accelerates and then keeps its speed."""
        u = self.progress
        start = self.rng.uniform(0.0, 0.25)
        eased = np.where(u < start, u * u / (2 * max(start, 1e-6)), u - start / 2) / (1 - start / 2)
        return self.travel_m * (eased - 0.5)

    def phase(self, low_hz: float, high_hz: float) -> Float64[np.ndarray, " t"]:
        """Phase in radians of a periodic motion."""
        rate = self.rng.uniform(low_hz, high_hz)
        return 2 * np.pi * (rate * self.times_s + self.rng.uniform(0.0, 1.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionResult:
    """The shape, possibly with added parts such as a rope, and its positions."""

    shape: Shape
    parts: PartPositions


def rest_positions(shape: Shape, frames: int = 1) -> PartPositions:
    """Positions at rest."""
    return tuple(np.repeat(part.surface.vertices[None], frames, axis=0) for part in shape.parts)


def deformed(
    shape: Shape,
    displace: Callable[[Float64[np.ndarray, "v 3"]], Float64[np.ndarray, "t v 3"]],
) -> PartPositions:
    """Every vertex displaced by a function of its rest position."""
    return tuple(displace(part.surface.vertices) for part in shape.parts)


def transformed(
    parts: PartPositions,
    rotation: Float64[np.ndarray, "t 3 3"],
    pivot: Float64[np.ndarray, "3"],
    offset: Float64[np.ndarray, "t 3"],
) -> PartPositions:
    """All parts rotated about ``pivot``, then translated."""
    return tuple(
        (part - pivot) @ rotation.transpose(0, 2, 1) + (pivot + offset)[:, None] for part in parts
    )


def axis_rotations(
    axis: tuple[float, float, float], angle_rad: Float64[np.ndarray, " t"]
) -> Float64[np.ndarray, "t 3 3"]:
    """Rotations about an axis (Rodrigues)."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, cosine = np.sin(angle_rad)[:, None, None], np.cos(angle_rad)[:, None, None]
    return np.eye(3) + sine * cross + (1 - cosine) * (cross @ cross)


def articulated(
    shape: Shape, angles: dict[int, Float64[np.ndarray, " t"]], frames: int
) -> PartPositions:
    """Every vertex transformed by its joint; unnamed joints stay at rest."""
    rotation = [np.repeat(np.eye(3)[None], frames, axis=0)]
    offset = [np.zeros((frames, 3))]
    for number, joint in enumerate(shape.joints, start=1):
        turn = axis_rotations(joint.axis, angles.get(number, np.zeros(frames)))
        pivot = np.array(joint.pivot)
        base = rotation[joint.parent]
        rotation.append(base @ turn)
        joint_offset = pivot - np.einsum("tij,j->ti", turn, pivot)
        offset.append(offset[joint.parent] + np.einsum("tij,tj->ti", base, joint_offset))
    turns, offsets = np.stack(rotation, 1), np.stack(offset, 1)
    return tuple(
        np.einsum("tvij,vj->tvi", turns[:, part.surface.joint], part.surface.vertices)
        + offsets[:, part.surface.joint]
        for part in shape.parts
    )


def on_ground(parts: PartPositions) -> PartPositions:
    """Moves the lowest point of every frame to the ground."""
    lowest = np.max([part[..., 1].max(1) for part in parts], axis=0)
    return tuple(part - lowest[:, None, None] * np.array([0.0, 1.0, 0.0]) for part in parts)


def above_ground(parts: PartPositions) -> PartPositions:
    """Raises frames with points below the ground."""
    lowest = np.max([part[..., 1].max(1) for part in parts], axis=0)
    lift = np.maximum(lowest, 0.0)
    return tuple(part - lift[:, None, None] * np.array([0.0, 1.0, 0.0]) for part in parts)


def offsets(
    x: Float64[np.ndarray, " t"] | float = 0.0,
    y: Float64[np.ndarray, " t"] | float = 0.0,
    z: Float64[np.ndarray, " t"] | float = 0.0,
) -> Float64[np.ndarray, "t 3"]:
    """Offset vectors from three coordinates."""
    return np.stack(np.broadcast_arrays(np.atleast_1d(x), y, z), -1).astype(np.float64)


def translated(parts: PartPositions, offset: Float64[np.ndarray, "t 3"]) -> PartPositions:
    """All parts translated by ``offset``."""
    return tuple(part + offset[:, None] for part in parts)
