"""Textures with height: the pattern at a point, and the normal that its slope bends."""

import math
from typing import NamedTuple

from diff4splat.data_prep.synthetic.renderer.numerics import clamp, cross, dot, unit
from diff4splat.data_prep.synthetic.renderer.shading.surface_point import (
    hit_at,
    texture_coordinates,
)
from diff4splat.data_prep.synthetic.renderer.textures.images import image_color
from diff4splat.data_prep.synthetic.renderer.textures.materials import pattern
from diff4splat.kernels.jit import inlined, shared

_AVERAGED_PX = 0.8
"""Textures are averaged over a little less than a pixel: lenses are about as sharp."""
_STEEPEST = 0.7
"""Slopes of relief are held here."""


class Texel(NamedTuple):
    """The texture around a point."""

    footprint: float
    """Size of a pixel, in features."""
    second: float
    third: float
    """Shares of the second and the third colour."""
    brightness: float
    height: float
    image: tuple[float, float, float]
    """Colour of an image; black without one."""


@inlined
def texel_at(hit, footprint, surfaces, materials):
    """The texture of the point, averaged over ``footprint``."""
    owner = hit.owner
    u, v, w = texture_coordinates(hit, surfaces, materials)
    if materials.image[owner] >= 0:
        color = image_color(materials.images, materials.image[owner], u, v, footprint)
        return Texel(footprint, 0.0, 0.0, 1.0, 0.5, color)
    second, third, brightness, height = pattern(
        materials.family[owner], u, v, w, footprint, materials.seed[owner]
    )
    return Texel(footprint, second, third, brightness, height, (0.0, 0.0, 0.0))


@inlined
def pixel_size_m(depth, ray, face, focal_px):
    """Size of a pixel on the surface.

    A pixel seen at a slant covers a long patch: something between its two sides.
    """
    slant = clamp(-dot(ray[0], ray[1], ray[2], face[0], face[1], face[2]), 0.08, 1.0)
    return depth * _AVERAGED_PX / focal_px / math.sqrt(slant)


@inlined
def shows_relief(height, footprint):
    """Whether slopes are high enough and pixels small enough, both in features."""
    return height > 0.004 and footprint < 0.5


@shared
def bend_normal(hit, texel, normal, lens, surfaces, materials):
    """The normal, bent by the slope of the texture's height (Mikkelsen 2010).

    Slopes along the image's axes, half a pixel away on the plane of the triangle.
    """
    step = _AVERAGED_PX * 0.5 / lens.focal[0]
    right = hit_at(hit.triangle, hit.x + step, hit.y, surfaces)
    below = hit_at(hit.triangle, hit.x, hit.y + step, surfaces)
    to_right = _offset(hit, right)
    to_below = _offset(hit, below)
    height_right = texel_at(right, texel.footprint, surfaces, materials).height
    height_below = texel_at(below, texel.footprint, surfaces, materials).height
    relief = materials.relief[hit.owner]
    rises = (relief * (height_right - texel.height), relief * (height_below - texel.height))
    return _tilted(normal, to_right, to_below, rises)


@inlined
def _offset(hit, other):
    x, y, z = hit.position
    ox, oy, oz = other.position
    return ox - x, oy - y, oz - z


@inlined
def _tilted(normal, right, below, rises):
    """The normal of a plane that rises by ``rises`` along two offsets; steep slopes are damped."""
    first = cross(below[0], below[1], below[2], normal[0], normal[1], normal[2])
    second = cross(normal[0], normal[1], normal[2], right[0], right[1], right[2])
    area = dot(right[0], right[1], right[2], first[0], first[1], first[2])
    if not area * area > 1e-60:
        return normal
    along, down = rises[0] / area, rises[1] / area
    gx = along * first[0] + down * second[0]
    gy = along * first[1] + down * second[1]
    gz = along * first[2] + down * second[2]
    steep = math.sqrt(gx * gx + gy * gy + gz * gz)
    hold = _STEEPEST / (_STEEPEST + steep)
    return unit(normal[0] - gx * hold, normal[1] - gy * hold, normal[2] - gz * hold)
