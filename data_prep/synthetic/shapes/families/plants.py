"""What grows and what lies about: trees, bushes, pot plants, grass, flowers, rocks.

Leaves are real polygons. A crown is a few dark lumps that fill it and many leaves around them that
give it its outline.
"""

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import Shape, one, several
from diff4splat.data_prep.synthetic.shapes.surfaces.revolve import ball, revolved, smooth_profile
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import Surface, merged, surface
from diff4splat.data_prep.synthetic.shapes.surfaces.sweep import leaves, lump, tube


def _on_lumps(
    centers: Float64[np.ndarray, "c 3"], radii: Float64[np.ndarray, " c"], count: int, rng: Rng
) -> Float64[np.ndarray, "n 3"]:
    which = (rng.unit(count) * len(centers)).astype(np.int64)
    way = rng.normal(count, 3)
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-6)
    return centers[which] + way * (radii[which] * rng.uniform_array(0.85, 1.15, count))[:, None]


def _crown(
    centers: Float64[np.ndarray, "c 3"], radii: Float64[np.ndarray, " c"], count: int, rng: Rng
) -> Surface:
    lumps = [
        lump(rng, roughness=0.22, level=2, frequency=0.7).scaled(float(r)).at(*c.tolist())
        for c, r in zip(centers, radii, strict=True)
    ]
    points = _on_lumps(centers, radii, count, rng)
    sizes = float(radii.mean()) * rng.uniform_array(0.28, 0.5, count)
    return merged(*lumps, leaves(points, sizes, rng))


def make_tree(rng: Rng) -> Shape:
    """A broad-leaved tree."""
    fork, wide = rng.uniform(0.28, 0.42), rng.uniform(0.2, 0.32)
    count = rng.integer(4, 7)
    angle = np.arange(count) * (2 * np.pi / count) + rng.uniform_array(0.0, 1.2, count)
    out = rng.uniform_array(0.35, 0.8, count) * wide
    height = -rng.uniform_array(fork + 0.16, 0.86, count)
    centers = np.stack([out * np.cos(angle), height, out * np.sin(angle)], -1)
    radii = rng.uniform_array(0.13, 0.2, count) * (wide / 0.26)
    bend = rng.uniform_array(-0.03, 0.03, 2)
    stem = np.array([[0, 0.02, 0], [bend[0], -0.5 * fork, bend[1]], [0, -fork, 0], [0, -0.75, 0]])
    wood = [tube(stem, np.array([0.05, 0.036, 0.03, 0.008]), 9)]
    for center in centers:
        path = np.stack([stem[2], 0.5 * (stem[2] + center) + [0, 0.03, 0], center])
        wood.append(tube(path, np.array([0.022, 0.014, 0.006]), 6))
    return several(leaf=_crown(centers, radii, 420, rng), bark=merged(*wood))


def make_conifer(rng: Rng) -> Shape:
    """A fir: tiers of drooping needles."""
    tiers, wide = rng.integer(5, 7), rng.uniform(0.2, 0.3)
    low = rng.uniform(0.08, 0.16)
    skirts = []
    for k in range(tiers):
        bottom = low + (0.86 - low) * k / tiers
        radius = wide * (1 - 0.82 * k / tiers)
        top = min(bottom + 1.9 * (0.86 - low) / tiers, 1.0)
        cone = revolved(
            [
                [(0.0, top), (0.45 * radius, 0.5 * (top + bottom)), (radius, bottom)],
                [(radius, bottom), (0.3 * radius, bottom + 0.04), (0.0, bottom + 0.04)],
            ],
            18,
        )
        jag = 1 + 0.16 * np.sin(9 * np.arctan2(cone.vertices[:, 2], cone.vertices[:, 0]) + 2.1 * k)
        cone.vertices[:, [0, 2]] *= jag[:, None]
        cone.vertices[:, 1] += (
            0.05 * (jag - 1) * (np.hypot(cone.vertices[:, 0], cone.vertices[:, 2]) / wide)
        )
        skirts.append(cone)
    trunk = tube(np.array([[0.0, 0.02, 0.0], [0.0, -0.5, 0.0]]), np.array([0.035, 0.02]), 8)
    return several(needle=merged(*skirts), bark=trunk)


def make_bush(rng: Rng) -> Shape:
    """A bush that touches the ground."""
    count = rng.integer(3, 5)
    angle = np.arange(count) * (2 * np.pi / count)
    out = rng.uniform_array(0.1, 0.45, count)
    radii = rng.uniform_array(0.34, 0.5, count)
    centers = np.stack([out * np.cos(angle), -0.85 * radii, out * np.sin(angle)], -1)
    return several(leaf=_crown(centers, radii, 260, rng))


def make_pot_plant(rng: Rng) -> Shape:
    """Long leaves that bend out of a pot."""
    rim, high = rng.uniform(0.17, 0.24), rng.uniform(0.26, 0.36)
    side = smooth_profile([(rim, high), (0.97 * rim, 0.8 * high), (0.7 * rim, 0.0)], 5)
    pot = revolved(
        [
            [(0.0, high - 0.05), (0.88 * rim, high - 0.05), (0.9 * rim, high)],
            [(0.9 * rim, high), side[0]],
            side,
            [side[-1], (0.0, 0.0)],
        ],
        26,
    )
    count = rng.integer(12, 20)
    blades = _blades(count, rng, reach=(0.18, 0.5), height=(0.35, 0.66), width=0.055)
    return several(leaf=blades.at(y=0.05 - high), pot=pot)


def make_grass(rng: Rng) -> Shape:
    """A tuft of grass."""
    return one("grass", _blades(26, rng, reach=(0.15, 0.6), height=(0.5, 1.0), width=0.05))


def _blades(
    count: int, rng: Rng, reach: tuple[float, float], height: tuple[float, float], width: float
) -> Surface:
    """Blades that rise from the origin and bend outward; five rows of two vertices each."""
    angle, s = rng.uniform_array(0.0, 2 * np.pi, count)[:, None], np.linspace(0, 1, 5)[None]
    out = rng.uniform_array(*reach, count)[:, None] * s**1.8 + 0.05 * rng.unit(count)[:, None]
    up = -rng.uniform_array(*height, count)[:, None] * (s - 0.22 * s**3)
    half = 0.5 * width * (1.05 - s**2) * (0.4 + 1.8 * s * (1 - 0.5 * s))
    middle = np.stack([out * np.cos(angle), up, out * np.sin(angle)], -1)
    side = np.stack([-np.sin(angle), 0 * angle, np.cos(angle)], -1) * half[..., None]
    vertices = np.stack([middle - side, middle + side], 2).reshape(-1, 3)
    first = 10 * np.arange(count)[:, None, None] + 2 * np.arange(4)[None, :, None]
    triangles = np.concatenate(
        [first + np.array([0, 1, 2]), first + np.array([1, 3, 2])], 1
    ).reshape(-1, 3)
    uv = np.stack(np.broadcast_arrays((half[..., None] * [-1, 1]), -up[..., None]), -1).reshape(
        -1, 2
    )
    return surface(vertices, triangles.astype(np.int32), uv)


def make_flower(rng: Rng) -> Shape:
    """A flower with a ring of petals on a stem."""
    petals, wide = rng.integer(7, 11), rng.uniform(0.17, 0.24)
    angle = np.arange(petals) * (2 * np.pi / petals)
    s = np.linspace(0.12, 1, 5)
    half = wide * 0.42 * np.sin(np.pi * s**0.8) + 0.012
    out = np.stack([wide * s, -0.9 - 0.22 * wide * s + 0.05 * s**2], -1)
    c, n = np.cos(angle)[:, None], np.sin(angle)[:, None]
    middle = np.stack(np.broadcast_arrays(out[:, 0] * c, out[:, 1], out[:, 0] * n), -1)
    side = np.stack([-n * half, 0 * n * half, c * half], -1)
    vertices = np.stack([middle - side, middle + side], 2).reshape(-1, 3)
    first = 10 * np.arange(petals)[:, None, None] + 2 * np.arange(4)[None, :, None]
    triangles = np.concatenate(
        [first + np.array([0, 1, 2]), first + np.array([1, 3, 2])], 1
    ).reshape(-1, 3)
    uv = vertices[:, [0, 2]]
    path = np.array([[0.0, 0.0, 0.0], [0.03, -0.45, 0.01], [0.0, -0.9, 0.0]])
    stem = tube(path, np.array([0.018, 0.014, 0.014]), 6)
    low = _blades(5, rng, reach=(0.1, 0.25), height=(0.2, 0.4), width=0.07)
    corolla = surface(vertices, triangles.astype(np.int32), uv)
    return several(petal=corolla, leaf=merged(stem, low), accent=ball(0.05, 12).at(y=-0.88))


def make_rock(rng: Rng) -> Shape:
    """A weathered boulder, flattened where it lies."""
    body = lump(rng, roughness=rng.uniform(0.25, 0.45), level=3, frequency=0.5)
    body = body.stretched(rng.uniform(0.8, 1.4), rng.uniform(0.6, 0.9), rng.uniform(0.8, 1.3))
    body.vertices[:, 1] = np.minimum(body.vertices[:, 1], 0.35 + 0.1 * body.vertices[:, 1])
    return one("rock", body)
