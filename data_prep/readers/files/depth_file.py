"""Depth and mask files of an image; axes ``h w``, depth is z with 0 for no depth."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Bool, Float32
from PIL import Image

from diff4splat.data_prep.readers.files.float_files import exr_channels, npy_array
from diff4splat.errors import FileFormatError
from diff4splat.io.photos import photo_validation
from diff4splat.io.require_file import opened_file

MILLIMETRE = 1e-3
"""Default unit of integer depth, in metres."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthFile:
    """16-bit PNG, OpenEXR (channel Z, Y or R) or NumPy."""

    file: Path
    unit: float | None = None
    """Scene units per level; None is a millimetre for whole numbers and 1 for others."""

    def read(self, size_px: tuple[int, int]) -> Float32[np.ndarray, "h w"]:
        """Depth for an image of ``size_px``; a smaller map is repeated, not interpolated.

        Raises:
            FileFormatError: missing, damaged, not of one channel, or of another shape.
        """
        levels = self._levels()
        unit = self.unit if self.unit is not None else (1.0, MILLIMETRE)[levels.dtype.kind in "iu"]
        depth = levels.astype(np.float32) * np.float32(unit)
        depth = np.where(np.isfinite(depth) & (depth > 0), depth, np.float32(0))
        (height, width), (rows, columns) = size_px, depth.shape
        if abs(rows * width / columns - height) > max(2.0, width / columns):
            raise FileFormatError(
                f"{self.file}: expected depth shaped as its image, {width} x {height}, got "
                f"{columns} x {rows}; give the depth of that image"
            )
        return cv2.resize(depth, (width, height), interpolation=cv2.INTER_NEAREST_EXACT)

    def _levels(self) -> np.ndarray:
        suffix = self.file.suffix.lower()
        if suffix == ".exr":
            channels = exr_channels(self.file)
            named = [channels[name] for name in ("Z", "Y", "R") if name in channels]
            levels = named[0] if named else np.zeros((0, 0))
        else:
            levels = npy_array(self.file) if suffix == ".npy" else grey_levels(self.file)
        levels = levels[..., 0] if levels.ndim == 3 and levels.shape[2] == 1 else levels
        if levels.ndim != 2 or 0 in levels.shape:
            raise FileFormatError(
                f"{self.file}: expected depth of one channel, got {levels.shape}; give z alone"
            )
        return np.asarray(levels)


def read_mask(file: Path, size_px: tuple[int, int]) -> Bool[np.ndarray, "h w"]:
    """True for valid pixels, which are not black in the mask.

    Raises:
        FileFormatError: missing, damaged, of another size, or black everywhere.
    """
    levels = grey_levels(file)
    counts = (levels.max(-1) if levels.ndim == 3 else levels) > 0
    if counts.shape != size_px:
        raise FileFormatError(
            f"{file}: expected a mask as large as its image, {size_px[1]} x {size_px[0]}, got "
            f"{counts.shape[1]} x {counts.shape[0]}; make it again"
        )
    if not counts.any():
        raise FileFormatError(
            f"{file}: expected a mask that leaves something, got black everywhere; black covers, "
            "so invert the mask or leave out the frame"
        )
    return counts


def grey_levels(file: Path) -> np.ndarray:
    """An image's numbers as stored, ``h w`` or ``h w c``.

    Raises:
        FileFormatError: missing or damaged.
    """
    try:
        with (
            opened_file(file, "an image") as stream,
            Image.open(stream, formats=("PNG", "TIFF", "JPEG", "BMP")) as image,
        ):
            if image.width * image.height > photo_validation.MAX_PIXELS:
                raise ValueError("more pixels than any depth map")
            return np.asarray(image)
    except FileFormatError:
        raise
    except Exception as error:  # damaged files make Pillow's readers raise almost anything
        raise FileFormatError(
            f"{file}: expected a whole image, got a cut off, damaged or other file; copy it again"
        ) from error
