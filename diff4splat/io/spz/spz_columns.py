"""Numbers of an SPZ file: what each is rounded to (https://github.com/nianticlabs/spz, MIT).

Axes: ``n`` Gaussians, ``k`` harmonics after the first. Positions are fixed point in 24 bits.
Colour, opacity, harmonics and logarithms of scales, in steps of 1/16, have 8 bits. A quaternion has
its three small components in 10 bits each (version 3), or its vector part in 8 bits (version 2).
"""

import math

import numpy as np
from jaxtyping import Float, UInt8, UInt32

POSITION_BITS, MAX_FRACTION_BITS = 24, 20
SCALE_STEPS, SCALE_SHIFT = 16.0, 10.0
COLOR_SCALE = 0.15
FIRST_BAND, FIRST_STEP, LATER_STEP = 3, 8, 16
"""Harmonics of the first band are multiples of 8, those of later bands of 16."""
SMALL_BITS = 10
_MAGNITUDE = (1 << (SMALL_BITS - 1)) - 1


def fraction_bits(means: Float[np.ndarray, "n 3"]) -> int:
    """The most bits after the point that all coordinates fit with."""
    largest = float(np.abs(means).max(initial=0.0))
    room = (1 << (POSITION_BITS - 1)) - 1
    if largest * 2.0**MAX_FRACTION_BITS <= room:
        return MAX_FRACTION_BITS
    return max(0, math.floor(math.log2(room / largest)))


def pack_positions(means: Float[np.ndarray, "n 3"], bits: int) -> UInt8[np.ndarray, "n 9"]:
    """Little-endian, three bytes each."""
    fixed = np.rint(means.astype(np.float64) * 2.0**bits).astype("<i4")
    return fixed.view(np.uint8).reshape(len(means), 3, 4)[..., :3].reshape(len(means), 9)


def unpack_positions(packed: UInt8[np.ndarray, "n 9"], bits: int) -> Float[np.ndarray, "n 3"]:
    """The inverse; the highest bit is the sign."""
    low, middle, high = packed.reshape(-1, 3, 3).astype(np.int32).transpose(2, 0, 1)
    fixed = low | (middle << 8) | (high << 16)
    return (fixed - ((fixed >> 23) << 24)) / 2.0**bits


def pack_bytes(values: Float[np.ndarray, "..."]) -> UInt8[np.ndarray, "..."]:
    """The nearest whole numbers from 0 to 255."""
    return np.rint(np.clip(values, 0, 255)).astype(np.uint8)


def pack_harmonics(rest: Float[np.ndarray, "n k 3"]) -> UInt8[np.ndarray, "n k 3"]:
    """Multiples of a step that is coarser for later bands."""
    step = np.where(np.arange(rest.shape[1]) < FIRST_BAND, FIRST_STEP, LATER_STEP)[:, None]
    near = np.rint(rest * 128) + 128
    return np.clip(np.floor((near + step // 2) / step) * step, 0, 255).astype(np.uint8)


def pack_smallest_three(quats: Float[np.ndarray, "n 4"]) -> UInt32[np.ndarray, " n"]:
    """(w, x, y, z) to the index of the largest component and the three others."""
    xyzw = np.roll(quats, -1, axis=1)
    largest = np.abs(xyzw).argmax(1)
    turned = xyzw * np.where(np.take_along_axis(xyzw, largest[:, None], 1) < 0, -1, 1)
    packed = largest.astype(np.uint32)
    for place in range(4):
        value = turned[:, place]
        size = np.floor(np.minimum(np.abs(value) * math.sqrt(2), 1) * _MAGNITUDE + 0.5)
        field = ((value < 0).astype(np.uint32) << (SMALL_BITS - 1)) | size.astype(np.uint32)
        packed = np.where(largest == place, packed, (packed << SMALL_BITS) | field)
    return packed.astype(np.uint32)


def unpack_smallest_three(packed: UInt32[np.ndarray, " n"]) -> Float[np.ndarray, "n 4"]:
    """The inverse, as unit quaternions (w, x, y, z)."""
    largest, rest = packed >> 30, packed.astype(np.uint32)
    xyzw = np.zeros((len(packed), 4))
    for place in (3, 2, 1, 0):
        size = (rest & _MAGNITUDE) / _MAGNITUDE / math.sqrt(2)
        value = np.where(rest >> (SMALL_BITS - 1) & 1, -size, size)
        xyzw[:, place] = np.where(largest == place, 0, value)
        rest = np.where(largest == place, rest, rest >> SMALL_BITS)
    missing = np.sqrt(np.clip(1 - (xyzw**2).sum(1), 0, None))
    np.put_along_axis(xyzw, largest[:, None].astype(np.int64), missing[:, None], 1)
    return np.roll(xyzw, 1, axis=1)


def unpack_vector_part(packed: UInt8[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 4"]:
    """Version 2: (x, y, z) in steps of 1/127.5, w not negative."""
    xyz = packed / 127.5 - 1
    w = np.sqrt(np.clip(1 - (xyz**2).sum(1), 0, None))
    return np.concatenate([w[:, None], xyz], 1)
