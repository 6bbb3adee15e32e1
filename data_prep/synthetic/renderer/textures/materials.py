"""All textures by number, and materials as plain arrays."""

from typing import NamedTuple

import numpy as np

from diff4splat.data_prep.synthetic.renderer.textures import natural_noise as natural
from diff4splat.data_prep.synthetic.renderer.textures import regular as made
from diff4splat.data_prep.synthetic.renderer.textures.images import IMAGE, image_stacks
from diff4splat.data_prep.synthetic.renderer.textures.lettering import lettering
from diff4splat.data_prep.synthetic.renderer.triangle_buffer import TriangleBuffer
from diff4splat.data_prep.synthetic.world import Texture
from diff4splat.errors import ConfigError
from diff4splat.kernels.jit import shared

FAMILIES = (
    "plain", "noise", "wood", "brick", "checker", "leaves", "fabric", "marble", "lettering",
    "stripes", "dots", "tiles", "stone", "grass", "plaster", "planks", "rust", "scales",
)  # fmt: skip
"""Their order is what `pattern` counts by."""

_plain, _noise, _wood, _marble = natural.plain, natural.cloudy, natural.wood, natural.marble
_stone, _grass, _plaster, _rust = natural.stone, natural.grass, natural.plaster, natural.rust
_leaves, _brick, _checker, _fabric = natural.leaves, made.brick, made.checker, made.fabric
_stripes, _dots, _tiles, _planks = made.stripes, made.dots, made.tiles, made.planks
_scales = made.scales


class Materials(NamedTuple):
    """Axes: ``o`` objects."""

    family: np.ndarray
    colors: np.ndarray
    """o × 3 × 3, linear."""
    scale: np.ndarray
    seed: np.ndarray
    solid: np.ndarray
    relief: np.ndarray
    gloss: np.ndarray
    smooth: np.ndarray
    images: np.ndarray
    image: np.ndarray
    """Which of the images an object has; -1 is none."""


def materials_of(buffer: TriangleBuffer) -> Materials:
    """Textures of all objects.

    Raises:
        ConfigError: a family is unknown, there are no two to four colours, or an image does not
            fit.
    """
    textures = [item.texture for item in buffer.objects]
    for texture in textures:
        if texture.family not in (*FAMILIES, IMAGE):
            raise ConfigError(
                f"texture: expected one of {', '.join(FAMILIES)}, got {texture.family}"
            )
        if not 2 <= len(texture.colors) <= 4:
            raise ConfigError(
                f"{texture.family}: expected 2 to 4 colours, got {len(texture.colors)}"
            )
    return Materials(
        np.array([_number(texture.family) for texture in textures], np.int64),
        np.array([_three(texture) for texture in textures], np.float64).reshape(-1, 3, 3),
        np.array([texture.scale for texture in textures], np.float64),
        np.array([texture.seed for texture in textures], np.int64),
        np.array([texture.solid for texture in textures], np.bool_),
        np.array([texture.relief for texture in textures], np.float64),
        np.array([texture.gloss for texture in textures], np.float64),
        np.array([item.mesh.smooth for item in buffer.objects], np.bool_),
        *image_stacks(buffer),
    )


def _number(family: str) -> int:
    """What `pattern` counts by; an image has no pattern."""
    return 0 if family == IMAGE else FAMILIES.index(family)


def _three(texture: Texture) -> np.ndarray:
    """First, second and third colour; the third is a dark mixture where it is not given."""
    third = (
        texture.colors[2]
        if len(texture.colors) > 2
        else (texture.colors[0] + texture.colors[1]) * 0.3
    )
    return np.stack([texture.colors[0], texture.colors[1], third])


@shared
def pattern(family, p, q, r, footprint, seed):
    """(share of the second colour, share of the third, brightness, height) at a point.

    Coordinates and the footprint of the sample count features of the texture.
    """
    if family < 6:
        if family == 0:
            return _plain(p, q, r, footprint, seed)
        if family == 1:
            return _noise(p, q, r, footprint, seed)
        if family == 2:
            return _wood(p, q, r, footprint, seed)
        if family == 3:
            return _brick(p, q, r, footprint, seed)
        if family == 4:
            return _checker(p, q, r, footprint, seed)
        return _leaves(p, q, r, footprint, seed)
    if family < 12:
        if family == 6:
            return _fabric(p, q, r, footprint, seed)
        if family == 7:
            return _marble(p, q, r, footprint, seed)
        if family == 8:
            return lettering(p, q, r, footprint, seed)
        if family == 9:
            return _stripes(p, q, r, footprint, seed)
        if family == 10:
            return _dots(p, q, r, footprint, seed)
        return _tiles(p, q, r, footprint, seed)
    if family == 12:
        return _stone(p, q, r, footprint, seed)
    if family == 13:
        return _grass(p, q, r, footprint, seed)
    if family == 14:
        return _plaster(p, q, r, footprint, seed)
    if family == 15:
        return _planks(p, q, r, footprint, seed)
    if family == 16:
        return _rust(p, q, r, footprint, seed)
    return _scales(p, q, r, footprint, seed)
