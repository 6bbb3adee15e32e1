"""Open a photograph and check its header; imports neither torch nor NumPy."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from PIL import Image, UnidentifiedImageError

from diff4splat.errors import InputError
from diff4splat.io.photos import photo_validation
from diff4splat.io.require_file import opened_file


@contextmanager
def open_photo(file: Path, convert: bool = False) -> Iterator[Image.Image]:
    """The image, not yet decoded; ``convert`` accepts more than 8-bit RGB.

    Raises:
        InputError: it cannot be read, is too small or enormous, or is not 8-bit RGB.
    """
    with (
        opened_file(file, photo_validation.WANTED, InputError) as stream,
        warnings.catch_warnings(),
    ):
        # Pillow warns about sizes and EXIF; we check both ourselves.
        warnings.simplefilter("ignore")
        with _open(file, stream) as image:
            photo_validation.require_size(image, file)
            if not convert:
                photo_validation.require_plain(image, file)
            yield image


def damaged(file: Path) -> InputError:
    """The refusal of an image that cannot be decoded."""
    return InputError(
        f"{file}: expected a whole image, got a cut off or damaged one; copy it again"
    )


def _open(file: Path, stream: BinaryIO) -> Image.Image:
    try:
        return Image.open(stream, formats=photo_validation.FORMATS)
    except Image.DecompressionBombError as error:
        raise photo_validation.too_large(file, "far more") from error
    except UnidentifiedImageError as error:
        raise InputError(f"{file}: {photo_validation.describe_unknown(file)}") from error
    except Exception as error:  # damaged headers make Pillow's readers raise almost anything
        raise damaged(file) from error
