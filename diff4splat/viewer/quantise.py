"""Numbers of a scene in few bytes, as the viewer's page decodes them.

Axes: ``n`` values. Bytes are written plane by plane, all first bytes before all second ones, which
compresses better. All integers are little-endian.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt

LOG_SCALE_STEPS = 1024
"""Steps per unit of a log-scale: 0.05 % of a size."""
LARGEST_16 = 32767
COMPONENT_BITS = 10
"""Of each of the three smallest components of a quaternion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Range16:
    """Values as 16-bit integers: value = integer · ``step``."""

    values: Int[np.ndarray, "*n"]
    step: float


def byte_planes(values: np.ndarray) -> bytes:
    """The bytes of ``values``, plane by plane."""
    flat = np.ascontiguousarray(values).reshape(-1)
    raw = flat.astype(flat.dtype.newbyteorder("<")).view(np.uint8)
    return raw.reshape(len(flat), flat.dtype.itemsize).T.tobytes()


def float24(values: Float[np.ndarray, "*n"]) -> bytes:
    """Planes of 32-bit floats without their last byte: a relative error of at most 2⁻¹⁶."""
    bits = np.ascontiguousarray(values, dtype="<f4").reshape(-1).view("<u4").astype(np.uint64)
    rounded = np.minimum(bits + 0x80, 0xFFFFFFFF).astype(np.uint64)
    # Rounding must not carry the largest finite number to infinity.
    overflow = (rounded & 0x7F800000) == 0x7F800000
    kept = np.where(overflow, bits, rounded).astype("<u4")
    return kept.view(np.uint8).reshape(-1, 4)[:, 1:].T.tobytes()


def log_scales(scales: Float[np.ndarray, "*n"]) -> Int[np.ndarray, "*n"]:
    """Logarithms of sizes as 16-bit integers."""
    logs = np.log(np.maximum(scales.astype(np.float64), 1e-30))
    return _int16(np.rint(logs * LOG_SCALE_STEPS))


def range16(values: Float[np.ndarray, "*n"]) -> Range16:
    """16-bit integers whose range is that of the values; the error is half a step."""
    largest = float(np.abs(values).max(initial=0.0))
    step = largest / LARGEST_16 or 1.0
    return Range16(values=_int16(np.rint(values.astype(np.float64) / step)), step=step)


def smallest_three(quats: Float[np.ndarray, "*n 4"]) -> UInt[np.ndarray, "*n"]:
    """Quaternions (w, x, y, z) in 32 bits: which component is largest, and the other three.

    The sign is chosen so that the largest one is positive. A zero quaternion is the identity.
    """
    length = np.linalg.norm(quats.astype(np.float64), axis=-1, keepdims=True)
    unit = np.where(length > 0, quats / np.where(length > 0, length, 1), [1.0, 0, 0, 0])
    largest = np.abs(unit).argmax(-1)
    sign = np.sign(np.take_along_axis(unit, largest[..., None], -1))
    others = np.stack([_other(unit * sign, largest, place) for place in range(3)], -1)
    highest = 2**COMPONENT_BITS - 1
    steps = np.clip(np.rint((others * np.sqrt(2) + 1) / 2 * highest), 0, highest).astype(np.uint32)
    packed = largest.astype(np.uint32) << (3 * COMPONENT_BITS)
    for place in range(3):
        packed |= steps[..., place] << (COMPONENT_BITS * place)
    return packed


def components(packed: UInt[np.ndarray, "*n"]) -> UInt[np.ndarray, "*n 3"]:
    """The three stored components of packed quaternions."""
    highest = np.uint32(2**COMPONENT_BITS - 1)
    places = [(packed >> np.uint32(COMPONENT_BITS * place)) & highest for place in range(3)]
    return np.stack(places, -1).astype(np.uint16)


def _other(quats: np.ndarray, largest: np.ndarray, place: int) -> np.ndarray:
    """The component at ``place`` among those that are not the largest."""
    index = place + (place >= largest)
    return np.take_along_axis(quats, index[..., None], -1)[..., 0]


def _int16(values: np.ndarray) -> Int[np.ndarray, "*n"]:
    return np.clip(values, -LARGEST_16, LARGEST_16).astype(np.int16)
