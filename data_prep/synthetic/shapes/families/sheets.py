"""Cloth: flags on poles, towels on a line, banners. The cloth hangs still; motions make it wave."""

import numpy as np

from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import Shape, several
from diff4splat.data_prep.synthetic.shapes.surfaces.revolve import ball, rod
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import (
    Surface,
    both_sides,
    grid_triangles,
    merged,
    surface,
)
from diff4splat.data_prep.synthetic.shapes.surfaces.sweep import tube


def cloth(width: float, height: float, steps: tuple[int, int] = (22, 14)) -> Surface:
    """An upright sheet in the plane z = 0, seen from both sides: x from 0, y from −height to 0."""
    x, y = np.meshgrid(np.linspace(0, width, steps[0]), np.linspace(-height, 0, steps[1]))
    ripple = 0.02 * height * np.sin(9.0 * x / width + 2.0 * y / height)
    vertices = np.stack([x, y, ripple], -1).reshape(-1, 3)
    sheet = surface(vertices, grid_triangles(steps[1], steps[0]), vertices[:, :2].copy())
    return both_sides(sheet, 0.006 * height)


def make_flag(rng: Rng) -> Shape:
    """A flag on a pole."""
    high, long = rng.uniform(0.26, 0.36), rng.uniform(0.45, 0.65)
    pole = merged(rod(0.014, 0.985, segments=10), ball(0.024, 12).at(y=-0.952))
    return several(cloth=cloth(long, high).at(x=0.014, y=high - 0.97), metal=pole)


def make_towel(rng: Rng) -> Shape:
    """A towel on a line between two posts."""
    wide, long = rng.uniform(0.34, 0.48), rng.uniform(0.54, 0.74)
    span = 1.3 * wide
    posts = [rod(0.022, 1.0, segments=8).at(x=side * span / 2) for side in (-1, 1)]
    line = tube(np.array([[-span / 2, -0.95, 0.0], [span / 2, -0.95, 0.0]]), np.full(2, 0.007), 6)
    return several(
        cloth=cloth(wide, long, (18, 20)).at(-wide / 2, long - 0.945), wood=merged(*posts, line)
    )


def make_banner(rng: Rng) -> Shape:
    """A long banner that hangs from an arm."""
    wide, long = rng.uniform(0.2, 0.3), rng.uniform(0.55, 0.7)
    mast = rod(0.016, 1.0, segments=10)
    arm = tube(np.array([[0.0, -0.94, 0.0], [wide + 0.05, -0.94, 0.0]]), np.full(2, 0.01), 8)
    foot = rod(0.12, 0.03, bevel=0.01, segments=16)
    sheet = cloth(wide, long, (12, 26)).at(0.03, long - 0.94)
    return several(cloth=sheet, metal=merged(mast, arm, foot))
