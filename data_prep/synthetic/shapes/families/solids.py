"""Plain solids: boxes, balls, cans, cones, pills, rings and rounded blocks."""

from itertools import pairwise

import numpy as np

from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import Shape, one, several
from diff4splat.data_prep.synthetic.shapes.surfaces.facets import box, boxes
from diff4splat.data_prep.synthetic.shapes.surfaces.revolve import (
    arc,
    ball,
    revolved,
    rod,
    superquadric,
)
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import about_x, merged
from diff4splat.data_prep.synthetic.shapes.surfaces.sweep import torus


def make_box(rng: Rng) -> Shape:
    """A bevelled box, from a brick to a block."""
    size = (rng.uniform(0.7, 1.6), 1.0, rng.uniform(0.7, 1.4))
    return one("painted", box(size, rng.uniform(0.02, 0.09)))


def make_crate(rng: Rng) -> Shape:
    """A wooden crate: boards in a frame of battens."""
    width, depth = rng.uniform(0.9, 1.4), rng.uniform(0.9, 1.2)
    batten, thick = 0.11, 0.03
    posts = [
        ((batten, 1.0, batten), (x * (width - batten) / 2, 0.0, z * (depth - batten) / 2))
        for x in (-1, 1)
        for z in (-1, 1)
    ]
    rails = [
        ((width, batten, batten), (0.0, y, z * (depth - batten) / 2))
        for y in (0.0, batten - 1.0)
        for z in (-1, 1)
    ]
    inner = box((width - 2 * thick, 1 - 2 * thick, depth - 2 * thick), 0.01).at(y=-thick)
    return several(crate=inner, wood=boxes([*posts, *rails], 0.012))


def make_ball(rng: Rng) -> Shape:
    """A ball."""
    del rng
    return one("toy", ball(0.5, 28))


def make_can(rng: Rng) -> Shape:
    """An upright cylinder with broken edges."""
    return one("painted", rod(rng.uniform(0.28, 0.5), 1.0, bevel=0.04, segments=26))


def make_cone(rng: Rng) -> Shape:
    """A cone on a square foot, as on building sites, or a bare one."""
    radius = rng.uniform(0.32, 0.45)
    tip = arc((0.0, 0.94), 0.05, (90.0, 20.0), 4)
    body = revolved([[*tip, (radius, 0.04)], [(radius, 0.04), (0.0, 0.04)]], 26)
    foot = box((2.5 * radius, 0.06, 2.5 * radius), 0.015)
    return several(toy=body, rubber=foot)


def make_capsule(rng: Rng) -> Shape:
    """A lying pill with its axis along z."""
    half = rng.uniform(0.4, 0.9)
    profile = arc((0.0, half), 0.5, (90.0, 0.0), 7) + arc((0.0, -half), 0.5, (0.0, -90.0), 7)
    body = revolved([profile], 24).turned(about_x(np.pi / 2)).at(y=-0.5)
    return one("painted", body)


def make_ring(rng: Rng) -> Shape:
    """A torus that stands like a wheel."""
    minor = rng.uniform(0.1, 0.17)
    return one("toy", torus(0.5 - minor, minor, (36, 14)))


def make_block(rng: Rng) -> Shape:
    """A superquadric between a box and a ball."""
    exponents = (rng.uniform(0.25, 0.8), rng.uniform(0.25, 0.8))
    wide = rng.uniform(0.9, 1.5)
    return one("painted", superquadric(exponents).stretched(wide, 1.0, rng.uniform(0.8, 1.3)))


def make_drum(rng: Rng) -> Shape:
    """A drum with hoops and pegs."""
    radius = rng.uniform(0.45, 0.7)
    shell = rod(radius, 0.92, segments=28).at(y=-0.04)
    hoop = [(radius, 0.1), (radius + 0.05, 0.1), (radius + 0.05, 0.0), (radius, 0.0)]
    band = [[(0.0, 0.1), hoop[0]], *([a, b] for a, b in pairwise(hoop))]
    hoops = revolved([*band, [hoop[-1], (0.0, 0.0)]], 28)
    return several(toy=shell, wood=merged(hoops, hoops.at(y=-0.9)))
