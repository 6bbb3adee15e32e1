"""The motion of one object that is asked to move to a side.

Axes: ``t`` latent frames, ``h w`` pixels. The object moves as one, at a constant velocity.
"""

import math

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.models.motion_unet.motion_field import UNIT

MEDIAN_LENGTH, LENGTH_SPREAD = 0.26, 0.32
"""Displacement over depth: median and standard deviation of the logarithm in procedural worlds."""
LENGTHS = (0.1, 0.5)
DIRECTIONS = {
    "left": (-1.0, 0.0, 0.0),
    "right": (1.0, 0.0, 0.0),
    "toward": (0.0, 0.0, -1.0),
    "away": (0.0, 0.0, 1.0),
}
WEIGHTS = (3.0, 3.0, 1.0, 1.0)
"""Of the directions, as in procedural worlds."""
LARGEST_TURN_RAD = math.radians(20)
"""Largest angle between displacement and direction."""


def draw_direction(generator: torch.Generator) -> str:
    """One of ``DIRECTIONS``, by their weights."""
    return list(DIRECTIONS)[int(torch.tensor(WEIGHTS).multinomial(1, generator=generator))]


def draw_motion(
    mask: Bool[Tensor, "h w"],
    depth: Float[Tensor, "h w"],
    latent_frames: int,
    direction: str,
    generator: torch.Generator,
) -> Float[Tensor, "3 t h w"]:
    """Relative displacement of the pixels of ``mask``, which have depth, as ``pixel_motion``."""
    end = _relative_displacement(direction, generator) * depth[mask].median() / UNIT
    progress = torch.linspace(0, 1, latent_frames)
    motion = torch.zeros(3, latent_frames, *mask.shape)
    motion[:, :, mask] = (end[:, None] * progress)[..., None] / depth[mask]
    return motion


def _relative_displacement(direction: str, generator: torch.Generator) -> Float[Tensor, "3"]:
    """A displacement near ``direction``, in units of the depth."""
    spread = LENGTH_SPREAD * torch.randn((), generator=generator)
    length = (MEDIAN_LENGTH * spread.exp()).clamp(*LENGTHS)
    turn = LARGEST_TURN_RAD * (2 * torch.rand((), generator=generator) - 1)
    x, _, z = DIRECTIONS[direction]
    cos, sin = turn.cos(), turn.sin()
    return length * torch.stack([cos * x - sin * z, torch.zeros(()), sin * x + cos * z])
