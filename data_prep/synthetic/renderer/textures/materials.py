"""All textures by number, and materials as plain arrays."""

from typing import NamedTuple

import numpy as np

from diff4splat.data_prep.synthetic.renderer.textures import natural_noise as natural
from diff4splat.data_prep.synthetic.renderer.textures import regular as made
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


def materials_of(buffer: TriangleBuffer) -> Materials:
    """Textures of all objects.

    Raises:
        ConfigError: a family is unknown, or there are no two to four colours.
    """
    looks = [thing.texture for thing in buffer.objects]
    for look in looks:
        if look.family not in FAMILIES:
            raise ConfigError(f"texture: expected one of {', '.join(FAMILIES)}, got {look.family}")
        if not 2 <= len(look.colors) <= 4:
            raise ConfigError(f"{look.family}: expected 2 to 4 colours, got {len(look.colors)}")
    return Materials(
        np.array([FAMILIES.index(look.family) for look in looks], np.int64),
        np.array([_three(look) for look in looks], np.float64).reshape(-1, 3, 3),
        np.array([look.scale for look in looks], np.float64),
        np.array([look.seed for look in looks], np.int64),
        np.array([look.solid for look in looks], np.bool_),
        np.array([look.relief for look in looks], np.float64),
        np.array([look.gloss for look in looks], np.float64),
        np.array([thing.mesh.smooth for thing in buffer.objects], np.bool_),
    )


def _three(look: Texture) -> np.ndarray:
    """First, second and third colour; the third is a dark mixture where it is not given."""
    third = look.colors[2] if len(look.colors) > 2 else (look.colors[0] + look.colors[1]) * 0.3
    return np.stack([look.colors[0], look.colors[1], third])


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
