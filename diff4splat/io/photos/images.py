"""Photographs in, PNG out. RGB in [0, 1], sRGB-referred, upright; axes ``h w 3``.

Strict by default: anything but an 8-bit RGB photograph is refused in one line, because a silent
conversion (alpha, palette, 16 bits) changes the image in ways that show only in the result.
"""

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from PIL import Image, ImageOps
from torch import Tensor

from diff4splat.errors import InputError
from diff4splat.io.atomic import atomic_path
from diff4splat.io.photos import photo_validation
from diff4splat.io.photos.photo_convert import reduce_depth, to_srgb
from diff4splat.io.photos.photo_header import damaged, open_photo
from diff4splat.io.pixels import from_bytes, to_bytes

_EXIF_IFD = 0x8769
_FOCAL_LENGTH_IN_35MM_FILM = 0xA405
_ORIENTATION = 0x0112
_SHORTEST_MM, _LONGEST_MM = 5.0, 3000.0
"""Equivalent focal lengths outside are writing errors."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Photo:
    """A photograph, ready for use."""

    rgb: Float[Tensor, "h w 3"]
    focal_35mm: float | None
    """35 mm equivalent focal length from EXIF, in millimetres; None when the file does not say."""
    orientation: int = 1
    """EXIF orientation of the file; ``rgb`` is upright."""
    notes: tuple[str, ...] = ()
    """What was done to the image, in words."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Exif:
    focal_35mm: float | None = None
    orientation: int = 1
    """1 is upright; 2 to 8 are turns and mirrorings."""
    notes: tuple[str, ...] = ()


def read_photo(file: Path | str, convert: bool = False) -> Photo:
    """Read a photograph upright and in sRGB; ``convert`` accepts alpha, grey, 16 bits and so on.

    Raises:
        InputError: it cannot be read, is too small or enormous, or is not 8-bit RGB.
    """
    file = Path(file)
    with open_photo(file, convert) as image:
        return _decode(image, file)


def photo_size(file: Path) -> tuple[int, int] | None:
    """(height, width) that the head of a file states; None where ``read_photo`` would refuse it."""
    try:
        with open_photo(file, convert=True) as image:
            return image.height, image.width
    except InputError:
        return None


def write_png(rgb: Float[Tensor, "h w 3"], file: Path | str) -> None:
    """Write an 8-bit PNG whole or not at all; equal images give equal bytes.

    Raises:
        OutputError: the folder cannot be made or written.
    """
    encoded = io.BytesIO()
    Image.fromarray(to_bytes(rgb)).save(encoded, "PNG")
    # Encoding in memory first keeps the system's own error when the disk is full.
    with atomic_path(Path(file)) as temporary:
        temporary.write_bytes(encoded.getvalue())


def _decode(image: Image.Image, file: Path) -> Photo:
    deep = photo_validation.is_deep(image)
    notes = photo_validation.first_of_many(image)
    # A TIFF forgets its orientation while loading; a PNG loads while its EXIF is searched, where
    # damaged pixels would pass for damaged EXIF.
    if image.format != "TIFF":
        _load(image, file)
    exif = _read_exif(image)
    _load(image, file)
    if deep:
        image, reduced = reduce_depth(image, file)
        image.getexif()[_ORIENTATION] = exif.orientation
        notes += reduced
    image, converted = to_srgb(_upright(image))
    rgb = from_bytes(np.asarray(image))
    return Photo(
        rgb=rgb,
        focal_35mm=exif.focal_35mm,
        orientation=exif.orientation,
        notes=(*notes, *exif.notes, *converted),
    )


def _load(image: Image.Image, file: Path) -> None:
    try:
        image.load()
    except Exception as error:  # damaged data makes Pillow's decoders raise almost anything
        raise damaged(file) from error


def _read_exif(image: Image.Image) -> _Exif:
    """What EXIF says; it is often damaged, and the image is good without it."""
    try:
        exif = image.getexif()
        orientation = exif.get(_ORIENTATION)
        focal_35mm = _usable_focal(exif.get_ifd(_EXIF_IFD).get(_FOCAL_LENGTH_IN_35MM_FILM))
    except Exception:
        return _Exif(notes=("EXIF data is damaged and was ignored",))
    if orientation not in range(2, 9):
        return _Exif(focal_35mm=focal_35mm)
    notes = ("EXIF orientation applied",)
    return _Exif(focal_35mm=focal_35mm, orientation=orientation, notes=notes)


def _usable_focal(value: object) -> float | None:
    """Millimetres within what lenses are built for; 0 means unknown in EXIF."""
    try:
        number = float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if _SHORTEST_MM <= number <= _LONGEST_MM else None


def _upright(image: Image.Image) -> Image.Image:
    try:
        return ImageOps.exif_transpose(image)
    except Exception:  # damaged EXIF, see above
        return image
