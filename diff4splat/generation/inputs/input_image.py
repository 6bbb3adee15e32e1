"""The photograph as the model sees it: size, crop and focal length.

Axes: ``h w 3`` RGB in [0, 1]. The image keeps the photograph's shape: both sides become multiples
of 16 within a pixel budget, by cropping rows or columns or by padding with those of the edge. Focal
lengths follow scale and window, so the geometry stays that of the photograph.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import cv2
import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ConfigError, InputError
from diff4splat.generation.inputs.photo_window import PhotoWindow
from diff4splat.geometry.camera import Camera, focal_from_35mm, focal_from_fov, pinhole
from diff4splat.io.photos.images import read_photo

Fit = Literal["crop", "pad"]
"""How a photograph comes to a shape that networks take: less of it, or more around it."""
SIDE_MULTIPLE = 16
"""Of the sizes that ship: VAE stride 8 times patch 2. A model's own is ``config.token_px``."""
MAX_SIDE_PX = 1024
"""Seventeen frames of more pixels do not fit into 8 GiB."""
SMALLEST_CROP = 0.005
"""Share of a side below which a crop is not worth a note."""
DEFAULT_FOCAL_35MM = 30.0
"""What phones see with their main lens, when nothing is known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FocalChoice:
    """A focal length in pixels of the whole photograph, and where it came from."""

    focal_px: float
    source: str
    known: bool = True
    """False for a guess that better knowledge may replace."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InputImage:
    """The photograph at the model's size, with the camera that took it at the origin."""

    rgb: Float[Tensor, "h w 3"]
    camera: Camera
    focal_source: str
    focal_known: bool = True
    """False for a default lens; a camera path that names one then decides."""
    notes: tuple[str, ...] = ()
    """What was done to the photograph, in words."""
    reduction: int = 1
    """Pixels of the photograph on a side of each pixel here; above 1 in the networks' copy."""
    window: PhotoWindow | None = None
    """The part of the photograph that is left; None is all."""

    def to(self, device: torch.device) -> "InputImage":
        """Move pixels and camera."""
        return replace(self, rgb=self.rgb.to(device), camera=self.camera.to(device))


def downsample(image: InputImage, factor: int) -> InputImage:
    """The image with ``factor``² pixels averaged into one; its sides are multiples of that."""
    if factor == 1:
        return image
    rgb = torch.nn.functional.avg_pool2d(image.rgb.movedim(-1, 0)[None], factor)[0]
    height, width = image.camera.size_px
    camera = image.camera.resized((height // factor, width // factor))
    reduction = image.reduction * factor
    return replace(image, rgb=rgb.movedim(0, -1), camera=camera, reduction=reduction)


def enlarged(image: InputImage, factor: int) -> InputImage:
    """The image with ``factor`` times the sides, interpolated: networks of larger images see it."""
    rgb = torch.nn.functional.interpolate(
        image.rgb.movedim(-1, 0)[None], scale_factor=factor, mode="bicubic", align_corners=False
    )[0]
    height, width = image.camera.size_px
    camera = image.camera.resized((height * factor, width * factor))
    return replace(image, rgb=rgb.clamp(0, 1).movedim(0, -1), camera=camera)


def load_image(
    file: Path,
    side_px: int,
    fov_deg: float | None = None,
    convert: bool = False,
    multiple_px: int = SIDE_MULTIPLE,
    fit: Fit = "crop",
) -> InputImage:
    """A photograph's file at the model's size; ``convert`` accepts grey, alpha, 16 bits and so on.

    Raises:
        InputError: the file cannot be used as a photograph.
        ConfigError: the field of view or the size is out of range.
    """
    photo = read_photo(file, convert)
    size_px = (photo.rgb.shape[0], photo.rgb.shape[1])
    focal = choose_focal(size_px, fov_deg, photo.focal_35mm)
    image = prepare_image(photo.rgb, focal, side_px, multiple_px, fit)
    window = replace(image.window, orientation=photo.orientation)
    return replace(image, window=window, notes=(*photo.notes, *image.notes))


def choose_focal(
    size_px: tuple[int, int], fov_deg: float | None, focal_35mm: float | None
) -> FocalChoice:
    """The focal length of a photograph of (height, width): asked for, from EXIF, or a default.

    ``fov_deg`` is the horizontal field of view of the whole photograph.

    Raises:
        ConfigError: the field of view is not between 1 and 170 degrees.
    """
    if fov_deg is not None:
        if not (math.isfinite(fov_deg) and 1 <= fov_deg <= 170):
            raise ConfigError(f"--fov: expected 1 to 170 degrees, got {fov_deg:g}")
        return FocalChoice(
            focal_px=focal_from_fov(fov_deg, size_px[1]), source=f"--fov {fov_deg:g} degrees"
        )
    if focal_35mm is not None:
        return FocalChoice(
            focal_px=focal_from_35mm(focal_35mm, size_px),
            source=f"EXIF, {focal_35mm:g} mm (35 mm equivalent)",
        )
    return FocalChoice(
        focal_px=focal_from_35mm(DEFAULT_FOCAL_35MM, size_px),
        source=f"default, {DEFAULT_FOCAL_35MM:g} mm (35 mm equivalent); --fov overrides",
        known=False,
    )


def require_side(side_px: int, least_px: int) -> None:
    """Refuse a side before anything is derived from it.

    Raises:
        ConfigError: it is too small for one patch or too large to be meant.
    """
    if not least_px <= side_px <= MAX_SIDE_PX:
        raise ConfigError(
            f"--resolution: expected {least_px} to {MAX_SIDE_PX} pixels, got {side_px}"
        )


def model_size(
    photo_size_px: tuple[int, int], side_px: int, multiple_px: int = SIDE_MULTIPLE
) -> tuple[int, int]:
    """(height, width) near the photograph's shape, with at most ``side_px``² pixels.

    Raises:
        ConfigError: the side is too small for one patch or too large to be meant.
        InputError: the photograph is too long and thin to fit.
    """
    require_side(side_px, multiple_px)
    aspect = photo_size_px[1] / photo_size_px[0]
    rows = range(multiple_px, side_px * side_px // multiple_px + 1, multiple_px)
    columns = [(math.floor(h * aspect / multiple_px), h) for h in rows]
    sizes = [(h, (count + more) * multiple_px) for count, h in columns for more in (0, 1)]
    fitting = [size for size in sizes if 0 < size[0] * size[1] <= side_px**2]
    best = max(fitting, key=lambda size: _size_score(size, aspect), default=None)
    if best is None or not 0.5 < best[1] / best[0] / aspect < 2:
        raise InputError(
            f"image: expected a shape that fits into {side_px}×{side_px} pixels, got "
            f"{photo_size_px[1]}×{photo_size_px[0]}; crop it or raise --resolution"
        )
    return best


def _size_score(size_px: tuple[int, int], aspect: float) -> float:
    """More pixels are better; each per cent that has to be cropped outweighs four of them."""
    height, width = size_px
    return math.log(height * width) - 4 * abs(math.log(width / height / aspect))


def prepare_image(
    rgb: Float[Tensor, "height width 3"],
    focal: FocalChoice,
    side_px: int,
    multiple_px: int = SIDE_MULTIPLE,
    fit: Fit = "crop",
) -> InputImage:
    """Crop or pad evenly around the centre to the model's shape, and resize."""
    photo_size = (rgb.shape[0], rgb.shape[1])
    size = model_size(photo_size, side_px, multiple_px)
    window = _padded_size(photo_size, size) if fit == "pad" else _cropped_size(photo_size, size)
    top, left = ((whole - new) // 2 for whole, new in zip(photo_size, window, strict=True))
    camera = pinhole(focal.focal_px, photo_size).cropped((top, left), window).resized(size)
    return InputImage(
        rgb=_resize(_window(rgb, (top, left), window), size),
        camera=camera,
        focal_source=focal.source,
        focal_known=focal.known,
        notes=_fit_notes(photo_size, window, size),
        window=PhotoWindow(photo_px=photo_size, corner_px=(top, left), size_px=window),
    )


def _cropped_size(photo_px: tuple[int, int], size_px: tuple[int, int]) -> tuple[int, int]:
    """The largest window of the shape of ``size_px`` inside the photograph."""
    scale = min(photo_px[0] / size_px[0], photo_px[1] / size_px[1])
    return tuple(min(photo_px[i], round(size_px[i] * scale)) for i in (0, 1))


def _padded_size(photo_px: tuple[int, int], size_px: tuple[int, int]) -> tuple[int, int]:
    """The smallest window of the shape of ``size_px`` around the photograph."""
    scale = max(photo_px[0] / size_px[0], photo_px[1] / size_px[1])
    return tuple(max(photo_px[i], round(size_px[i] * scale)) for i in (0, 1))


def _window(
    rgb: Float[Tensor, "height width 3"], corner: tuple[int, int], size_px: tuple[int, int]
) -> Float[Tensor, "h w 3"]:
    """Pixels from ``corner`` on; outside of the photograph those of its edge go on."""
    rows, columns = (
        torch.arange(first, first + count).clamp(0, whole - 1)
        for first, count, whole in zip(corner, size_px, rgb.shape, strict=False)
    )
    return rgb[rows[:, None], columns]


def _fit_notes(
    photo_size: tuple[int, int], window: tuple[int, int], size: tuple[int, int]
) -> tuple[str, ...]:
    """What a crop cost or a padding added, in words; nothing where the shape is the same."""
    cut = [1 - kept / whole for kept, whole in zip(window, photo_size, strict=True)]
    axes = [
        f"{abs(share):.0%} of the {name}"
        for share, name in zip(cut, ("height", "width"), strict=True)
        if abs(share) >= SMALLEST_CROP
    ]
    if not axes:
        return ()
    to_size = f"to {size[1]}×{size[0]} pixels"
    if min(cut) < 0:
        return (f"padded by {' and '.join(axes)} {to_size}, with the colours of the edge",)
    return (f"cropped by {' and '.join(axes)} {to_size}; --fit pad keeps everything",)


def _resize(
    rgb: Float[Tensor, "height width 3"], size_px: tuple[int, int]
) -> Float[Tensor, "h w 3"]:
    if rgb.shape[:2] == size_px:
        return rgb.clone()
    # Averaging over the area keeps a downscaled photograph free of aliasing.
    shrinks = rgb.shape[0] >= size_px[0]
    method = cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC
    resized = cv2.resize(rgb.contiguous().numpy(), size_px[::-1], interpolation=method)
    return torch.from_numpy(resized).clamp(0, 1)
