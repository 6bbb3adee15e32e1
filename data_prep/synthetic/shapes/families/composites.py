"""Objects that no word names: random primitives that touch, as in LRM-Zero (arXiv 2406.09371).

A network that only sees the families of the registry learns their outlines by heart.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import Part, Shape
from diff4splat.data_prep.synthetic.shapes.surfaces.facets import box, extruded
from diff4splat.data_prep.synthetic.shapes.surfaces.revolve import (
    revolved,
    smooth_profile,
    superquadric,
)
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import (
    Surface,
    about_x,
    about_y,
    about_z,
    merged,
    outward,
)
from diff4splat.data_prep.synthetic.shapes.surfaces.sweep import lump, torus, tube

MOST_PIECES = 5
MIRRORED_SHARE, TURNED_SHARE, TAPERED_SHARE, TWISTED_SHARE = 0.5, 0.4, 0.3, 0.25
ONE_ROLE_SHARE = 0.5
FIRST_SIZES, OTHER_SIZES = (0.5, 1.0), (0.2, 0.8)
"""Along each axis, log-uniform, before the object is scaled."""
THIN_SHARE, THIN_SIZES = 0.15, (0.03, 0.12)
"""Of pieces whose third axis is thin: sheets, discs and flat rings."""
WALL_SHARES = (0.04, 0.3)
"""Thickness of a hollow body's wall over its radius, log-uniform."""
ROLES = ("painted", "toy", "coat", "machine", "ceramic", "wood", "staves", "pot", "accent", "fence")


def make_composite(rng: Rng) -> Shape:
    """One to five primitives, often mirrored, tapered or twisted, of one or two materials."""
    pieces = _touching_pieces(rng.child("pieces"))
    if rng.bernoulli(MIRRORED_SHARE):
        pieces = [merged(piece, _mirrored(piece)) for piece in pieces]
    bend = _deformation(pieces, rng.child("deformation"))
    pieces = [replace(piece, vertices=bend(piece.vertices)) for piece in pieces]
    return Shape(parts=_parts(pieces, rng.child("roles"))).of_height(1.0)


def _touching_pieces(rng: Rng) -> list[Surface]:
    """Primitives, each centred on a vertex of the ones before it."""
    pieces = [_piece(FIRST_SIZES, rng.child(0))]
    for number in range(1, rng.integer(1, MOST_PIECES)):
        corners = np.concatenate([piece.vertices for piece in pieces])
        at = corners[rng.integer(0, len(corners) - 1)]
        pieces.append(_piece(OTHER_SIZES, rng.child(number)).at(*at.tolist()))
    return pieces


def _piece(sizes: tuple[float, float], rng: Rng) -> Surface:
    """A primitive of random extents around the origin."""
    make = rng.choice(PRIMITIVES)
    piece = make(rng.child("primitive"))
    low, high = piece.vertices.min(0), piece.vertices.max(0)
    wanted = np.array([rng.log_uniform(*sizes) for _ in range(3)])
    if rng.bernoulli(THIN_SHARE):
        wanted[2] = rng.log_uniform(*THIN_SIZES)
    factor = wanted / np.maximum(high - low, 1e-6)
    piece = replace(piece, vertices=(piece.vertices - (low + high) / 2) * factor)
    return piece.turned(_turn(rng))


def _turn(rng: Rng) -> Float64[np.ndarray, "3 3"]:
    """Upright or lying along an axis, or turned anyhow."""
    if rng.bernoulli(TURNED_SHARE):
        x, y, z = rng.uniform_array(0.0, 2 * np.pi, 3).tolist()
        return about_x(x) @ about_y(y) @ about_z(z)
    return rng.choice((np.eye(3), about_x(np.pi / 2), about_z(np.pi / 2)))


def _mirrored(piece: Surface) -> Surface:
    """The piece on the other side of the plane z = 0."""
    return outward(replace(piece, vertices=piece.vertices * np.array([1.0, 1.0, -1.0])))


def _deformation(
    pieces: list[Surface], rng: Rng
) -> Callable[[Float64[np.ndarray, "v 3"]], Float64[np.ndarray, "v 3"]]:
    """Narrower towards one end, and turned about the vertical with the height."""
    corners = np.concatenate([piece.vertices for piece in pieces])
    low, high = corners[:, 1].min(), corners[:, 1].max()
    taper = rng.uniform(-0.6, 0.6) if rng.bernoulli(TAPERED_SHARE) else 0.0
    twist = rng.uniform(-2.0, 2.0) if rng.bernoulli(TWISTED_SHARE) else 0.0

    def deformed(points: Float64[np.ndarray, "v 3"]) -> Float64[np.ndarray, "v 3"]:
        up = (points[:, 1] - low) / (high - low)
        width = 1.0 + taper * (up - 0.5)
        x, z = width * points[:, 0], width * points[:, 2]
        c, s = np.cos(twist * up), np.sin(twist * up)
        return np.stack([c * x + s * z, points[:, 1], c * z - s * x], -1)

    return deformed


def _parts(pieces: list[Surface], rng: Rng) -> tuple[Part, ...]:
    """The first and largest piece names the colour."""
    first, other = rng.choice(ROLES), rng.choice(ROLES)
    if len(pieces) == 1 or rng.bernoulli(ONE_ROLE_SHARE):
        return (Part(role=first, surface=merged(*pieces)),)
    count = rng.integer(1, len(pieces) - 1)
    groups = ((first, pieces[:count]), (other, pieces[count:]))
    return tuple(Part(role=role, surface=merged(*group)) for role, group in groups)


def _superquadric(rng: Rng) -> Surface:
    return superquadric((rng.log_uniform(0.2, 1.8), rng.log_uniform(0.2, 1.8)), 18)


def _box(rng: Rng) -> Surface:
    return box((1.0, 1.0, 1.0), rng.uniform(0.02, 0.15))


def _prism(rng: Rng) -> Surface:
    """Three to ten sides; a pyramid where the top is small."""
    top = rng.uniform(0.05, 1.0)
    corners = [(0.0, 1.0), (top, 1.0), (1.0, 0.0), (0.0, 0.0)]
    sides = [[corners[k], corners[k + 1]] for k in range(3)]
    return revolved(sides, rng.integer(3, 10))


def _turned_body(rng: Rng) -> Surface:
    """A smooth random profile, as from a lathe."""
    heights = np.linspace(1.0, 0.0, rng.integer(3, 6))
    knots = [(rng.log_uniform(0.15, 1.0), float(height)) for height in heights]
    side = smooth_profile(knots, 4)
    return revolved([[(0.0, 1.0), side[0]], side, [side[-1], (0.0, 0.0)]], 16)


def _slab(rng: Rng) -> Surface:
    """A random outline around its middle, cut from a board."""
    count = rng.integer(4, 12)
    angle = (np.arange(count) + rng.uniform_array(0.0, 0.6, count)) * (2 * np.pi / count)
    radius = rng.uniform_array(0.35, 1.0, count)
    outline = np.stack([radius * np.cos(angle), radius * np.sin(angle)], -1)
    return extruded(outline, rng.uniform(0.2, 0.8), 0.04)


def _ring(rng: Rng) -> Surface:
    minor = rng.uniform(0.08, 0.3)
    return torus(1.0 - minor, minor, (24, 10))


def _lump(rng: Rng) -> Surface:
    return lump(rng, roughness=rng.uniform(0.0, 0.4), level=2, frequency=rng.uniform(0.3, 0.9))


def _tube(rng: Rng) -> Surface:
    """A bar along a quarter of a circle or less."""
    angle = np.linspace(0.0, rng.uniform(0.3, 1.6), 10)
    path = np.stack([np.sin(angle), 1.0 - np.cos(angle), np.zeros(10)], -1)
    return tube(path, np.full(10, rng.uniform(0.08, 0.3)), 10)


def _pipe(rng: Rng) -> Surface:
    """Open at both ends."""
    inner, narrow = 1.0 - rng.log_uniform(*WALL_SHARES), rng.uniform(0.6, 1.0)
    corners = [(narrow, 1.0), (1.0, 0.0), (inner, 0.0), (inner * narrow, 1.0), (narrow, 1.0)]
    return revolved([list(pair) for pair in pairwise(corners)], 20)


def _vessel(rng: Rng) -> Surface:
    """Open at the top, with a floor: a bowl, a cup or a bucket."""
    heights = np.linspace(1.0, 0.0, rng.integer(2, 4))
    knots = [(rng.log_uniform(0.5, 1.0), float(height)) for height in heights]
    wall = 1.0 - rng.log_uniform(*WALL_SHARES)
    outer = smooth_profile(knots, 3)
    inner = [(wall * radius, height) for radius, height in outer if height > 1.0 - wall]
    foot, floor = [outer[-1], (0.0, 0.0)], [(0.0, inner[-1][1]), inner[-1]]
    return revolved([outer, foot, floor, inner[::-1], [inner[0], outer[0]]], 16)


PRIMITIVES: tuple[Callable[[Rng], Surface], ...] = (
    _superquadric,
    _box,
    _prism,
    _turned_body,
    _slab,
    _ring,
    _lump,
    _tube,
    _pipe,
    _vessel,
)
