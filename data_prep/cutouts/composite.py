"""An image of cutouts before a photograph, with the object that every pixel shows.

    photograph ─ part ─┬─ shadow, cutout ─ shadow, cutout ─ … ─ image, numbers of objects
    cutouts ─ colour, texture, light, place ─┘                 largest first

After "Cut, Paste and Learn" (arXiv 1708.01642). Axes: ``h w`` pixels.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from diff4splat.data_prep.cutouts.change import lit, recolored, textured
from diff4splat.data_prep.cutouts.cutout import OPAQUE, Cutout, main_color
from diff4splat.data_prep.cutouts.placement import draw_placement, placed

SHADOW_SHARE, SHADOW_DARKNESS = 0.6, 0.5
LEAST_PART = 0.5
"""Least side of the part of a photograph, as a share of its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PastedObject:
    """What an image says of one object."""

    noun: str
    color: str
    """Empty for an object of several colours."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Composite:
    """An image, and its objects in order of their numbers, from 1."""

    rgb: UInt8[np.ndarray, "h w 3"]
    numbers: UInt8[np.ndarray, "h w"]
    """0 is the photograph."""
    objects: tuple[PastedObject, ...]


def compose(
    photograph: UInt8[np.ndarray, "p q 3"],
    cutouts: list[Cutout],
    size_px: tuple[int, int],
    random: np.random.Generator,
    keep_colors: bool = False,
) -> Composite:
    """``cutouts`` before a part of the photograph; those hidden by later ones keep their number.

    ``keep_colors`` leaves out other colours and textures.
    """
    image = _part(photograph, size_px, random).astype(np.float32) / 255
    numbers = np.zeros(size_px, np.uint8)
    objects: list[PastedObject] = []
    texture = None if keep_colors else photograph
    for cutout, layer in _layers(texture, cutouts, size_px, random):
        objects.append(PastedObject(noun=cutout.noun, color=main_color(cutout)))
        image = _over(layer, _with_shadow(image, layer[..., 3], random))
        numbers[layer[..., 3] > OPAQUE] = len(objects)
    rgb = (image.clip(0, 1) * 255 + 0.5).astype(np.uint8)
    return Composite(rgb=rgb, numbers=numbers, objects=tuple(objects))


def _layers(
    texture: UInt8[np.ndarray, "p q 3"] | None,
    cutouts: list[Cutout],
    size_px: tuple[int, int],
    random: np.random.Generator,
) -> list[tuple[Cutout, Float32[np.ndarray, "h w 4"]]]:
    """Objects and their layers, those of many pixels first: they lie behind."""
    layers = []
    for cutout in cutouts:
        changed = shown = cutout
        if texture is not None:
            changed = recolored(cutout, random)
            shown = textured(changed, texture, random)
        shown = lit(shown, random)
        layers.append((changed, placed(shown, draw_placement(shown, size_px, random), size_px)))
    return sorted(layers, key=lambda one: -float(one[1][..., 3].sum()))


def _part(
    photograph: UInt8[np.ndarray, "p q 3"], size_px: tuple[int, int], random: np.random.Generator
) -> UInt8[np.ndarray, "h w 3"]:
    """A part of the photograph, mirrored half of the time."""
    share, top, left, mirror = random.random(4)
    share = LEAST_PART + (1 - LEAST_PART) * share
    height, width = (max(1, round(share * side)) for side in photograph.shape[:2])
    top, left = (
        int(place * (side - part + 1))
        for place, side, part in zip(
            (top, left), photograph.shape[:2], (height, width), strict=True
        )
    )
    part = photograph[top : top + height, left : left + width]
    part = np.ascontiguousarray(part[:, ::-1]) if mirror < 0.5 else part
    kind = cv2.INTER_AREA if height > size_px[0] else cv2.INTER_CUBIC
    return cv2.resize(part, size_px[::-1], interpolation=kind)


def _with_shadow(
    image: Float32[np.ndarray, "h w 3"],
    opacity: Float32[np.ndarray, "h w"],
    random: np.random.Generator,
) -> Float32[np.ndarray, "h w 3"]:
    """A soft shadow of the object beside it, in most images."""
    chance, darkness, across, down, softness = random.random(5)
    if chance >= SHADOW_SHARE:
        return image
    side = float(np.sqrt(opacity.sum() + 1))
    shift = np.array([[1, 0, side * 0.3 * (across - 0.5)], [0, 1, side * 0.2 * down]])
    moved = cv2.warpAffine(opacity, shift, opacity.shape[::-1])
    soft = cv2.GaussianBlur(moved, (0, 0), 0.5 + 0.15 * side * softness)
    return image * (1 - np.float32(SHADOW_DARKNESS * darkness) * soft[..., None])


def _over(
    layer: Float32[np.ndarray, "h w 4"], image: Float32[np.ndarray, "h w 3"]
) -> Float32[np.ndarray, "h w 3"]:
    return layer[..., :3] + (1 - layer[..., 3:]) * image
