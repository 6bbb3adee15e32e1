"""From any image that Pillow can hold to 8-bit RGB in sRGB, with a note for every change."""

import io
from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageCms

from diff4splat.errors import InputError
from diff4splat.io.silence_stderr import silence_native_stderr

_BACKGROUND = "white"

Noted = tuple[Image.Image, tuple[str, ...]]


def reduce_depth(image: Image.Image, file: Path) -> Noted:
    """8 bits per channel from 16 (65535 becomes 255) or from floating point in [0, 1].

    Raises:
        InputError: the values lie outside the range of their kind, or cannot be decoded.
    """
    top = 1.0 if image.mode == "F" else 65535.0
    values = _decode(file, grey=image.mode[:1] in ("I", "F"))
    if not (values.min() >= 0 and values.max() <= top):
        raise InputError(
            f"{file}: expected values from 0 to {top:g}, got {values.min()} to {values.max()}; "
            "convert it to 8-bit RGB"
        )
    reduced = Image.fromarray((values * (255.0 / top) + 0.5).astype(np.uint8))
    reduced.info = {k: v for k, v in image.info.items() if k == "icc_profile"}
    return reduced, (
        "floating point from 0 to 1 reduced to 8 bits" if top == 1 else "16 bits reduced to 8",
    )


def to_srgb(image: Image.Image) -> Noted:
    """8-bit RGB in sRGB: profile applied, alpha composited over white, grey repeated."""
    color, alpha = _split_alpha(image)
    color, notes = _apply_profile(color, image.info.get("icc_profile"))
    if color.mode != "RGB":
        grey = color.mode == "L"
        notes += ("grey repeated as RGB" if grey else f"converted from {color.mode} to RGB",)
    color = color.convert("RGB")
    if image.mode in ("P", "PA"):
        notes += ("palette expanded",)
    if alpha is None:
        return color, notes
    if alpha.getextrema() == (255, 255):
        return color, (*notes, "alpha channel dropped (opaque everywhere)")
    backdrop = Image.new("RGB", color.size, _BACKGROUND)
    return Image.composite(color, backdrop, alpha), (*notes, f"alpha composited over {_BACKGROUND}")


def _decode(file: Path, grey: bool) -> np.ndarray:
    """All bits of every channel; through OpenCV, since Pillow has no mode for deep colour."""
    try:
        with silence_native_stderr():
            pixels = cv2.imdecode(np.frombuffer(file.read_bytes(), np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        pixels = None
    if pixels is None or pixels.dtype == np.uint8 or (pixels.ndim == 2) != grey:
        raise InputError(
            f"{file}: expected a whole image of 16 bits per channel, got one that cannot be "
            "decoded; convert it to 8-bit RGB"
        )
    return pixels if grey else pixels[..., [2, 1, 0, 3][: pixels.shape[2]]]


def _split_alpha(image: Image.Image) -> tuple[Image.Image, Image.Image | None]:
    """Colours without alpha, in the mode that their profile is made for, and the alpha."""
    if not image.has_transparency_data:
        return image.convert({"P": "RGB", "1": "L"}.get(image.mode, image.mode)), None
    whole = image.convert("RGBA")
    base = "L" if image.mode in ("LA", "La", "L", "1") else "RGB"
    return whole.convert(base), whole.getchannel("A")


def _apply_profile(color: Image.Image, profile: bytes | None) -> Noted:
    if not profile:
        return color, ()
    try:
        source = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        name = ImageCms.getProfileDescription(source).strip()
        if "srgb" in name.lower():
            return color, ()
        target = ImageCms.createProfile("sRGB")
        converted = ImageCms.profileToProfile(color, source, target, outputMode="RGB")
    except (ImageCms.PyCMSError, OSError, ValueError):
        return color, ("ICC profile is damaged or does not fit the image and was ignored",)
    return converted, (f"ICC profile {name[:60]!r} converted to sRGB",)
