"""Depth of all frames as one OpenEXR file, one part per frame, channel ``Z``; or a NumPy array.

Axes: ``t`` frames, ``h w`` pixels. PXR24 keeps 24 of 32 bits (relative error up to 1.5e-5) and is
several times smaller than ZIP; half precision has an error up to 4.9e-4 and a range. The plain
array of halves is read five times as fast as any OpenEXR file, whose library copies every part.
"""

import io
import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
import OpenEXR
import torch
from jaxtyping import Float32
from torch import Tensor

from diff4splat.errors import FileFormatError, InputError
from diff4splat.io.npy_header import START_BYTES, read_npy_header

DepthCoding = Literal["pxr24", "half", "half_plain", "float"]
"""For truth, for training copies, for those that are read fast, and without loss."""
_MOST_PER_BYTE = 2000
_HALF_RANGE = (6.2e-5, 65504.0)
"""Below, half precision loses digits; above is infinity."""


def encode_exr(depth: Float32[np.ndarray, "t h w"], coding: DepthCoding) -> bytes:
    """An OpenEXR file in memory.

    Raises:
        InputError: half precision cannot hold these depths.
    """
    if coding == "half":
        depth = _halved(depth)
    packing = OpenEXR.PXR24_COMPRESSION if coding == "pxr24" else OpenEXR.ZIP_COMPRESSION
    header = {"compression": packing, "type": OpenEXR.scanlineimage}
    parts = [
        OpenEXR.Part(dict(header), {"Z": frame}, f"frame_{index:04d}")
        for index, frame in enumerate(np.ascontiguousarray(depth))
    ]
    written = io.BytesIO()
    with OpenEXR.File(parts) as opened:
        opened.write(written)
    return written.getvalue()


def encode_npy(depth: Float32[np.ndarray, "t h w"]) -> bytes:
    """A NumPy array of halves.

    Raises:
        InputError: half precision cannot hold these depths.
    """
    written = io.BytesIO()
    halves = np.ascontiguousarray(_halved(depth), "<f2")
    np.lib.format.write_array(written, halves, version=(1, 0), allow_pickle=False)
    return written.getvalue()


def decode_npy(
    content: bytes, shape: tuple[int, int, int], frames: Sequence[int]
) -> Float32[Tensor, "f h w"]:
    """The chosen ``frames`` of depth of ``shape``, in float32; the others are not touched.

    Raises:
        FileFormatError: damaged, or of another length, size or kind.
    """
    header = read_npy_header(content[:START_BYTES])
    values = content[header.data_start :]
    if (header.shape, header.dtype, header.by_columns) != (shape, np.dtype("<f2"), False):
        raise FileFormatError(
            f"expected depth of half precision and shape {shape}, got {header.dtype} of shape "
            f"{header.shape}"
        )
    if len(values) != header.data_bytes:
        raise FileFormatError(f"expected {header.data_bytes} bytes of depth, got {len(values)}")
    halves = torch.frombuffer(bytearray(values), dtype=torch.float16).reshape(shape)
    return (halves if len(frames) == shape[0] else halves[list(frames)]).float()


def _halved(depth: np.ndarray) -> np.ndarray:
    outside = (depth > 0) & ((depth < _HALF_RANGE[0]) | (depth > _HALF_RANGE[1]))
    if outside.any():
        raise InputError(
            f"depth: expected {_HALF_RANGE[0]} to {_HALF_RANGE[1]:.0f} for half precision, "
            f"got {depth[outside][0]:.3g}; store it as pxr24 or in other units"
        )
    return depth.astype(np.float16)


def decode_exr(content: bytes, shape: tuple[int, int, int]) -> Float32[np.ndarray, "t h w"]:
    """Depth of ``shape``, in float32 however it was stored.

    Raises:
        FileFormatError: damaged, or of another length, size or kind.
    """
    try:
        _require_size(content, shape)
        with OpenEXR.File(io.BytesIO(content), separate_channels=True) as opened:
            # A frame that cannot be decoded is left out by the library, or loses its channel.
            found = [part.channels["Z"].pixels for part in opened.parts if "Z" in part.channels]
    except FileFormatError:
        raise
    except Exception as error:  # damaged headers make the library raise almost anything
        raise FileFormatError("expected an OpenEXR file, got a damaged or other one") from error
    kinds = {(frame.shape, frame.dtype.name) for frame in found}
    if len(found) != shape[0] or not kinds <= {(shape[1:], k) for k in ("float16", "float32")}:
        raise FileFormatError(
            f"expected depth of {shape[0]} frames of (height, width) {shape[1:]}, "
            f"got {len(found)} of {sorted(kinds)}"
        )
    return np.stack(found).astype(np.float32, copy=False)


def _require_size(content: bytes, shape: tuple[int, int, int]) -> None:
    """Look at the headers alone: a false size would fill the memory before it is noticed."""
    with OpenEXR.File(io.BytesIO(content), header_only=True) as opened:
        windows = [part.header["dataWindow"] for part in opened.parts]
    # No compression of the format packs more pixels into a byte.
    if math.prod(shape) > _MOST_PER_BYTE * len(content):
        raise ValueError("more pixels than the file can hold")
    sizes = {(int(y1 - y0) + 1, int(x1 - x0) + 1) for (x0, y0), (x1, y1) in windows}
    if len(windows) != shape[0] or sizes != {shape[1:]}:
        raise FileFormatError(
            f"expected depth of {shape[0]} frames of (height, width) {shape[1:]}, "
            f"got {len(windows)} of {sorted(sizes)}"
        )
