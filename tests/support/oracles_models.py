"""Float64 oracles of the networks' building blocks, written from the formulas with plain loops."""

import math

import torch
from torch import Tensor, nn


def randomised(network: nn.Module, seed: int = 0) -> nn.Module:
    """Every weight, the zero-initialised ones too, drawn so that activations are of order one."""
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in network.parameters():
            fan_in = max(parameter[0].numel(), 1) if parameter.dim() > 1 else 4
            noise = torch.randn(parameter.shape, generator=generator, dtype=torch.float64)
            parameter.add_(noise.to(parameter) / math.sqrt(fan_in))
    return network


def packed_frames(video: Tensor) -> Tensor:
    """(b, c, f, h, w) to (b, 4 c, t, h, w): pack i holds frames 4i−3 … 4i, frame 0 four times."""
    batch, channels, frames, height, width = video.shape
    packs = 1 + (frames - 1) // 4
    result = torch.zeros(batch, channels * 4, packs, height, width, dtype=video.dtype)
    for pack in range(packs):
        for channel in range(channels):
            for sub in range(4):
                result[:, 4 * channel + sub, pack] = video[:, channel, max(4 * pack - 3 + sub, 0)]
    return result


def patches(maps: Tensor, patch: tuple[int, int, int]) -> Tensor:
    """Blocks of (t, h, w), each listed as (c, t, h, w)."""
    pt, ph, pw = patch
    batch, _, frames, height, width = maps.shape
    rows = [
        maps[:, :, t : t + pt, i : i + ph, j : j + pw].reshape(batch, -1)
        for t in range(0, frames, pt)
        for i in range(0, height, ph)
        for j in range(0, width, pw)
    ]
    return torch.stack(rows, 1).reshape(batch, frames // pt, height // ph, width // pw, -1)


def rotated(heads: Tensor, grid: tuple[int, int, int], widths: tuple[int, int, int]) -> Tensor:
    """Rotary embedding with complex numbers in float64; ``heads`` is (b, n, h, d)."""
    result = heads.double().clone()
    positions = [(t, i, j) for t in range(grid[0]) for i in range(grid[1]) for j in range(grid[2])]
    for token, position in enumerate(positions):
        channel = 0
        for axis, width in enumerate(widths):
            for pair in range(width // 2):
                angle = position[axis] * 10000.0 ** (-2 * pair / width)
                turn = complex(math.cos(angle), math.sin(angle))
                number = torch.complex(
                    result[:, token, :, channel], result[:, token, :, channel + 1]
                )
                number = number * turn
                result[:, token, :, channel] = number.real
                result[:, token, :, channel + 1] = number.imag
                channel += 2
    return result


def attention(query: Tensor, key: Tensor, value: Tensor) -> Tensor:
    """softmax(q kᵀ / √c) v for (b, n, h, c), one head and one query at a time."""
    batch, tokens, heads, width = query.shape
    result = torch.zeros(batch, tokens, heads, width, dtype=torch.float64)
    for b in range(batch):
        for h in range(heads):
            for n in range(tokens):
                logits = [
                    float(query[b, n, h] @ key[b, s, h]) / math.sqrt(width)
                    for s in range(key.shape[1])
                ]
                weights = [math.exp(logit - max(logits)) for logit in logits]
                for s, weight in enumerate(weights):
                    result[b, n, h] += weight / sum(weights) * value[b, s, h].double()
    return result.flatten(2)


def t5_bucket(distance: int, buckets: int, max_distance: int) -> int:
    """Bidirectional relative-position bucket of T5; ``distance`` is key minus query."""
    half = buckets // 2
    start = half if distance > 0 else 0
    far = abs(distance)
    exact = half // 2
    if far < exact:
        return start + far
    growth = math.log(far / exact) / math.log(max_distance / exact)
    return start + min(exact + int(growth * (half - exact)), half - 1)


def upsampled_bilinear(image: Tensor, scale: int) -> Tensor:
    """(c, h, w) enlarged with half-pixel centres, edges held."""
    channels, height, width = image.shape
    result = torch.zeros(channels, height * scale, width * scale, dtype=torch.float64)
    for i in range(height * scale):
        for j in range(width * scale):
            y = min(max((i + 0.5) / scale - 0.5, 0.0), height - 1.0)
            x = min(max((j + 0.5) / scale - 0.5, 0.0), width - 1.0)
            top, left = int(y), int(x)
            low, right = min(top + 1, height - 1), min(left + 1, width - 1)
            dy, dx = y - top, x - left
            result[:, i, j] = (1 - dy) * (
                (1 - dx) * image[:, top, left] + dx * image[:, top, right]
            ) + dy * ((1 - dx) * image[:, low, left] + dx * image[:, low, right])
    return result
