"""MI-GAN as published, from tensors by its own names: an oracle without any of our code."""

import math

import torch
from torch import Tensor
from torch.nn.functional import conv2d, leaky_relu, pad

WIDTHS = (64, 128, 256, 512, 512, 512, 512, 512)
SIDES = (512, 256, 128, 64, 32, 16, 8, 4)
FILTER = torch.outer(*(torch.tensor([1.0, 3.0, 3.0, 1.0], dtype=torch.float64) / 8,) * 2)


def random_tensors(seed: int = 0) -> dict[str, Tensor]:
    """All that the published file holds of the network, at random; scaled to keep the variance."""
    generator, tensors = torch.Generator().manual_seed(seed), {}

    def conv(name: str, inputs: int, outputs: int, *, kernel: int = 1, bias: bool = True) -> None:
        shape = (outputs, inputs, kernel, kernel)
        weight = torch.randn(shape, generator=generator) / math.sqrt(inputs * kernel**2)
        tensors[f"{name}.weight"] = weight
        if bias:
            tensors[f"{name}.bias"] = 0.1 * torch.randn(outputs, generator=generator)

    def separable(name: str, inputs: int, outputs: int) -> None:
        conv(f"{name}.conv1", 1, inputs, kernel=3)
        conv(f"{name}.conv2", inputs, outputs, bias=False)

    conv("encoder.b512.fromrgb", 4, WIDTHS[0])
    for side, width, coarser in zip(SIDES, WIDTHS, (*WIDTHS[1:], WIDTHS[-1]), strict=True):
        separable(f"encoder.b{side}.conv1", width, width)
        separable(f"encoder.b{side}.conv2", width, coarser)
        separable(f"synthesis.b{side}.conv1", coarser, width)
        separable(f"synthesis.b{side}.conv2", width, width)
        conv(f"synthesis.b{side}.torgb", width, 3)
    return tensors


def completed(tensors: dict[str, Tensor], image: Tensor, known: Tensor) -> Tensor:
    """In float64, with explicit filters; ``image`` is n 3 h w in [0, 1]."""
    weights = {name: value.double() for name, value in tensors.items()}
    mask = known[:, None].double()
    states = torch.cat([mask - 0.5, (2 * image.double() - 1) * mask], 1)
    states = _activated(_conv(weights, "encoder.b512.fromrgb", states))
    by_side = {}
    for side in SIDES:
        by_side[side] = _separable(weights, f"encoder.b{side}.conv1", states)
        resampled = -1 if side > SIDES[-1] else 0
        states = _separable(weights, f"encoder.b{side}.conv2", by_side[side], resampled)
    found = None
    for side in reversed(SIDES):
        resampled = 1 if side > SIDES[-1] else 0
        states = _separable(weights, f"synthesis.b{side}.conv1", states, resampled)
        states = _separable(weights, f"synthesis.b{side}.conv2", states + by_side[side])
        added = _conv(weights, f"synthesis.b{side}.torgb", states)
        found = added if found is None else _doubled(found) + added
    return torch.where(mask > 0, image.double(), (found / 2 + 0.5).clamp(0, 1))


def _separable(weights: dict[str, Tensor], name: str, states: Tensor, resampled: int = 0) -> Tensor:
    states = _activated(_conv(weights, f"{name}.conv1", states, groups=states.shape[1]))
    if resampled < 0:
        kernel = FILTER.expand(states.shape[1], 1, 4, 4)
        states = conv2d(states, kernel, stride=2, padding=1, groups=states.shape[1])
    states = _conv(weights, f"{name}.conv2", states)
    return _activated(_doubled(states) if resampled > 0 else states)


def _conv(weights: dict[str, Tensor], name: str, states: Tensor, groups: int = 1) -> Tensor:
    weight, bias = weights[f"{name}.weight"], weights.get(f"{name}.bias")
    return conv2d(states, weight, bias, padding=weight.shape[-1] // 2, groups=groups)


def _activated(states: Tensor) -> Tensor:
    return (leaky_relu(states, 0.2) * math.sqrt(2)).clamp(-256, 256)


def _doubled(states: Tensor) -> Tensor:
    """Zeros between the cells, then the filter with a gain of 4."""
    n, c, h, w = states.shape
    apart = states.new_zeros(n, c, 2 * h, 2 * w)
    apart[..., ::2, ::2] = states
    return conv2d(pad(apart, (2, 1, 2, 1)), 4 * FILTER.expand(c, 1, 4, 4), groups=c)
