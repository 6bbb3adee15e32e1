"""Images as textures: a stack of levels, each half as large as the one before (Williams 1983)."""

from functools import cache

import numpy as np
from jaxtyping import Float32, UInt8

from diff4splat.data_prep.synthetic.renderer.shading.tone import decoded
from diff4splat.data_prep.synthetic.renderer.triangle_buffer import TriangleBuffer
from diff4splat.errors import ConfigError
from diff4splat.kernels.jit import shared

IMAGE = "image"
"""Family of textures that are images."""
SIDE = 128
"""Texels along each side of the finest level, a power of two."""
TEXELS = (4 * SIDE * SIDE - 1) // 3
"""Of all levels."""


def image_stacks(
    buffer: TriangleBuffer,
) -> tuple[Float32[np.ndarray, "i texels 3"], np.ndarray]:
    """Levels of every image, and which image each object has; -1 is none.

    Raises:
        ConfigError: an image has another size, or its texture is of another family.
    """
    numbers, stacks = [], []
    known: dict[bytes, int] = {}
    for item in buffer.objects:
        image = item.texture.image
        if (image is None) == (item.texture.family == IMAGE):
            raise ConfigError("texture: expected an image and family 'image', got one of both")
        key = b"" if image is None else image.tobytes()
        if image is not None and key not in known:
            known[key] = len(stacks)
            stacks.append(_stack(image))
        numbers.append(known.get(key, -1))
    levels = np.stack(stacks) if stacks else np.zeros((0, TEXELS, 3), np.float32)
    return levels, np.array(numbers, np.int64)


def _stack(image: UInt8[np.ndarray, "s s 3"]) -> Float32[np.ndarray, "texels 3"]:
    """Linear light of all levels, the finest first; each texel is the mean of four."""
    if image.shape != (SIDE, SIDE, 3):
        raise ConfigError(f"texture: expected an image of {SIDE} x {SIDE}, got {image.shape}")
    level = _light()[image]
    levels = [level]
    while len(level) > 1:
        level = (level[::2, ::2] + level[1::2, ::2] + level[::2, 1::2] + level[1::2, 1::2]) / 4
        levels.append(level)
    return np.concatenate([one.reshape(-1, 3) for one in levels]).astype(np.float32)


@cache
def _light() -> np.ndarray:
    """Linear light of each byte."""
    return np.array([decoded(byte / 255) for byte in range(256)])


@shared
def image_color(stacks, number, u, v, footprint):
    """Red, green and blue at (u, v), in repeats of the image; linear between four texels.

    The level is the first whose texels are at least as large as ``footprint``.
    """
    side, start = SIDE, 0
    while side > 1 and footprint * side > 1.0:
        start += side * side
        side //= 2
    x, y = (u - np.floor(u)) * side - 0.5, (v - np.floor(v)) * side - 0.5
    left, top = np.floor(x), np.floor(y)
    right_share, below_share = x - left, y - top
    i, j = (int(left) + side) % side, (int(top) + side) % side
    above, below = start + j * side, start + (j + 1) % side * side
    after = (i + 1) % side
    red = green = blue = 0.0
    for at in range(3):
        first = stacks[number, above + i, at] * (1.0 - right_share)
        first += stacks[number, above + after, at] * right_share
        second = stacks[number, below + i, at] * (1.0 - right_share)
        second += stacks[number, below + after, at] * right_share
        red, green, blue = green, blue, first + (second - first) * below_share
    return red, green, blue
