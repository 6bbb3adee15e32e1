"""Light that a point receives from sun and sky, and what it reflects to the camera.

Light adds up linearly. A highlight is GGX (Walter 2007) with Schlick's Fresnel term.
"""

import math
from typing import NamedTuple

import numpy as np

from diff4splat.data_prep.synthetic.renderer.numerics import blend, clamp, dot, unit
from diff4splat.data_prep.synthetic.renderer.shading.shadows import Chart, lit, open_sky
from diff4splat.data_prep.synthetic.renderer.shading.skies import ambient
from diff4splat.kernels.jit import inlined


class Shade(NamedTuple):
    """Height maps of one time: toward the light, and from above."""

    sun: np.ndarray
    sun_chart: Chart
    above: np.ndarray
    above_chart: Chart
    reach_m: float
    """How far away surroundings still hide sky."""


class Point(NamedTuple):
    """A point of a surface, in world axes."""

    position: tuple[float, float, float]
    ray: tuple[float, float, float]
    """From the camera."""
    face: tuple[float, float, float]
    smooth: tuple[float, float, float]
    normal: tuple[float, float, float]
    """Normals of the triangle, of the smooth surface, and of its relief."""


class Received(NamedTuple):
    """Light at a point."""

    facing: float
    """Cosine between normal and light."""
    sun: float
    """The same where the light reaches the point, else less; 0 where it does not."""
    open_sky: float
    """Share of the sky that nothing hides."""


@inlined
def received(point, turn, lighting, shades):
    """Light from the sun and share of the sky, by shadow samples at ``turn`` of four angles."""
    px, py, pz = point.position
    face, normal, toward = point.face, point.normal, lighting.toward
    spin_x, spin_y = _spin(turn)
    facing = dot(normal[0], normal[1], normal[2], toward[0], toward[1], toward[2])
    sun = 0.0
    if facing > 0.0 and dot(face[0], face[1], face[2], toward[0], toward[1], toward[2]) > -0.1:
        sun = facing * lit(
            px, py, pz, point.smooth, shades.sun,
            shades.sun_chart, lighting.softness, spin_x, spin_y,
        )  # fmt: skip
    open_share = open_sky(
        px, py, pz, face, shades.above, shades.above_chart, shades.reach_m, spin_x, spin_y
    )
    return Received(facing, sun, open_share)


@inlined
def _spin(turn):
    """By quarters of a sixth of a turn: the patterns of neighbours complete each other."""
    x, y = 1.0, 0.0
    for _ in range(turn):
        x, y = (
            0.9659258262890683 * x - 0.25881904510252074 * y,
            0.25881904510252074 * x + 0.9659258262890683 * y,
        )
    return x, y


@inlined
def reflected(point, light, texel, owner, materials, lighting):
    """Red, green and blue toward the camera, without haze."""
    ray, normal = point.ray, point.normal
    reached = light.open_sky + (1.0 - light.open_sky) * lighting.handed_on
    up = 0.5 - 0.5 * normal[1]
    gloss = materials.gloss[owner] * clamp(0.7 + 0.6 * (texel.height - 0.5), 0.0, 1.0)
    shine, mirror = _shine(normal, ray, lighting.toward, gloss, light.facing)
    ry = ray[1] - 2.0 * dot(normal[0], normal[1], normal[2], ray[0], ray[1], ray[2]) * normal[1]
    red = green = blue = 0.0
    for at in range(3):
        albedo = _albedo(materials, owner, texel, at)
        around = blend(lighting.below[at], lighting.above[at], up)
        # What is hidden from the sky is lit by its neighbours, which share its colour.
        around *= reached / (1.0 - 0.5 * albedo * (1.0 - reached))
        total = albedo * (light.sun * lighting.color[at] + around)
        total += light.sun * shine * lighting.color[at]
        total += mirror * light.open_sky * ambient(ry, lighting, at)
        red, green, blue = green, blue, total
    return red, green, blue


@inlined
def _albedo(materials, owner, texel, channel):
    if materials.image[owner] >= 0:
        return clamp(texel.image[channel], 0.0, 0.95)
    colors = materials.colors
    value = blend(colors[owner, 0, channel], colors[owner, 1, channel], texel.second)
    value = blend(value, colors[owner, 2, channel], texel.third)
    return clamp(value * texel.brightness, 0.0, 0.95)


@inlined
def _shine(normal, ray, toward, gloss, facing):
    """Highlight per light, and share of the mirror image."""
    if gloss <= 0.0:
        return 0.0, 0.0
    across = clamp(-dot(normal[0], normal[1], normal[2], ray[0], ray[1], ray[2]), 0.0, 1.0)
    mirror = gloss * _fresnel(across)
    if facing <= 0.0:
        return 0.0, mirror
    hx, hy, hz = unit(toward[0] - ray[0], toward[1] - ray[1], toward[2] - ray[2])
    nh = clamp(dot(normal[0], normal[1], normal[2], hx, hy, hz), 0.0, 1.0)
    vh = clamp(-dot(ray[0], ray[1], ray[2], hx, hy, hz), 0.0, 1.0)
    rough = 0.75 - 0.6 * gloss
    rough = rough * rough
    rough = rough * rough
    bend = nh * nh * (rough - 1.0) + 1.0
    peak = rough / (bend * bend) / (4.0 * max(vh * vh, 0.1) * (0.5 + math.sqrt(rough)))
    return gloss * _fresnel(vh) * min(peak, 400.0), mirror


@inlined
def _fresnel(cosine):
    left = 1.0 - cosine
    return 0.04 + 0.96 * left * left * left * left * left
