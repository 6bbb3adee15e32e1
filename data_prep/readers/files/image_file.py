"""Image files: 8-bit formats such as PNG and JPEG, or floating-point OpenEXR and NumPy files.

EXIF orientation is not applied, since structure from motion does not apply it either. Floating
point values are RGB in [0, 1]; NaN marks an invalid pixel.
"""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float32
from PIL import Image

from diff4splat.data_prep.readers.files.float_files import (
    FLOAT_SUFFIXES,
    exr_channels,
    exr_size,
    npy_array,
)
from diff4splat.errors import FileFormatError
from diff4splat.io.photos import photo_validation
from diff4splat.io.require_file import opened_file


@dataclass(frozen=True, slots=True, kw_only=True)
class Pixels:
    """Decoded pixels of an image."""

    rgb: Float32[np.ndarray, "h w 3"]
    """NaN where the file has NaN."""
    alpha: Float32[np.ndarray, "h w"] | None = None
    """Opacity in [0, 1]; None is opaque."""
    from_levels: bool = False
    """Out of whole numbers: all of it is finite and in [0, 1], so nobody needs to look."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageFile:
    """An image, decoded on demand."""

    file: Path

    @property
    def where(self) -> str:
        """Name for error messages."""
        return str(self.file)

    @property
    def is_float(self) -> bool:
        """Whether values are floating point, possibly NaN."""
        return self.file.suffix.lower() in FLOAT_SUFFIXES

    def size_px(self) -> tuple[int, int]:
        """(height, width), from the header alone.

        Raises:
            FileFormatError: missing, or not an image.
        """
        if self.file.suffix.lower() == ".exr":
            return exr_size(self.file)
        if self.is_float:
            height, width, *_ = _shaped(self.file).shape
            return height, width
        with opened_image(self.file) as image:
            return image.height, image.width

    def has_alpha(self) -> bool:
        """Whether the file may hold transparency."""
        if self.file.suffix.lower() == ".exr":
            return "A" in exr_channels(self.file)
        if self.is_float:
            return _shaped(self.file).shape[2] == 4
        with opened_image(self.file) as image:
            return image.has_transparency_data

    def read(self) -> Pixels:
        """Decode the image.

        Raises:
            FileFormatError: missing, damaged, or with channels that are no colours.
        """
        if self.is_float:
            exr = self.file.suffix.lower() == ".exr"
            values = _exr_colors(self.file) if exr else np.asarray(_shaped(self.file))
            whole = 1.0 if values.dtype.kind == "f" else float(np.iinfo(values.dtype).max)
        else:
            values, whole = image_levels(self.file), 255.0
        from_levels = values.dtype.kind != "f"
        values = values.astype(np.float32) / np.float32(whole)
        return Pixels(
            from_levels=from_levels,
            rgb=np.ascontiguousarray(values[..., :3]),
            alpha=np.ascontiguousarray(values[..., 3]) if values.shape[2] == 4 else None,
        )


@contextmanager
def opened_image(file: Path) -> Iterator[Image.Image]:
    """The image, its pixels not decoded yet.

    Raises:
        FileFormatError: missing, damaged or enormous, here or while it is decoded.
    """
    try:
        # Pillow warns about sizes and odd metadata; neither is a reason to stop.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with (
                opened_file(file, "an image") as stream,
                Image.open(stream, formats=photo_validation.FORMATS) as image,
            ):
                if image.width * image.height > photo_validation.MAX_PIXELS:
                    raise FileFormatError(
                        f"{file}: expected at most {photo_validation.MAX_PIXELS:,} pixels, got "
                        f"{image.width} x {image.height}; make it smaller first"
                    )
                yield image
    except FileFormatError:
        raise
    except Exception as error:  # damaged files make Pillow's readers raise almost anything
        raise FileFormatError(
            f"{file}: expected a whole image, got a cut off, damaged or other file; copy it again"
        ) from error


def image_levels(file: Path) -> np.ndarray:
    """Levels of 8 bits, ``h w 3`` or ``h w 4``.

    Raises:
        FileFormatError: missing, damaged, or of more bits.
    """
    with opened_image(file) as image:
        if photo_validation.is_deep(image):
            raise FileFormatError(
                f"{file}: expected 8 bits per channel, got more; convert it to 8 bits, or to "
                "OpenEXR or NumPy with values from 0 to 1"
            )
        return np.asarray(image.convert("RGBA" if image.has_transparency_data else "RGB"))


def _exr_colors(file: Path) -> np.ndarray:
    channels = exr_channels(file)
    names = [name for name in ("R", "G", "B", "A") if name in channels]
    if names[:3] != ["R", "G", "B"]:
        raise FileFormatError(f"{file}: expected channels R, G and B, got {sorted(channels)}")
    return np.stack([channels[name].astype(np.float32) for name in names], -1)


def _shaped(file: Path) -> np.ndarray:
    array = npy_array(file)
    fits = array.ndim == 3 and array.shape[2] in (3, 4) and 0 not in array.shape
    if not fits or not (array.dtype.kind == "f" or array.dtype in (np.uint8, np.uint16)):
        raise FileFormatError(
            f"{file}: expected height x width x 3 (or 4) floats, or whole numbers of 8 or 16 bits, "
            f"got {array.dtype} of shape {array.shape}"
        )
    return array
