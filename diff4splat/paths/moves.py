"""Elementary camera moves as functions of progress u in [0, 1]; every move starts at the identity.

Axes: ``t`` frames. OpenCV axes (x right, y down, z forward), float64. ``extent`` is a length in
scene units or an angle in radians (see ``presets``). The focus point is (0, 0, focus_depth).
The lemniscate is Bernoulli's: x = a sin θ / (1 + cos² θ), y = a sin θ cos θ / (1 + cos² θ).
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry import rigid

SPIRAL_TURNS = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Move:
    """Poses relative to the start of the move, and what multiplies the focal length there."""

    world_from_camera: Float[Tensor, "t 4 4"]
    focal_factor: Float[Tensor, " t"]

    def __getitem__(self, index: slice) -> "Move":
        return Move(
            world_from_camera=self.world_from_camera[index], focal_factor=self.focal_factor[index]
        )


def fixed_lens(world_from_camera: Float[Tensor, "t 4 4"]) -> Move:
    """A move that leaves the focal length alone."""
    factor = torch.ones_like(world_from_camera[:, 0, 0])
    return Move(world_from_camera=world_from_camera, focal_factor=factor)


def straight(
    progress: Float[Tensor, " t"],
    extent: float,
    focus_depth: float,
    direction: tuple[float, float, float],
) -> Move:
    """Travel ``extent`` along the unit vector ``direction`` without turning."""
    del focus_depth
    position = extent * progress[:, None] * progress.new_tensor(direction)
    return fixed_lens(_unturned(position))


def orbit(progress: Float[Tensor, " t"], extent: float, focus_depth: float) -> Move:
    """Circle the focus point by ``extent`` radians, to the right first, keeping it centred."""
    return fixed_lens(_swing(extent * progress, focus_depth))


def arc(progress: Float[Tensor, " t"], extent: float, focus_depth: float) -> Move:
    """Swing right, left and back around the focus point; ``extent`` is the arc length one way."""
    return fixed_lens(_swing(extent / focus_depth * torch.sin(2 * math.pi * progress), focus_depth))


def spiral(progress: Float[Tensor, " t"], extent: float, focus_depth: float) -> Move:
    """Circle with a radius growing to ``extent``, looking at the focus point."""
    angle = 2 * math.pi * SPIRAL_TURNS * progress
    radius = extent * progress
    return _watching(radius * angle.cos(), radius * angle.sin(), focus_depth)


def figure8(progress: Float[Tensor, " t"], extent: float, focus_depth: float) -> Move:
    """A lying eight of half width ``extent`` in the image plane, looking at the focus point."""
    angle = 2 * math.pi * progress
    across = extent * angle.sin() / (1 + angle.cos().square())
    return _watching(across, across * angle.cos(), focus_depth)


def roll(progress: Float[Tensor, " t"], extent: float, focus_depth: float) -> Move:
    """Turn about the viewing axis by ``extent`` radians, clockwise as the camera sees it."""
    del focus_depth
    angle = extent * progress
    one, zero = torch.ones_like(angle), torch.zeros_like(angle)
    rows = [angle.cos(), -angle.sin(), zero, angle.sin(), angle.cos(), zero, zero, zero, one]
    rotation = torch.stack(rows, -1).unflatten(-1, (3, 3))
    return fixed_lens(rigid.from_parts(rotation, torch.zeros_like(rotation[:, 0])))


def dolly_zoom(progress: Float[Tensor, " t"], extent: float, focus_depth: float) -> Move:
    """Travel ``extent`` forward while focal length / depth of the focus plane stays the same."""
    poses = straight(progress, extent, focus_depth, (0.0, 0.0, 1.0)).world_from_camera
    return Move(world_from_camera=poses, focal_factor=(focus_depth - poses[:, 2, 3]) / focus_depth)


def _unturned(position: Float[Tensor, "t 3"]) -> Float[Tensor, "t 4 4"]:
    rotation = torch.eye(3, dtype=position.dtype, device=position.device)
    return rigid.from_parts(rotation.expand(len(position), 3, 3), position)


def _swing(angle_rad: Float[Tensor, " t"], focus_depth: float) -> Float[Tensor, "t 4 4"]:
    """Poses on the horizontal circle around the focus point, which see it in their centre."""
    sine, cosine = angle_rad.sin(), angle_rad.cos()
    one, zero = torch.ones_like(sine), torch.zeros_like(sine)
    rows = [cosine, zero, -sine, zero, one, zero, sine, zero, cosine]
    position = focus_depth * torch.stack([sine, zero, 1 - cosine], -1)
    return rigid.from_parts(torch.stack(rows, -1).unflatten(-1, (3, 3)), position)


def _watching(x: Float[Tensor, " t"], y: Float[Tensor, " t"], focus_depth: float) -> Move:
    """Cameras at (x, y, 0) that see the focus point in their centre, upright."""
    position = torch.stack([x, y, torch.zeros_like(x)], -1)
    target, down = x.new_tensor([0.0, 0.0, focus_depth]), x.new_tensor([0.0, 1.0, 0.0])
    return fixed_lens(rigid.look_at(position, target, down))
