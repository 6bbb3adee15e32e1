"""Images of all frames in one PNG or JPEG, stacked from top to bottom: seen anywhere.

Axes: ``t`` frames, ``h w`` pixels, 3 colours or none (instances).
"""

import io
import math

import cv2
import numpy as np
from jaxtyping import UInt8
from PIL import Image, JpegImagePlugin, PngImagePlugin

from diff4splat.errors import FileFormatError, InputError

_MOST_PER_BYTE = 1032
_TALLEST_JPEG, _JPEG_QUALITY = 65_500, 95
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


def encode_jpeg(frames: UInt8[np.ndarray, "t h w 3"]) -> bytes:
    """One image of height t · h: with loss, and decoded four times as fast as PNG.

    Raises:
        InputError: the format cannot hold an image of that height.
    """
    stacked = frames.reshape(-1, *frames.shape[2:])
    if len(stacked) > _TALLEST_JPEG:
        raise InputError(
            f"images: expected at most {_TALLEST_JPEG} rows in all frames for JPEG, got "
            f"{len(stacked)}; store them as MP4 or PNG"
        )
    encoded = io.BytesIO()
    Image.fromarray(stacked).save(encoded, "JPEG", quality=_JPEG_QUALITY, subsampling=0)
    return encoded.getvalue()


def decode_jpeg(content: bytes, shape: tuple[int, ...]) -> UInt8[np.ndarray, "t h w 3"]:
    """Frames of ``shape``.

    Raises:
        FileFormatError: damaged, or of another size or kind.
    """
    try:
        image = JpegImagePlugin.JpegImageFile(io.BytesIO(content))
        got = (image.size[::-1], image.mode)
        if got == ((shape[0] * shape[1], shape[2]), "RGB"):
            # Half the time of Pillow, which copies the pixels twice.
            bgr = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
            return cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB).reshape(shape)
    except Exception as error:  # as above
        raise FileFormatError("expected a JPEG, got a damaged or other file") from error
    raise FileFormatError(
        f"expected a JPEG of {shape[0]} frames of (height, width) {shape[1:3]}, got {got}"
    )
