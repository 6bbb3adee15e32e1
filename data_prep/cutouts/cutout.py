"""Cutouts: images of one object with transparency, and the noun of each.

Axes: ``h w`` pixels.
"""

import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float32

from diff4splat.captions.colors import linear_from_srgb, main_color_name
from diff4splat.captions.cutout_nouns import ALL_NOUNS
from diff4splat.errors import FileFormatError, InputError

PUBLIC_NAMES = {
    "fluent-emoji": Path(__file__).parent / "fluent_emoji.json",
    "openclipart": Path(__file__).parent / "openclipart.json",
}
"""Nouns of npm package ``@lobehub/fluent-emoji-3d`` (MIT) and of Debian package
``openclipart-png`` (public domain)."""
OPAQUE = 0.5
MOST_SIDE_PX = 256
"""Larger images are reduced: an object is shown with fewer pixels."""
_SUFFIXES = (".png", ".webp")
_COLOR_SIDE_PX = 32
_LEAST_OPACITY = 1e-6
_KEPT = 1500
"""Cutouts in memory, of at most a megabyte: some files take half a second to decode."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cutout:
    """One object, as large as its image."""

    noun: str
    rgba: Float32[np.ndarray, "h w 4"]
    """sRGB in [0, 1], not multiplied by the opacity."""


def read_names(file: Path) -> dict[str, str]:
    """Paths within the folder of cutouts, without their suffix → nouns, from JSON.

    Raises:
        FileFormatError: the file is no such table, or has a noun that captions do not know.
    """
    try:
        table = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise FileFormatError(f"{file}: expected JSON, got {error}") from error
    if not isinstance(table, dict) or not all(isinstance(noun, str) for noun in table.values()):
        raise FileFormatError(f'{file}: expected {{"file name": "noun", ...}}, got something else')
    unknown = sorted(set(table.values()) - set(ALL_NOUNS))
    if unknown:
        raise FileFormatError(
            f"{file}: expected nouns that captions know, got {', '.join(unknown[:5])}; "
            "use others, or add them to captions/cutout_nouns.py"
        )
    return table


def find_cutouts(folder: Path, names: dict[str, str]) -> dict[str, list[Path]]:
    """Nouns, in order, and the images that a folder has of each, in order of their paths.

    Raises:
        InputError: none of the names is there.
    """
    files = find_images(folder)
    keys = {file: file.relative_to(folder).with_suffix("").as_posix() for file in files}
    found: dict[str, list[Path]] = {}
    for file, key in keys.items():
        if key in names:
            found.setdefault(names[key], []).append(file)
    if not found:
        raise InputError(
            f"{folder}: expected PNG or WebP images with names of the table, got none of "
            f"{len(names)}; check the folder and --names"
        )
    return dict(sorted(found.items()))


def find_images(folder: Path) -> list[Path]:
    """PNG and WebP images in a folder and those within it, in order of their paths."""
    return sorted(file for file in folder.rglob("*") if file.suffix.lower() in _SUFFIXES)


@lru_cache(maxsize=_KEPT)
def read_cutout(file: Path, noun: str) -> Cutout:
    """The object with its noun, kept in memory; see ``read_rgba``."""
    return Cutout(noun=noun, rgba=read_rgba(file))


def read_rgba(file: Path) -> Float32[np.ndarray, "h w 4"]:
    """The object, without the empty rows and columns around it.

    Raises:
        FileFormatError: damaged, without transparency, or wholly transparent.
    """
    pixels = cv2.imdecode(np.frombuffer(file.read_bytes(), np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None or pixels.ndim != 3 or pixels.shape[2] != 4 or pixels.dtype != np.uint8:
        raise FileFormatError(f"{file}: expected an image of 8 bits with transparency")
    opaque = pixels[..., 3] > 255 * OPAQUE
    if not opaque.any():
        raise FileFormatError(f"{file}: expected an object, got transparent pixels alone")
    rows, columns = (np.flatnonzero(opaque.any(axis)) for axis in (1, 0))
    part = pixels[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    rgba = cv2.cvtColor(part, cv2.COLOR_BGRA2RGBA).astype(np.float32) / 255
    return _reduced(rgba)


def _reduced(rgba: Float32[np.ndarray, "h w 4"]) -> Float32[np.ndarray, "p q 4"]:
    """No larger than ``MOST_SIDE_PX``; colours weigh by their opacity."""
    scale = MOST_SIDE_PX / max(rgba.shape[:2])
    if scale >= 1:
        return rgba
    sides = tuple(max(1, round(scale * side)) for side in rgba.shape[1::-1])
    opacity = np.maximum(rgba[..., 3:], _LEAST_OPACITY)
    small = cv2.resize(
        np.concatenate([rgba[..., :3] * opacity, opacity], -1), sides, interpolation=cv2.INTER_AREA
    )
    return np.concatenate([small[..., :3] / small[..., 3:], small[..., 3:]], -1)


def main_color(cutout: Cutout) -> str:
    """Name of the colour of most pixels; empty for an object of several."""
    small = cv2.resize(cutout.rgba, (_COLOR_SIDE_PX, _COLOR_SIDE_PX), interpolation=cv2.INTER_AREA)
    pixels = small[small[..., 3] > OPAQUE][:, :3]
    return main_color_name(linear_from_srgb(pixels.astype(np.float64)), np.ones(len(pixels)))
