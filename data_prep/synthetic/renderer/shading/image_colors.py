"""Kernel: the colours of an image from its visibility samples.

A triangle is shaded once in each pixel where it has samples, at their middle, with its texture
averaged over the pixel, and counts as often as it has samples. On a smooth surface it stands for
the triangles that touch it. Light adds up linearly; the tone curve comes last.
"""

from typing import NamedTuple

from diff4splat.data_prep.synthetic.renderer.cameras import RenderCamera
from diff4splat.data_prep.synthetic.renderer.jit import kernel
from diff4splat.data_prep.synthetic.renderer.numerics import blend, exponential
from diff4splat.data_prep.synthetic.renderer.rasterise import touch
from diff4splat.data_prep.synthetic.renderer.shading.reflection import (
    Point,
    Shade,
    received,
    reflected,
)
from diff4splat.data_prep.synthetic.renderer.shading.relief import (
    bend_normal,
    pixel_size_m,
    shows_relief,
    texel_at,
)
from diff4splat.data_prep.synthetic.renderer.shading.skies import Lighting, sky
from diff4splat.data_prep.synthetic.renderer.shading.surface_point import (
    Surfaces,
    depth_at,
    face_normal,
    hit_at,
    smooth_normal,
    world_ray,
)
from diff4splat.data_prep.synthetic.renderer.shading.tone import encoded, filmic
from diff4splat.data_prep.synthetic.renderer.textures.materials import Materials
from diff4splat.kernels.jit import inlined, merged


class ShadedView(NamedTuple):
    """All that one view at one time is shaded from."""

    lens: RenderCamera
    surfaces: Surfaces
    materials: Materials
    lighting: Lighting
    shades: Shade


class Sample(NamedTuple):
    """One direction (x, y, 1) in which a pixel is shaded."""

    triangle: int
    """-1 is sky."""
    x: float
    y: float
    turn: int
    """Which of four turns its shadow samples have."""


@kernel
def shade(owners, grid, view, thresholds, image):
    """Fill ``image`` (h w 3, bytes)."""
    lens, surfaces, materials, lighting, shades = view
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
                    elif not _continues(leader, owners[j, i], surfaces, materials):
                        continue
                    done |= 1 << other
                    count += 1
                sample = Sample(leader, x / own, y / own, (first + row + column) & 3)
                color = _light(sample, lens, surfaces, materials, lighting, shades)
                red += color[0] * count
                green += color[1] * count
                blue += color[2] * count
            scale = lighting.exposure / samples
            image[row, column, 0] = encoded(filmic(red * scale), thresholds)
            image[row, column, 1] = encoded(filmic(green * scale), thresholds)
            image[row, column, 2] = encoded(filmic(blue * scale), thresholds)


@inlined
def _continues(index, other, surfaces, materials):
    """Whether a smooth surface continues from one triangle to another that touches it."""
    return (
        index >= 0
        and other >= 0
        and materials.smooth[surfaces.owners[index]]
        and touch(surfaces.triangles, index, other)
    )


@merged
def _light(sample, lens, surfaces, materials, lighting, shades):
    """Linear light of a sample: of its triangle, or of the sky where there is none."""
    ray, length = world_ray(lens.rotation, sample.x, sample.y)
    if sample.triangle < 0:
        return sky(ray[0], ray[1], ray[2], lighting)
    hit = hit_at(sample.triangle, sample.x, sample.y, surfaces)
    face = face_normal(hit, ray, surfaces.positions)
    smooth = face
    if materials.smooth[hit.owner]:
        smooth = smooth_normal(hit, face, surfaces.normals)
    depth = depth_at(hit, surfaces.local)
    scale = materials.scale[hit.owner]
    footprint = pixel_size_m(depth, ray, face, lens.focal[0]) * scale
    texel = texel_at(hit, footprint, surfaces, materials)
    normal = smooth
    if shows_relief(materials.relief[hit.owner] * scale, footprint):
        normal = bend_normal(hit, texel, normal, lens, surfaces, materials)
    point = Point(hit.position, ray, face, smooth, normal)
    light = received(point, sample.turn, lighting, shades)
    color = reflected(point, light, texel, hit.owner, materials, lighting)
    fog = 1.0 - exponential(-lighting.haze_per_m * depth * length)
    return (
        blend(color[0], lighting.horizon[0], fog),
        blend(color[1], lighting.horizon[1], fog),
        blend(color[2], lighting.horizon[2], fog),
    )
