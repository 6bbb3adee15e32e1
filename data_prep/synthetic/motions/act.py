"""What a motion gets, what it gives, and the tools they share.

Axes: ``t`` frames, ``v`` vertices. A motion plays on the plane y = 0 in a frame of its own:
whatever goes somewhere goes along +x, from −travel/2 to +travel/2. Progress u runs from 0 to 1 in
the clip.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.synthetic.draws import Draws
from diff4splat.data_prep.synthetic.shapes.shape import Shape

GRAVITY = 9.81
Posed = tuple[Float64[np.ndarray, "_ _ 3"], ...]
"""Positions of every part: frames (1 where nothing moves), vertices, coordinates."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Act:
    """Who moves, when, and how far."""

    shape: Shape
    times_s: Float64[np.ndarray, " t"]
    travel_m: float
    draws: Draws

    @property
    def progress(self) -> Float64[np.ndarray, " t"]:
        """0 at the first frame, 1 at the last."""
        since = self.times_s - self.times_s[0]
        return since / max(float(since[-1]), 1e-9)

    @property
    def seconds(self) -> float:
        """How long the clip is."""
        return float(self.times_s[-1] - self.times_s[0])

    def along(self) -> Float64[np.ndarray, " t"]:
        """X of something that starts gently and keeps going."""
        u = self.progress
        start = self.draws.between(0.0, 0.25)
        eased = np.where(u < start, u * u / (2 * max(start, 1e-6)), u - start / 2) / (1 - start / 2)
        return self.travel_m * (eased - 0.5)

    def waving(self, low_hz: float, high_hz: float) -> Float64[np.ndarray, " t"]:
        """Phase in radians of something periodic."""
        rate = self.draws.between(low_hz, high_hz)
        return 2 * np.pi * (rate * self.times_s + self.draws.between(0.0, 1.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Performance:
    """The shape, which may have gained a rope, and where all of it is."""

    shape: Shape
    parts: Posed


def resting(shape: Shape, frames: int = 1) -> Posed:
    """Everything as it was made."""
    return tuple(np.repeat(part.surface.vertices[None], frames, axis=0) for part in shape.parts)


def bent(
    shape: Shape,
    displace: Callable[[Float64[np.ndarray, "v 3"]], Float64[np.ndarray, "t v 3"]],
) -> Posed:
    """Every vertex moved by a function of where it rests."""
    return tuple(displace(part.surface.vertices) for part in shape.parts)


def carried(
    parts: Posed,
    rotation: Float64[np.ndarray, "t 3 3"],
    pivot: Float64[np.ndarray, "3"],
    offset: Float64[np.ndarray, "t 3"],
) -> Posed:
    """Everything turned about ``pivot``, then shifted."""
    return tuple(
        (part - pivot) @ rotation.transpose(0, 2, 1) + (pivot + offset)[:, None] for part in parts
    )


def turning(
    axis: tuple[float, float, float], angle_rad: Float64[np.ndarray, " t"]
) -> Float64[np.ndarray, "t 3 3"]:
    """Rotations about an axis (Rodrigues)."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, cosine = np.sin(angle_rad)[:, None, None], np.cos(angle_rad)[:, None, None]
    return np.eye(3) + sine * cross + (1 - cosine) * (cross @ cross)


def jointed(shape: Shape, angles: dict[int, Float64[np.ndarray, " t"]], frames: int) -> Posed:
    """Every vertex carried by its joint; joints that are not named stay."""
    rotation = [np.repeat(np.eye(3)[None], frames, axis=0)]
    offset = [np.zeros((frames, 3))]
    for number, joint in enumerate(shape.joints, start=1):
        turn = turning(joint.axis, angles.get(number, np.zeros(frames)))
        pivot = np.array(joint.pivot)
        base = rotation[joint.parent]
        rotation.append(base @ turn)
        own = pivot - np.einsum("tij,j->ti", turn, pivot)
        offset.append(offset[joint.parent] + np.einsum("tij,tj->ti", base, own))
    turns, shifts = np.stack(rotation, 1), np.stack(offset, 1)
    return tuple(
        np.einsum("tvij,vj->tvi", turns[:, part.surface.joint], part.surface.vertices)
        + shifts[:, part.surface.joint]
        for part in shape.parts
    )


def settled(parts: Posed) -> Posed:
    """Lowest point of every frame on the ground."""
    lowest = np.max([part[..., 1].max(1) for part in parts], axis=0)
    return tuple(part - lowest[:, None, None] * np.array([0.0, 1.0, 0.0]) for part in parts)


def above_ground(parts: Posed) -> Posed:
    """Raised where anything would be below the ground."""
    lowest = np.max([part[..., 1].max(1) for part in parts], axis=0)
    lift = np.maximum(lowest, 0.0)
    return tuple(part - lift[:, None, None] * np.array([0.0, 1.0, 0.0]) for part in parts)


def shifts(
    x: Float64[np.ndarray, " t"] | float = 0.0,
    y: Float64[np.ndarray, " t"] | float = 0.0,
    z: Float64[np.ndarray, " t"] | float = 0.0,
) -> Float64[np.ndarray, "t 3"]:
    """Offsets from their three coordinates."""
    return np.stack(np.broadcast_arrays(np.atleast_1d(x), y, z), -1).astype(np.float64)


def shifted(parts: Posed, offset: Float64[np.ndarray, "t 3"]) -> Posed:
    """Everything moved by the same way."""
    return tuple(part + offset[:, None] for part in parts)
