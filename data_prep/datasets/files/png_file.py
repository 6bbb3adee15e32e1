"""PNG with the numbers as stored: depth and flow of 16 bits, in files of a size that fits.

OpenCV fills a cut off PNG with whatever it has; so the chunks and their checksums are looked at
first, and the size that the header claims.
"""

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np

from diff4splat.errors import FileFormatError
from diff4splat.io.photos.photo_validation import MAX_PIXELS
from diff4splat.io.require_file import read_bytes
from diff4splat.io.silence_stderr import silence_native_stderr

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
_MOST_PER_BYTE = 1032
"""Deflate packs no more bytes into one."""


def png_levels(file: Path, bits: int, channels: int) -> np.ndarray:
    """The numbers, ``h w`` or ``h w c`` in the order R, G, B.

    Raises:
        FileFormatError: missing, cut off, damaged, or of another depth or number of channels.
    """
    content = read_bytes(file, "a PNG")
    try:
        found_bits, found_channels = _checked(content)
    except (ValueError, struct.error) as error:
        raise FileFormatError(
            f"{file}: expected a whole PNG, got a cut off, damaged or other file ({error}); copy "
            "it again"
        ) from None
    if (found_bits, found_channels) != (bits, channels):
        raise FileFormatError(
            f"{file}: expected a PNG of {bits} bits and {channels} channel(s), got "
            f"{found_bits} bits and {found_channels}; it is of another format or was converted"
        )
    with silence_native_stderr():
        levels = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    if levels is None:
        raise FileFormatError(f"{file}: expected a PNG that can be decoded, got another file")
    return np.ascontiguousarray(levels[..., ::-1]) if levels.ndim == 3 else levels


def _checked(content: bytes) -> tuple[int, int]:
    """(bits, channels) once all chunks are whole."""
    if not content.startswith(_SIGNATURE):
        raise ValueError("no PNG")
    width, height, bits, color = struct.unpack(">IIBB", content[16:26])
    if color not in _CHANNELS or not 0 < width * height <= MAX_PIXELS:
        raise ValueError(f"{width} x {height} pixels")
    at, last = len(_SIGNATURE), b""
    while at < len(content) and last != b"IEND":
        (length,), last = struct.unpack(">I", content[at : at + 4]), content[at + 4 : at + 8]
        (checksum,) = struct.unpack(">I", content[at + 8 + length : at + 12 + length])
        if zlib.crc32(content[at + 4 : at + 8 + length]) != checksum:
            raise ValueError("a wrong checksum")
        at += 12 + length
    if last != b"IEND":
        raise ValueError("no end")
    if width * height * _CHANNELS[color] * max(bits // 8, 1) > _MOST_PER_BYTE * len(content):
        raise ValueError("more pixels than the file can hold")
    return bits, _CHANNELS[color]
