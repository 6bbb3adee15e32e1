"""Buildings and what stands around them: houses, towers, arches, fences, walls, windmills."""

import numpy as np

from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import Joint, Part, Shape, one, several
from diff4splat.data_prep.synthetic.shapes.surfaces.facets import box, boxes, extruded, faceted
from diff4splat.data_prep.synthetic.shapes.surfaces.revolve import revolved
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import Surface, about_y, about_z, merged


def _gable(depth: float, width: float, rise: float, over: float) -> Surface:
    """A roof with its ridge along z, standing on y = 0."""
    x, z, lift = 0.5 * depth + over, 0.5 * width + over, 0.05
    slope = rise / (0.5 * depth)
    low = over * slope
    profile = [
        (-x, low),
        (0.0, -rise),
        (x, low),
        (x, low - lift),
        (0.0, -rise - lift),
        (-x, low - lift),
    ]
    points = np.array([(a, y, s * z) for s in (-1, 1) for a, y in profile])
    n = len(profile)
    around = [[k, (k + 1) % n, n + (k + 1) % n, n + k] for k in range(n)]
    left, right = [[0, 1, 4, 5], [1, 2, 3, 4]], [[6, 7, 10, 11], [7, 8, 9, 10]]
    ends = [face[::-1] for face in left] + right
    return faceted(points, [*around, *ends])


def _openings(rng: Rng, size: tuple[float, float, float], floors: int):
    """Window frames, panes and a door on the front (+x) and both sides."""
    depth, height, width = size
    frames, panes = [], []
    count = max(2, round(width / 0.42))
    tall = 0.42 * height / floors
    wide = 0.62 * tall
    door = rng.integer(0, count - 1)
    for floor in range(floors):
        sill = -height * (floor + 0.34) / floors
        for k in range(count):
            z = (k + 0.5) / count * width - width / 2
            if floor == 0 and k == door:
                panes.append(((0.03, 0.72 * height / floors, 1.2 * wide), (depth / 2, 0.0, z)))
                continue
            frames.append(((0.05, tall + 0.05, wide + 0.05), (depth / 2, sill + 0.025, z)))
            panes.append(((0.065, tall, wide), (depth / 2, sill, z)))
        for x in (-0.22 * depth, 0.22 * depth):
            for s in (-1, 1):
                frames.append(((wide + 0.05, tall + 0.05, 0.05), (x, sill + 0.025, s * width / 2)))
                panes.append(((wide, tall, 0.065), (x, sill, s * width / 2)))
    return boxes(frames, 0.006), boxes(panes, 0.004)


def make_house(rng: Rng) -> Shape:
    """A house with a gable roof, windows, a door and a chimney; its front is +x."""
    depth, width, rise = rng.uniform(0.7, 1.0), rng.uniform(0.9, 1.6), rng.uniform(0.3, 0.45)
    floors = rng.integer(1, 2)
    frames, panes = _openings(rng, (depth, 0.64, width), floors)
    triangle = np.array([(-depth / 2, 0.0), (depth / 2, 0.0), (0.0, rise)])
    attic = extruded(triangle, width, 0.002).at(y=-0.63)
    chimney = box((0.1, 0.3, 0.1), 0.01).at(-0.2 * depth, -0.64 - 0.45 * rise, 0.25 * width)
    walls = merged(box((depth, 0.64, width), 0.006), attic)
    roof = _gable(depth, width, rise, 0.07).at(y=-0.64)
    return several(facade=walls, roof=roof, plaster=frames, pane=panes, brick=chimney)


def make_tower(rng: Rng) -> Shape:
    """A round tower with a pointed roof and slits."""
    radius = rng.uniform(0.13, 0.19)
    wall = [(1.12 * radius, 0.72), (1.12 * radius, 0.66), (radius, 0.62), (radius, 0.0)]
    body = revolved(
        [[(0.0, 0.72), wall[0]], wall[:2], wall[1:3], wall[2:], [wall[-1], (0.0, 0.0)]], 26
    )
    eaves = 1.28 * radius
    hat = revolved([[(0.0, 1.0), (eaves, 0.7)], [(eaves, 0.7), (0.0, 0.7)]], 26)
    slits = [
        box((0.03, 0.07, 0.028), 0.004).at(x=radius).turned(about_y(a)).at(y=-h)
        for a in np.arange(4) * 1.6
        for h in (0.18, 0.4, 0.58)
    ]
    return several(block=body, roof=hat, pane=merged(*slits))


def make_block_of_flats(rng: Rng) -> Shape:
    """A tall plain building with rows of windows."""
    depth, width, floors = rng.uniform(0.5, 0.8), rng.uniform(0.5, 1.0), rng.integer(3, 5)
    frames, panes = _openings(rng, (depth, 0.96, width), floors)
    edge = boxes([((depth + 0.06, 0.05, width + 0.06), (0.0, -0.95, 0.0))], 0.01)
    return several(
        facade=box((depth, 0.97, width), 0.006), pane=panes, plaster=merged(frames, edge)
    )


def make_fence(rng: Rng) -> Shape:
    """A run of pickets along z."""
    count, gap = rng.integer(9, 13), rng.uniform(0.19, 0.26)
    long = gap * count
    pickets = [
        ((0.035, rng.uniform(0.92, 1.0), 0.62 * gap), (0.0, 0.0, gap * (k + 0.5) - long / 2))
        for k in range(count)
    ]
    rails = [((0.05, 0.09, long), (-0.045, -h, 0.0)) for h in (0.2, 0.68)]
    return one("fence", boxes([*pickets, *rails], 0.01))


def make_arch(rng: Rng) -> Shape:
    """An arch of stone; one walks through along x."""
    inner, thick = rng.uniform(0.24, 0.34), rng.uniform(0.13, 0.2)
    spring = 0.98 - inner - thick
    angle = np.linspace(0.0, np.pi, 13)
    outer = [
        ((inner + thick) * c, spring + (inner + thick) * s)
        for c, s in zip(np.cos(angle), np.sin(angle), strict=True)
    ]
    hollow = [
        (inner * c, spring + inner * s) for c, s in zip(np.cos(angle), np.sin(angle), strict=True)
    ]
    outline = np.array(
        [
            (inner, 0.0),
            (inner + thick, 0.0),
            *outer,
            (-inner - thick, 0.0),
            (-inner, 0.0),
            *hollow[::-1],
        ]
    )
    slab = extruded(outline, rng.uniform(0.2, 0.32), 0.012)
    return one("block", slab.turned(about_y(np.pi / 2)))


def make_wall(rng: Rng) -> Shape:
    """A low garden wall with a coping, along z."""
    long = rng.uniform(2.5, 4.5)
    body = box((0.3, 0.9, long), 0.01)
    return several(brick=body, block=box((0.4, 0.1, long + 0.08), 0.02).at(y=-0.9))


def make_windmill(rng: Rng) -> Shape:
    """A windmill whose sails turn about x."""
    del rng
    body = revolved(
        [[(0.0, 0.62), (0.1, 0.62)], [(0.1, 0.62), (0.16, 0.0)], [(0.16, 0.0), (0.0, 0.0)]], 24
    )
    cap = revolved([[(0.0, 0.74), (0.07, 0.7), (0.12, 0.62)], [(0.12, 0.62), (0.0, 0.62)]], 24)
    hub = (0.14, -0.66, 0.0)
    axle = box((0.08, 0.04, 0.04), 0.006).at(0.12, -0.64, 0.0)
    blades = []
    for k in range(4):
        spar = box((0.012, 0.34, 0.014), 0.002).at(z=0.0)
        vane = box((0.008, 0.27, 0.075), 0.002).at(y=-0.06, z=0.04)
        turn = about_y(np.pi / 2) @ about_z(0.5 * np.pi * k) @ about_y(-np.pi / 2)
        blades.append(merged(spar, vane).turned(turn).at(0.165, hub[1], 0.0))
    parts = (
        Part(role="facade", surface=body),
        Part(role="roof", surface=cap),
        Part(role="fence", surface=merged(axle, *blades).on_joint(1)),
    )
    return Shape(
        parts=parts, joints=(Joint(name="wheel", parent=0, pivot=hub, axis=(1.0, 0.0, 0.0)),)
    )
