"""Checks of a photograph from its header, before decoding: format, size, bits and colours."""

from pathlib import Path

from PIL import Image

from diff4splat.errors import InputError

WANTED = "a JPEG, PNG, WebP, AVIF, TIFF or BMP image"
FORMATS = ("JPEG", "PNG", "WEBP", "AVIF", "TIFF", "BMP", "GIF")
"""What Pillow may try; its other readers are for old formats, and one starts Ghostscript."""
MAX_PIXELS = 100_000_000
MIN_SIDE_PX = 16

_REDUCED_COPY = 254
"""TIFF tag NewSubfileType; bit 0 marks the preview inside a camera's raw file."""
_MAGIC = (b"\xff\xd8", b"\x89PNG", b"RIFF", b"II*\0", b"MM\0*", b"BM", b"GIF8")
_ODD_MODES = {
    "CMYK": "CMYK print colours",
    "YCbCr": "YCbCr colours",
    "LAB": "CIE Lab colours",
}


def require_size(image: Image.Image, file: Path) -> None:
    """Refuse what is too large to decode, too small to use, or only a raw file's preview.

    Raises:
        InputError: one of these.
    """
    width, height = image.size
    if width * height > MAX_PIXELS:
        raise too_large(file, f"{width}x{height}")
    if min(width, height) < MIN_SIDE_PX:
        raise InputError(
            f"{file}: expected at least {MIN_SIDE_PX}x{MIN_SIDE_PX} pixels, got {width}x{height}; "
            "use a larger image"
        )
    kind = image.tag_v2.get(_REDUCED_COPY, 0) if image.format == "TIFF" else 0
    if isinstance(kind, int) and kind & 1:
        raise InputError(
            f"{file}: expected {WANTED}, got a camera raw file; develop it and save it as JPEG"
        )


def require_plain(image: Image.Image, file: Path) -> None:
    """Refuse everything but 8-bit RGB.

    Raises:
        InputError: the image is of a kind that only ``convert`` accepts.
    """
    found = _unusual(image)
    if found:
        raise InputError(
            f"{file}: expected an 8-bit RGB photograph, got {found}; "
            "convert it to 8-bit RGB, or pass --convert"
        )


def too_large(file: Path, got: str) -> InputError:
    """The refusal of an enormous image."""
    limit = MAX_PIXELS // 1_000_000
    return InputError(
        f"{file}: expected at most {limit} megapixels, got {got}; make it smaller first"
    )


def is_deep(image: Image.Image) -> bool:
    """More than 8 bits per channel; Pillow itself would drop the lower ones without a word."""
    in_mode = image.mode.startswith("I;16") or image.mode in ("I", "F")
    return in_mode or any(";16" in str(tile.args) for tile in image.tile)


def first_of_many(image: Image.Image) -> tuple[str, ...]:
    """A note when the file holds more than the image that is used."""
    count = _frame_count(image)
    return (f"the first of {count} images in the file was used",) if count > 1 else ()


def describe_unknown(file: Path) -> str:
    """Say what a file is that no reader recognises."""
    with file.open("rb") as stream:
        start = stream.read(16)
    if start[4:8] == b"ftyp" and start[8:12] in (b"heic", b"heix", b"hevc", b"mif1", b"msf1"):
        return f"expected {WANTED}, got HEIC; save or export it as JPEG, or run heif-convert"
    if start.startswith(_MAGIC):
        return "expected a whole image, got a cut off or damaged one; copy it again"
    return f"expected {WANTED}, got another kind of file; convert it to one of these"


def _unusual(image: Image.Image) -> str | None:
    """What makes an image more or less than 8-bit RGB."""
    frames = _frame_count(image)
    found = {
        # Phones store a second view or a depth map behind an ordinary JPEG and call the file MPO.
        f"an animation or a stack of {frames} images": frames > 1 and image.format != "MPO",
        "16-bit or deeper channels": is_deep(image),
        "a palette image": image.mode in ("P", "PA"),
        "an image with an alpha channel or transparency": image.mode != "P"
        and image.has_transparency_data,
        "a grey image": image.mode in ("1", "L"),
        _ODD_MODES.get(image.mode, f"colours of kind {image.mode}"): image.mode != "RGB",
    }
    return next((what for what, holds in found.items() if holds), None)


def _frame_count(image: Image.Image) -> int:
    """Images in the file; a damaged directory of further ones counts as none."""
    try:
        return getattr(image, "n_frames", 1)
    except Exception:  # damaged data makes Pillow's readers raise almost anything
        return 1
