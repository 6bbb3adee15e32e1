"""Kernel: the colours of an image from its visibility samples.

A triangle is shaded once in each pixel where it has samples, at their middle, with its texture
averaged over the pixel, and counts as often as it has samples. On a smooth surface it stands for
the triangles that touch it. Light adds up linearly; the tone curve comes last.
"""

import math
from typing import NamedTuple

import numpy as np

from diff4splat.data_prep.synthetic.renderer.jit import kernel
from diff4splat.data_prep.synthetic.renderer.numerics import (
    blend,
    clamp,
    cross,
    dot,
    exponential,
    unit,
)
from diff4splat.data_prep.synthetic.renderer.rasterise import touch, weights
from diff4splat.data_prep.synthetic.renderer.shadows import Chart, lit, open_sky
from diff4splat.data_prep.synthetic.renderer.skies import ambient, sky
from diff4splat.data_prep.synthetic.renderer.textures.materials import pattern
from diff4splat.data_prep.synthetic.renderer.tone import encoded, filmic
from diff4splat.kernels.jit import inlined, merged, shared

_AVERAGED_PX = 0.8
"""Textures are averaged over a little less than a pixel: lenses are about as sharp."""
_STEEPEST = 0.7
"""Slopes of relief are held here."""


class Surfaces(NamedTuple):
    """All triangles at one time, as seen by one camera."""

    positions: np.ndarray
    local: np.ndarray
    normals: np.ndarray
    rest: np.ndarray
    uv: np.ndarray
    triangles: np.ndarray
    owners: np.ndarray


class Shade(NamedTuple):
    """Height maps of one time: toward the light, and from above."""

    sun: np.ndarray
    sun_chart: Chart
    above: np.ndarray
    above_chart: Chart
    reach_m: float
    """How far away what stands around still hides sky."""


@kernel
def shade(owners, grid, lens, surfaces, materials, lighting, shades, thresholds, image):
    """Fill ``image`` (h w 3, bytes)."""
    n = grid.per_side
    samples = n * n
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            red, green, blue, done = 0.0, 0.0, 0.0, 0
            for first in range(samples):
                if (done >> first) & 1:
                    continue
                leader = owners[row * n + first // n, column * n + first % n]
                x, y, own, count = 0.0, 0.0, 0, 0
                for other in range(first, samples):
                    if (done >> other) & 1:
                        continue
                    j, i = row * n + other // n, column * n + other % n
                    if owners[j, i] == leader:
                        x += grid.x[j % n, i]
                        y += grid.y[j] + grid.bend[i]
                        own += 1
                    elif not _goes_on(leader, owners[j, i], surfaces, materials):
                        continue
                    done |= 1 << other
                    count += 1
                color = _seen(
                    leader, x / own, y / own, (first + row + column) & 3, lens, surfaces,
                    materials, lighting, shades,
                )  # fmt: skip
                red += color[0] * count
                green += color[1] * count
                blue += color[2] * count
            scale = lighting.exposure / samples
            image[row, column, 0] = encoded(filmic(red * scale), thresholds)
            image[row, column, 1] = encoded(filmic(green * scale), thresholds)
            image[row, column, 2] = encoded(filmic(blue * scale), thresholds)


@inlined
def _goes_on(index, other, surfaces, materials):
    """Whether a smooth surface goes on from one triangle to another that touches it."""
    return (
        index >= 0
        and other >= 0
        and materials.smooth[surfaces.owners[index]]
        and touch(surfaces.triangles, index, other)
    )


@merged
def _seen(index, x, y, turn, lens, surfaces, materials, lighting, shades):
    """Linear light along (x, y, 1) from a triangle, or from the sky where there is none."""
    axes = lens.rotation
    wx = axes[0, 0] * x + axes[0, 1] * y + axes[0, 2]
    wy = axes[1, 0] * x + axes[1, 1] * y + axes[1, 2]
    wz = axes[2, 0] * x + axes[2, 1] * y + axes[2, 2]
    stretch = math.sqrt(wx * wx + wy * wy + wz * wz)
    wx, wy, wz = wx / stretch, wy / stretch, wz / stretch
    if index < 0:
        return sky(wx, wy, wz, lighting)
    a, b, c = weights(surfaces.local, surfaces.triangles, index, x, y)
    i, j, k = (
        surfaces.triangles[index, 0],
        surfaces.triangles[index, 1],
        surfaces.triangles[index, 2],
    )
    px, py, pz = _mixed(surfaces.positions, i, j, k, a, b, c)
    owner = surfaces.owners[index]
    face = _facing(surfaces.positions, i, j, k, wx, wy, wz)
    even = face
    if materials.smooth[owner]:
        nx, ny, nz = _mixed(surfaces.normals, i, j, k, a, b, c)
        nx, ny, nz = unit(nx, ny, nz)
        side = dot(nx, ny, nz, face[0], face[1], face[2])
        if side < 0.0:
            nx, ny, nz = -nx, -ny, -nz
        if abs(side) > 1e-3:
            even = (nx, ny, nz)
    z = surfaces.local[i, 2] * a + surfaces.local[j, 2] * b + surfaces.local[k, 2] * c
    slant = clamp(-dot(wx, wy, wz, face[0], face[1], face[2]), 0.08, 1.0)
    # A pixel seen at a slant covers a long patch: something between its two sides.
    size_m = z * _AVERAGED_PX / lens.focal[0] / math.sqrt(slant)
    scale = materials.scale[owner]
    footprint = size_m * scale
    u, v, w = _place(surfaces, materials, owner, i, j, k, a, b, c)
    family, seed = materials.family[owner], materials.seed[owner]
    second, third, bright, level = pattern(family, u, v, w, footprint, seed)
    normal = even
    if materials.relief[owner] * scale > 0.004 and footprint < 0.5:
        normal = _bent(
            index, x, y, level, footprint, (i, j, k), (px, py, pz), normal, lens, surfaces,
            materials, owner,
        )  # fmt: skip
    # By quarters of a sixth of a turn: the patterns of neighbours complete each other.
    spin_x, spin_y = 1.0, 0.0
    for _ in range(turn):
        spin_x, spin_y = (
            0.9659258262890683 * spin_x - 0.25881904510252074 * spin_y,
            0.25881904510252074 * spin_x + 0.9659258262890683 * spin_y,
        )
    toward = lighting.toward
    facing = dot(normal[0], normal[1], normal[2], toward[0], toward[1], toward[2])
    sun = 0.0
    if facing > 0.0 and dot(face[0], face[1], face[2], toward[0], toward[1], toward[2]) > -0.1:
        sun = facing * lit(
            px, py, pz, even, shades.sun,
            shades.sun_chart, lighting.softness, spin_x, spin_y,
        )  # fmt: skip
    open_share = open_sky(
        px, py, pz, face, shades.above, shades.above_chart, shades.reach_m, spin_x, spin_y
    )
    reached = open_share + (1.0 - open_share) * lighting.handed_on
    up = 0.5 - 0.5 * normal[1]
    gloss = materials.gloss[owner] * clamp(0.7 + 0.6 * (level - 0.5), 0.0, 1.0)
    shine, mirror = _shine(normal, (wx, wy, wz), toward, gloss, facing)
    ry = wy - 2.0 * dot(normal[0], normal[1], normal[2], wx, wy, wz) * normal[1]
    fog = 1.0 - exponential(-lighting.haze_per_m * z * stretch)
    red = green = blue = 0.0
    for at in range(3):
        albedo = blend(materials.colors[owner, 0, at], materials.colors[owner, 1, at], second)
        albedo = clamp(blend(albedo, materials.colors[owner, 2, at], third) * bright, 0.0, 0.95)
        around = blend(lighting.below[at], lighting.above[at], up)
        # What is hidden from the sky is lit by its neighbours, which share its colour.
        around *= reached / (1.0 - 0.5 * albedo * (1.0 - reached))
        light = albedo * (sun * lighting.color[at] + around) + sun * shine * lighting.color[at]
        light += mirror * open_share * ambient(ry, lighting, at)
        light = blend(light, lighting.horizon[at], fog)
        red, green, blue = green, blue, light
    return red, green, blue


@inlined
def _mixed(values, i, j, k, a, b, c):
    return (
        values[i, 0] * a + values[j, 0] * b + values[k, 0] * c,
        values[i, 1] * a + values[j, 1] * b + values[k, 1] * c,
        values[i, 2] * a + values[j, 2] * b + values[k, 2] * c,
    )


@inlined
def _facing(positions, i, j, k, wx, wy, wz):
    """Unit normal of a triangle, on the side that is seen."""
    ax, ay, az = positions[i, 0], positions[i, 1], positions[i, 2]
    x, y, z = cross(
        positions[j, 0] - ax, positions[j, 1] - ay, positions[j, 2] - az,
        positions[k, 0] - ax, positions[k, 1] - ay, positions[k, 2] - az,
    )  # fmt: skip
    x, y, z = unit(x, y, z)
    if dot(x, y, z, wx, wy, wz) > 0.0:
        return -x, -y, -z
    return x, y, z


@inlined
def _place(surfaces, materials, owner, i, j, k, a, b, c):
    """Where a texture is looked up, in features."""
    scale = materials.scale[owner]
    if materials.solid[owner]:
        u, v, w = _mixed(surfaces.rest, i, j, k, a, b, c)
        return u * scale, v * scale, w * scale
    u = surfaces.uv[i, 0] * a + surfaces.uv[j, 0] * b + surfaces.uv[k, 0] * c
    v = surfaces.uv[i, 1] * a + surfaces.uv[j, 1] * b + surfaces.uv[k, 1] * c
    return u * scale, v * scale, 0.5


@shared
def _bent(index, x, y, level, footprint, corners, point, normal, lens, surfaces, materials, owner):
    """The normal, bent by the slope of the texture's height (Mikkelsen 2010).

    Slopes along the image's axes, half a pixel away on the plane of the triangle.
    """
    i, j, k = corners
    step_x = _AVERAGED_PX * 0.5 / lens.focal[0]
    a, b, c = weights(surfaces.local, surfaces.triangles, index, x + step_x, y)
    right = _mixed(surfaces.positions, i, j, k, a, b, c)
    u, v, w = _place(surfaces, materials, owner, i, j, k, a, b, c)
    _, _, _, level_right = pattern(
        materials.family[owner], u, v, w, footprint, materials.seed[owner]
    )
    a, b, c = weights(surfaces.local, surfaces.triangles, index, x, y + step_x)
    below = _mixed(surfaces.positions, i, j, k, a, b, c)
    u, v, w = _place(surfaces, materials, owner, i, j, k, a, b, c)
    _, _, _, level_below = pattern(
        materials.family[owner], u, v, w, footprint, materials.seed[owner]
    )
    tx, ty, tz = right[0] - point[0], right[1] - point[1], right[2] - point[2]
    sx, sy, sz = below[0] - point[0], below[1] - point[1], below[2] - point[2]
    first = cross(sx, sy, sz, normal[0], normal[1], normal[2])
    second = cross(normal[0], normal[1], normal[2], tx, ty, tz)
    area = dot(tx, ty, tz, first[0], first[1], first[2])
    if not area * area > 1e-60:
        return normal
    along = materials.relief[owner] * (level_right - level) / area
    down = materials.relief[owner] * (level_below - level) / area
    gx = along * first[0] + down * second[0]
    gy = along * first[1] + down * second[1]
    gz = along * first[2] + down * second[2]
    steep = math.sqrt(gx * gx + gy * gy + gz * gz)
    hold = _STEEPEST / (_STEEPEST + steep)
    return unit(normal[0] - gx * hold, normal[1] - gy * hold, normal[2] - gz * hold)


@inlined
def _shine(normal, ray, toward, gloss, facing):
    """Highlight per light (GGX, Walter 2007, with Schlick's Fresnel term) and share of mirror."""
    if gloss <= 0.0:
        return 0.0, 0.0
    across = clamp(-dot(normal[0], normal[1], normal[2], ray[0], ray[1], ray[2]), 0.0, 1.0)
    left = 1.0 - across
    fresnel = 0.04 + 0.96 * left * left * left * left * left
    mirror = gloss * fresnel
    if facing <= 0.0:
        return 0.0, mirror
    hx, hy, hz = unit(toward[0] - ray[0], toward[1] - ray[1], toward[2] - ray[2])
    nh = clamp(dot(normal[0], normal[1], normal[2], hx, hy, hz), 0.0, 1.0)
    vh = clamp(-dot(ray[0], ray[1], ray[2], hx, hy, hz), 0.0, 1.0)
    rough = 0.75 - 0.6 * gloss
    rough = rough * rough
    rough = rough * rough
    bend = nh * nh * (rough - 1.0) + 1.0
    left = 1.0 - vh
    tilt = 0.04 + 0.96 * left * left * left * left * left
    peak = rough / (bend * bend) / (4.0 * max(vh * vh, 0.1) * (0.5 + math.sqrt(rough)))
    return gloss * tilt * min(peak, 400.0), mirror
