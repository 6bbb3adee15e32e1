"""Colour images of 8 bits per channel, from files or from bytes."""

import io
from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from diff4splat.data_prep.readers.files.image_file import image_levels
from diff4splat.errors import FileFormatError
from diff4splat.io.photos import photo_validation


def read_rgb(file: Path) -> UInt8[np.ndarray, "h w 3"]:
    """The image in a file; transparency is dropped.

    Raises:
        FileFormatError: missing, cut off, damaged, or of more than 8 bits.
    """
    return np.ascontiguousarray(image_levels(file)[..., :3])


def decode_rgb(content: bytes, where: str) -> UInt8[np.ndarray, "h w 3"]:
    """The image in some bytes; ``where`` names them in errors.

    Raises:
        FileFormatError: cut off, damaged, or enormous.
    """
    try:
        with Image.open(io.BytesIO(content), formats=("PNG", "JPEG")) as image:
            if image.width * image.height > photo_validation.MAX_PIXELS:
                raise ValueError("more pixels than any image")
            return np.asarray(image.convert("RGB"))
    except Exception as error:  # damaged data makes Pillow's decoders raise almost anything
        raise FileFormatError(
            f"{where}: expected a whole image, got a cut off, damaged or other one; copy it again"
        ) from error


def require_size(where: Path | str, got: tuple[int, ...], want: tuple[int, int]) -> None:
    """Require that a map has the size of its image.

    Raises:
        FileFormatError: it has another; names the file.
    """
    if tuple(got[:2]) != want:
        raise FileFormatError(
            f"{where}: expected (height, width) {want} like the first image, got {tuple(got[:2])}; "
            "the files are of different versions or were resized"
        )
