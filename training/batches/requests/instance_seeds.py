"""Seeds of objects: one of its pixels, or those around it, and the object's mask.

Axes: ``b`` images, ``s`` seeds of an image, ``h w`` pixels, ``p`` pixels of a flattened image.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

SEEDS = 6
AREA_SHARES = (0.0025, 0.5)
"""Smallest and largest share of the image of an object that gets a seed."""
SINGLE_SHARE = 0.5
"""Share of seeds that are one pixel."""
RADII = (0.015, 0.125)
"""Smallest and largest radius of the others, as shares of the longer side."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InstanceSeeds:
    """Weights of the pixels of seeds, the objects that they lie on, and which of them exist."""

    weights: Float[Tensor, "*b s p"]
    masks: Bool[Tensor, "*b s h w"]
    valid: Bool[Tensor, "*b s"]


def draw_seeds(numbers: UInt8[Tensor, "h w"], generator: torch.Generator) -> InstanceSeeds:
    """Of different objects as far as there are enough; none is valid without an object.

    ``numbers`` has the object of every pixel, 0 for none.
    """
    weights = torch.zeros(SEEDS, numbers.numel())
    masks = torch.zeros(SEEDS, *numbers.shape, dtype=torch.bool)
    valid = torch.zeros(SEEDS, dtype=torch.bool)
    for place, number in enumerate(_objects(numbers, generator)):
        masks[place] = numbers == number
        weights[place] = _seed(masks[place], generator)
        valid[place] = True
    return InstanceSeeds(weights=weights, masks=masks, valid=valid)


def stack_seeds(seeds: list[InstanceSeeds]) -> InstanceSeeds:
    """Seeds of several images."""
    return InstanceSeeds(
        weights=torch.stack([one.weights for one in seeds]),
        masks=torch.stack([one.masks for one in seeds]),
        valid=torch.stack([one.valid for one in seeds]),
    )


def _objects(numbers: UInt8[Tensor, "h w"], generator: torch.Generator) -> Int[Tensor, " s"]:
    """Numbers of the objects, again from the first where there are too few."""
    area = torch.bincount(numbers.flatten().long())
    least, most = (share * numbers.numel() for share in AREA_SHARES)
    able = ((area >= least) & (area <= most)).nonzero()[:, 0]
    able = able[able > 0]
    if len(able) == 0:
        return able
    order = able[torch.randperm(len(able), generator=generator)]
    return order.repeat(SEEDS // len(order) + 1)[:SEEDS]


def _seed(mask: Bool[Tensor, "h w"], generator: torch.Generator) -> Float[Tensor, " p"]:
    """Weights that sum to one."""
    pixels = mask.nonzero()
    center = pixels[int(torch.randint(len(pixels), (), generator=generator))]
    single, share = torch.rand(2, generator=generator).tolist()
    radius = 0.0
    if single >= SINGLE_SHARE:
        radius = (RADII[0] + (RADII[1] - RADII[0]) * share) * max(mask.shape)
    near = pixels[(pixels - center).square().sum(1) <= radius**2]
    weights = torch.zeros(mask.shape)
    weights[near[:, 0], near[:, 1]] = 1 / len(near)
    return weights.flatten()
