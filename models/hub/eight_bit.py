"""Weights in eight bits: whole numbers, and a scale for every output channel.

    weight [o, …]  ─►  weight int8 [o, …],  weight.scale float32 [o]

A weight is off by half a step at most: 1/254 of the largest of its channel. Tensors of fewer than
two axes, and small ones, stay in half precision.
"""

from collections.abc import Mapping

import torch
from torch import Tensor

from diff4splat.errors import FileFormatError

SCALE = ".scale"
"""At the end of the name of a scale."""
LARGEST = 127
LEAST_WEIGHTS = 4096
"""Of a tensor in eight bits: the others take no room."""


def to_eight_bits(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Large weights with scales, and the others in half precision."""
    stored: dict[str, Tensor] = {}
    for name, weight in tensors.items():
        if weight.ndim < 2 or weight.numel() < LEAST_WEIGHTS:
            stored[name] = weight.half()
            continue
        scale = _scales(weight)
        whole = (weight.float() / _along_first(scale, weight)).round()
        stored[name] = whole.clamp(-LARGEST, LARGEST).to(torch.int8)
        stored[name + SCALE] = scale
    return stored


def from_eight_bits(stored: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The same in float32, without scales; tensors of other types as they are.

    Raises:
        FileFormatError: a weight has no scale, or one for other channels.
    """
    scaled = [name for name, value in stored.items() if value.dtype == torch.int8]
    scales = {name + SCALE for name in scaled}
    tensors = {name: value for name, value in stored.items() if name not in scales}
    for name in scaled:
        weight, scale = stored[name], stored.get(name + SCALE)
        if scale is None or scale.shape != weight.shape[:1]:
            shape = "none" if scale is None else str(tuple(scale.shape))
            raise FileFormatError(
                f"{name + SCALE}: expected a scale for {len(weight)} channels, got {shape}"
            )
        tensors[name] = weight.float() * _along_first(scale, weight)
    return tensors


def _scales(weight: Tensor) -> Tensor:
    """Of every output channel; of one of zeros the least above 0."""
    largest = weight.float().flatten(1).abs().amax(1)
    return (largest / LARGEST).clamp_min(torch.finfo(torch.float32).tiny)


def _along_first(scale: Tensor, weight: Tensor) -> Tensor:
    return scale.float().reshape(-1, *[1] * (weight.ndim - 1))
