"""One depth map from a file, as numbers; what they mean is decided elsewhere.

OpenEXR: channel ``Z``, ``depth`` or ``distance``, or the only one. PNG: grey, 8 or 16 bits. NumPy:
floats or whole numbers, (h, w) with axes of one around. Sizes are checked before memory is taken.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image

from diff4splat.errors import Diff4SplatError, InputError
from diff4splat.io.exr_header import MAX_PIXELS, exr_sizes
from diff4splat.io.npy_header import START_BYTES, read_npy_header
from diff4splat.io.require_file import opened_file, read_bytes
from diff4splat.io.silence_stderr import silence_native_stderr

WHAT = "a depth map"
Z_CHANNELS = ("Z", "z", "depth", "Depth", "depth.Z", "Depth.Z", "ViewLayer.Depth.Z")
DISTANCE_CHANNELS = ("distance",)
GREY_MODES = ("L", "I", "I;16", "I;16B", "F")
_ORIENTATION = 0x0112


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthFile:
    """Numbers of a file."""

    values: np.ndarray
    """(h, w) float32."""
    quantity: str
    """``metric`` or ``distance`` where the file's format or channel says so; else empty."""
    orientation: int = 1
    """EXIF; 1 is upright."""


def read_depth_file(file: Path) -> DepthFile:
    """The depth map in a file.

    Raises:
        InputError: absent, of another kind, damaged, or too large.
    """
    reader = READERS.get(file.suffix.lower())
    if reader is None:
        raise InputError(
            f"{file}: expected {WHAT} ending in {', '.join(READERS)}, got another ending"
        )
    try:
        found = reader(file)
    except InputError:
        raise
    except Diff4SplatError as error:
        raise InputError(f"{file}: {error}".replace(f"{file}: {file}: ", f"{file}: ")) from error
    if found.values.ndim != 2 or 0 in found.values.shape:
        raise InputError(
            f"{file}: expected {WHAT} with one number per pixel, got the shape "
            f"{list(found.values.shape)}; write height by width numbers"
        )
    return found


def _read_exr(file: Path) -> DepthFile:
    with opened_file(file, WHAT, InputError), silence_native_stderr():
        exr_sizes(file)
        try:
            with OpenEXR.File(str(file), separate_channels=True) as opened:
                channels = opened.parts[0].channels
                name = _channel(file, list(channels))
                values = np.array(channels[name].pixels, dtype=np.float32)
        except InputError:
            raise
        except Exception as error:  # damaged data makes the library raise almost anything
            raise InputError(
                f"{file}: expected a whole OpenEXR file, got a damaged or cut off one; copy it "
                "again"
            ) from error
    quantity = "metric" if name in Z_CHANNELS else ""
    return DepthFile(values=values, quantity="distance" if name in DISTANCE_CHANNELS else quantity)


def _channel(file: Path, names: list[str]) -> str:
    """The channel with the depth."""
    for name in (*Z_CHANNELS, *DISTANCE_CHANNELS):
        if name in names:
            return name
    if len(names) == 1:
        return names[0]
    raise InputError(
        f"{file}: expected a channel Z, depth or distance, got {', '.join(sorted(names)[:8])}; "
        "write the depth into a channel Z"
    )


def _read_png(file: Path) -> DepthFile:
    with opened_file(file, WHAT, InputError) as stream:
        try:
            with Image.open(stream, formats=("PNG",)) as image:
                _require_size(file, image.height, image.width)
                if image.mode not in GREY_MODES:
                    raise InputError(
                        f"{file}: expected a grey PNG, got colours ({image.mode}); a coloured "
                        "picture of depth is no depth, export the numbers"
                    )
                orientation = int(image.getexif().get(_ORIENTATION, 1))
                values = np.asarray(image, dtype=np.float32)
        except InputError:
            raise
        except Exception as error:  # damaged data makes Pillow's decoders raise almost anything
            raise InputError(
                f"{file}: expected a whole PNG, got a damaged or cut off one; copy it again"
            ) from error
    return DepthFile(values=values, quantity="", orientation=orientation)


def _read_npy(file: Path) -> DepthFile:
    with opened_file(file, WHAT, InputError) as stream:
        start = stream.read(START_BYTES)
    header = read_npy_header(start)
    sides = [side for side in header.shape if side != 1]
    if len(sides) != 2 and not (len(header.shape) == 2 and len(sides) < 2):
        raise InputError(
            f"{file}: expected {WHAT} of height by width, got the shape {list(header.shape)}; "
            "write one image's depth"
        )
    height, width = sides if len(sides) == 2 else header.shape
    _require_size(file, height, width)
    content = read_bytes(file, WHAT, InputError, header.data_start + header.data_bytes)
    if len(content) != header.data_start + header.data_bytes:
        raise InputError(
            f"{file}: expected {header.data_bytes:,} bytes of numbers, got "
            f"{len(content) - header.data_start:,}; the file is cut off, copy it again"
        )
    flat = np.frombuffer(content, header.dtype, offset=header.data_start)
    values = flat.reshape(header.shape, order="F" if header.by_columns else "C")
    with np.errstate(over="ignore"):
        return DepthFile(values=values.reshape(height, width).astype(np.float32), quantity="")


def _require_size(file: Path, height: int, width: int) -> None:
    if min(height, width) < 1 or height * width > MAX_PIXELS:
        raise InputError(
            f"{file}: expected {WHAT} of up to {MAX_PIXELS:,} pixels, got {width}×{height}"
        )


READERS: dict[str, Callable[[Path], DepthFile]] = {
    ".exr": _read_exr,
    ".png": _read_png,
    ".npy": _read_npy,
}
