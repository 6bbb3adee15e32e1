"""A small room with many-coloured walls and things in its middle, and cameras that walk in it.

Lengths in metres, times in seconds. Everything is drawn from a seed.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry import rigid
from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.paths.camera_path import CameraPath
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import dc_from_color
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Provenance, Scene

HALF_ROOM = 2.0
PER_SIDE = 8
"""Patches along each edge of a wall."""
THINGS = 160
MOVING = 40
SPEED = 1.5
"""Metres in the whole of the time."""
ALWAYS = 50.0
"""Deviation of a pulse that does not fade within a second."""


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """What is photographed."""

    scene: Scene
    moving: int


def world(seed: int, moving: bool, duration_s: float = 1.0) -> World:
    """Walls, and things of which the first few go their way at constant speed."""
    generator = torch.Generator().manual_seed(seed)
    things, walls = _things(generator), _walls(generator)
    both = {name: torch.cat([things[name], walls[name]]) for name in things}
    gaussians = Gaussians(**both)
    motion: Motion = StaticMotion(time_range_s=(0.0, duration_s))
    if moving:
        motion = _flight(gaussians, generator, duration_s)
    scene = Scene(
        gaussians=gaussians, motion=motion, path=_path(), provenance=Provenance(generator="room")
    )
    return World(scene=scene, moving=MOVING if moving else 0)


def views(
    count: int, like: Camera, seed: int, distance: float = 1.4, wander: float = 0.5
) -> list[Camera]:
    """Cameras on a ring inside the room; each looks past the middle in a way of its own.

    They look at places in a box of ``wander``, from heights in a range 0.3 larger.
    """
    generator = torch.Generator().manual_seed(seed)
    found = []
    for number in range(count):
        angle = 2 * math.pi * (number + 0.3 * float(torch.rand(1, generator=generator))) / count
        height = (wander + 0.3) * (float(torch.rand(1, generator=generator)) - 0.5)
        eye = torch.tensor([distance * math.sin(angle), height, -distance * math.cos(angle)])
        at = wander * (torch.rand(3, generator=generator) - 0.5)
        pose = rigid.look_at(eye.double(), at.double(), torch.tensor([0.0, 1.0, 0.0]).double())
        found.append(like.with_pose(pose))
    return found


def _things(generator: torch.Generator) -> dict[str, Tensor]:
    means = 1.4 * (torch.rand(THINGS, 3, generator=generator) - 0.5)
    scales = 0.04 + 0.08 * torch.rand(THINGS, 3, generator=generator)
    return _parts(means, scales, torch.rand(THINGS, 3, generator=generator), generator)


def _walls(generator: torch.Generator) -> dict[str, Tensor]:
    """Flat patches, twice as wide as they lie apart, so that nothing shines through."""
    step = 2 * HALF_ROOM / PER_SIDE
    at = (torch.arange(PER_SIDE) + 0.5) * step - HALF_ROOM
    plane = torch.stack(torch.meshgrid(at, at, indexing="ij"), -1).flatten(0, 1)
    means, scales = [], []
    for axis in range(3):
        for side in (-HALF_ROOM, HALF_ROOM):
            place = torch.full((len(plane), 3), side)
            size = torch.full((len(plane), 3), 0.6 * step)
            place[:, [other for other in range(3) if other != axis]] = plane
            size[:, axis] = 0.05
            means.append(place)
            scales.append(size)
    colors = torch.rand(6 * len(plane), 3, generator=generator)
    found = _parts(torch.cat(means), torch.cat(scales), colors, generator)
    found["quats"] = torch.tensor([[1.0, 0, 0, 0]]).repeat(len(colors), 1)
    return found


def _parts(
    means: Float[Tensor, "n 3"],
    scales: Float[Tensor, "n 3"],
    colors: Float[Tensor, "n 3"],
    generator: torch.Generator,
) -> dict[str, Tensor]:
    return {
        "means": means,
        "quats": torch.nn.functional.normalize(
            torch.randn(len(means), 4, generator=generator), dim=-1
        ),
        "scales": scales,
        "opacities": torch.full((len(means),), 0.9),
        "sh": dc_from_color(colors)[:, None],
    }


def _flight(gaussians: Gaussians, generator: torch.Generator, duration_s: float) -> SpacetimeMotion:
    """The first things cross the room, about alike."""
    gaussians.scales[:MOVING] *= 1.5
    heading = torch.nn.functional.normalize(torch.randn(1, 3, generator=generator), dim=-1)
    spread = 0.3 * torch.randn(MOVING, 3, generator=generator)
    return SpacetimeMotion(
        moving_index=torch.arange(MOVING),
        velocities=(heading * SPEED + spread) / duration_s,
        time_centers_s=torch.full((MOVING,), duration_s / 2),
        time_deviations_s=torch.full((MOVING,), ALWAYS * duration_s),
        time_range_s=(0.0, duration_s),
        period_s=duration_s,
    )


def _path() -> CameraPath:
    camera = pinhole(64.0, (64, 64), torch.float64)
    return CameraPath(
        cameras=camera.with_pose(torch.eye(4).double()[None]), times_s=torch.zeros(1).double()
    )
