"""Compressed PLY of PlayCanvas and SuperSplat: 16 bytes a Gaussian, ranges per chunk of 256.

Axes: ``n`` Gaussians, ``c`` chunks. Element ``chunk`` holds the ends of the ranges of positions,
logarithms of scales and colours of 256 Gaussians each; element ``vertex`` four packed words;
element ``sh``, if any, harmonics in 8 bits (PlayCanvas engine, ``gsplat-compressed-data``).
"""

from collections.abc import Mapping

import numpy as np
import torch
from jaxtyping import Float, UInt32

from diff4splat.errors import FileFormatError
from diff4splat.io.ply.ply_body import Columns
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import BAND_SIZES, dc_from_color

CHUNK = 256
PACKED = ("packed_position", "packed_rotation", "packed_scale", "packed_color")
_XYZ_BITS = ((21, 11), (11, 10), (0, 11))
_RGBA_BITS = ((24, 8), (16, 8), (8, 8), (0, 8))
_QUAT_BITS = ((20, 10), (10, 10), (0, 10))
_HARMONIC_RANGE = 8.0


def is_compressed(columns: Columns) -> bool:
    """Whether these are the columns of packed Gaussians."""
    return PACKED[0] in columns


def from_compressed(elements: Mapping[str, Columns]) -> Gaussians:
    """float32 Gaussians of the elements of a compressed PLY.

    Raises:
        FileFormatError: a column is missing, of another type, or too short.
    """
    vertex, chunks = elements["vertex"], elements.get("chunk", {})
    words = [_word(vertex, name) for name in PACKED]
    count = len(words[0])
    if not chunks or count > CHUNK * len(next(iter(chunks.values()))):
        raise FileFormatError("expected a chunk for every 256 Gaussians, got fewer; export it anew")
    position, rotation, scale, color = words
    rgba = _fractions(color, _RGBA_BITS)
    rgb = rgba[:, :3]
    if "min_r" in chunks:
        rgb = _within(chunks, ("r", "g", "b"), rgb)
    log_scales = _within(chunks, ("scale_x", "scale_y", "scale_z"), _fractions(scale, _XYZ_BITS))
    dc = dc_from_color(torch.from_numpy(rgb))[:, None]
    rest = torch.from_numpy(_harmonics(elements.get("sh", {}), count))
    means = _within(chunks, ("x", "y", "z"), _fractions(position, _XYZ_BITS))
    return Gaussians(
        means=torch.from_numpy(means).float(),
        quats=torch.from_numpy(_quats(rotation)).float(),
        scales=torch.from_numpy(log_scales).clamp(max=80).exp().float(),
        opacities=torch.from_numpy(rgba[:, 3]).float(),
        sh=torch.cat([dc, rest], 1).float(),
    )


def _word(columns: Columns, name: str) -> UInt32[np.ndarray, " n"]:
    values = columns.get(name)
    if values is None or values.dtype.kind != "u" or values.dtype.itemsize != 4:
        raise FileFormatError(f"expected '{name}' of type uint, got none or another type")
    return values.astype(np.uint32)


def _fractions(
    words: UInt32[np.ndarray, " n"], bits: tuple[tuple[int, int], ...]
) -> Float[np.ndarray, "n k"]:
    """Fields of the words, by shift and width, from 0 to 1."""
    fields = [(words >> shift & ((1 << width) - 1)) / ((1 << width) - 1) for shift, width in bits]
    return np.stack(fields, 1)


def _within(
    chunks: Columns, names: tuple[str, ...], fractions: Float[np.ndarray, "n k"]
) -> Float[np.ndarray, "n k"]:
    """Values between the least and the largest of their chunk."""
    chunk = np.arange(len(fractions)) // CHUNK
    found = np.empty_like(fractions)
    for place, name in enumerate(names):
        low, high = (_bound(chunks, f"{end}_{name}") for end in ("min", "max"))
        found[:, place] = low[chunk] + (high - low)[chunk] * fractions[:, place]
    return found


def _bound(chunks: Columns, name: str) -> Float[np.ndarray, " c"]:
    values = chunks.get(name)
    if values is None or not (np.abs(values.astype(np.float64)) < np.finfo(np.float32).max).all():
        raise FileFormatError(f"chunk: expected finite numbers '{name}', got others or none")
    return values.astype(np.float64)


def _quats(words: UInt32[np.ndarray, " n"]) -> Float[np.ndarray, "n 4"]:
    """(w, x, y, z): the place of the largest component in 2 bits, the three others in 10 each."""
    small = (_fractions(words, _QUAT_BITS) - 0.5) * np.sqrt(2)
    largest = np.sqrt(np.clip(1 - (small**2).sum(1), 0, None))
    place = (words >> 30).astype(np.int64)[:, None]
    others = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])[place[:, 0]]
    quats = np.zeros((len(words), 4))
    np.put_along_axis(quats, others, small, 1)
    np.put_along_axis(quats, place, largest[:, None], 1)
    return quats


def _harmonics(columns: Columns, count: int) -> Float[np.ndarray, "n k 3"]:
    names = [f"f_rest_{i}" for i in range(len(columns))]
    per_channel = len(names) // 3
    wrong = [name for name in names if name not in columns or len(columns[name]) < count]
    if wrong or len(names) % 3 or per_channel + 1 not in BAND_SIZES:
        raise FileFormatError(f"sh: expected 9, 24 or 45 harmonics for each, got {len(names)}")
    if not names:
        return np.zeros((count, 0, 3))
    table = np.stack([columns[name][:count] for name in names], 1).astype(np.float64)
    # 0 and 255 are the ends of the range, the numbers between them the middle of their step.
    middle = np.where((table == 0) | (table == 255), table / 255, (table + 0.5) / 256)
    return ((middle - 0.5) * _HARMONIC_RANGE).reshape(count, 3, per_channel).transpose(0, 2, 1)
