"""Images of all frames in one PNG, stacked from top to bottom: without loss, seen anywhere.

Axes: ``t`` frames, ``h w`` pixels, 3 colours or none (instances).
"""

import io
import math

import numpy as np
from jaxtyping import UInt8
from PIL import Image, PngImagePlugin

from diff4splat.errors import FileFormatError

_MOST_PER_BYTE = 1032
_LEVEL = 3
"""Deflate; a tenth larger than the default level in half the time."""


def encode_png(frames: UInt8[np.ndarray, "t h w *c"]) -> bytes:
    """One image of height t · h."""
    encoded = io.BytesIO()
    stacked = frames.reshape(-1, *frames.shape[2:])
    Image.fromarray(stacked).save(encoded, "PNG", compress_level=_LEVEL)
    return encoded.getvalue()


def decode_png(content: bytes, shape: tuple[int, ...]) -> UInt8[np.ndarray, "t h w *c"]:
    """Frames of ``shape``.

    Raises:
        FileFormatError: damaged, or of another size or kind.
    """
    try:
        # Not Image.open: its limit on pixels is for one image, and the size is checked here.
        image = PngImagePlugin.PngImageFile(io.BytesIO(content))
        got = (image.size[::-1], image.mode)
        want = ((shape[0] * shape[1], shape[2]), "RGB" if len(shape) == 4 else "L")
        # Deflate packs at most 1032 bytes into one: what claims more would only fill the memory.
        if math.prod(shape) > _MOST_PER_BYTE * len(content):
            raise ValueError("more pixels than the file can hold")
        if got == want:
            return np.array(image).reshape(shape)
    except Exception as error:  # damaged data makes Pillow's decoders raise almost anything
        raise FileFormatError("expected a PNG, got a damaged or other file") from error
    raise FileFormatError(
        f"expected a PNG of {shape[0]} frames, (height, width) {want[0]} and mode {want[1]}, "
        f"got {got[0]} and {got[1]}"
    )
