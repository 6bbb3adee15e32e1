"""Sizes of OpenEXR images from their headers, before memory is taken for their pixels."""

from pathlib import Path

import OpenEXR

from diff4splat.errors import FileFormatError

MAX_PIXELS = 100_000_000
_MOST_PER_BYTE = 2000
"""Pixels; no compression of the format reaches that."""


def exr_sizes(file: Path) -> list[tuple[int, int]]:
    """(height, width) of every part.

    Raises:
        FileFormatError: no OpenEXR file, or its pixels cannot all be in a file of this size;
            without the file's name.
    """
    try:
        with OpenEXR.File(str(file), header_only=True) as opened:
            windows = [part.header["dataWindow"] for part in opened.parts]
        sizes = [(int(y1) - int(y0) + 1, int(x1) - int(x0) + 1) for (x0, y0), (x1, y1) in windows]
    except Exception as error:  # damaged headers make the library raise almost anything
        raise FileFormatError(
            "expected a whole OpenEXR file, got a damaged or other one"
        ) from error
    pixels = sum(height * width for height, width in sizes)
    if not sizes or min(map(min, sizes)) < 1 or pixels > _MOST_PER_BYTE * file.stat().st_size:
        raise FileFormatError("expected a whole OpenEXR file, got a damaged or cut off one")
    if max(height * width for height, width in sizes) > MAX_PIXELS:
        raise FileFormatError(f"expected images of up to {MAX_PIXELS:,} pixels, got larger ones")
    return sizes
