"""A world as one list of triangles, static ones first.

Axes: ``t`` frames, ``v`` vertices, ``f`` triangles, ``o`` objects.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32, UInt8

from diff4splat.data_prep.synthetic.world import World, WorldObject
from diff4splat.errors import ConfigError, InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class TriangleBuffer:
    """All triangles of a world, with their attributes."""

    objects: tuple[WorldObject, ...]
    """Static objects, then moving ones."""
    positions: Float64[np.ndarray, "t v 3"]
    rest: Float64[np.ndarray, "v 3"]
    uv: Float64[np.ndarray, "v 2"]
    triangles: Int32[np.ndarray, "f 3"]
    owners: Int32[np.ndarray, " f"]
    """Index into ``objects``."""
    instances: UInt8[np.ndarray, " o"]
    static_count: int
    """Number of static triangles; they come first."""


def build_triangle_buffer(world: World) -> TriangleBuffer:
    """Check a world and concatenate its meshes.

    Raises:
        ConfigError: instances are out of range or not unique.
        InputError: shapes do not fit, or positions are not finite.
    """
    numbers = [item.instance for item in world.objects]
    if any(not 1 <= number <= 254 for number in numbers) or len(set(numbers)) != len(numbers):
        raise ConfigError(f"instances: expected different numbers from 1 to 254, got {numbers}")
    frames = len(world.times_s)
    for item in world.objects:
        _check(item, frames)
    objects = tuple(sorted(world.objects, key=lambda item: len(item.positions) > 1))
    counts = [len(item.mesh.rest) for item in objects]
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    sizes = [len(item.mesh.triangles) for item in objects]
    positions = np.zeros((frames, int(starts[-1]), 3))
    for item, start in zip(objects, starts, strict=False):
        positions[:, start : start + len(item.mesh.rest)] = item.positions
    return TriangleBuffer(
        objects=objects,
        positions=positions,
        rest=_joined([item.mesh.rest for item in objects], (0, 3), np.float64),
        uv=_joined([item.mesh.uv for item in objects], (0, 2), np.float64),
        triangles=_joined(
            [item.mesh.triangles + start for item, start in zip(objects, starts, strict=False)],
            (0, 3),
            np.int32,
        ),
        owners=np.repeat(np.arange(len(objects), dtype=np.int32), sizes),
        instances=np.array([item.instance for item in objects], np.uint8),
        static_count=sum(
            size for size, item in zip(sizes, objects, strict=True) if len(item.positions) == 1
        ),
    )


def _joined(parts: list[np.ndarray], empty: tuple[int, int], kind: type) -> np.ndarray:
    return np.concatenate([np.zeros(empty, kind), *parts]).astype(kind)


def _check(item: WorldObject, frames: int) -> None:
    """Check shapes, indices and finite values."""
    what, mesh = f"instance {item.instance}", item.mesh
    vertices = len(mesh.rest)
    if len(item.positions) not in (1, frames) or item.positions.shape[1:] != (vertices, 3):
        raise InputError(
            f"{what}: expected positions for 1 or {frames} frames of {vertices} vertices, "
            f"got {item.positions.shape}"
        )
    if len(mesh.uv) != vertices:
        raise InputError(f"{what}: expected uv of {vertices} vertices, got {len(mesh.uv)}")
    for name, values in (("positions", item.positions), ("rest", mesh.rest), ("uv", mesh.uv)):
        if not np.isfinite(values).all():
            raise InputError(f"{what}: expected finite {name}, got NaN or infinity")
    if mesh.triangles.size and not 0 <= mesh.triangles.min() <= mesh.triangles.max() < vertices:
        raise InputError(f"{what}: expected triangles of vertices 0 to {vertices - 1}, got others")
