"""Furniture: tables, chairs, benches, shelves, sofas and steps."""

import numpy as np

from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import Shape, one, several
from diff4splat.data_prep.synthetic.shapes.surfaces.facets import box, boxes
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import about_z, merged


def _legs(width: float, depth: float, height: float, thick: float):
    x, z = 0.5 * width - thick, 0.5 * depth - thick
    corners = [(a * x, 0.0, b * z) for a in (-1, 1) for b in (-1, 1)]
    return [((thick, height, thick), corner) for corner in corners]


def make_table(rng: Rng) -> Shape:
    """A table with an apron."""
    width, depth = rng.uniform(1.3, 2.2), rng.uniform(0.9, 1.3)
    thick = rng.uniform(0.07, 0.11)
    top = ((width, 0.06, depth), (0.0, -0.94, 0.0))
    apron = ((width - 0.2, 0.1, depth - 0.2), (0.0, -0.84, 0.0))
    return one("wood", boxes([top, apron, *_legs(width - 0.1, depth - 0.1, 0.94, thick)], 0.012))


def make_chair(rng: Rng) -> Shape:
    """A chair that faces +x."""
    seat, wide = rng.uniform(0.46, 0.52), rng.uniform(0.46, 0.54)
    posts = [
        ((0.05, 1.0 - seat, 0.05), (0.025 - wide / 2, -seat, s * (wide / 2 - 0.03)))
        for s in (-1, 1)
    ]
    count = rng.integer(2, 4)
    slats = [
        (
            (0.03, 0.07, wide - 0.1),
            (0.025 - wide / 2, -seat - 0.12 - (0.86 - seat) * k / count, 0.0),
        )
        for k in range(count)
    ]
    slab = ((wide, 0.05, wide), (0.0, -seat + 0.05, 0.0))
    return one("wood", boxes([slab, *_legs(wide, wide, seat - 0.05, 0.05), *posts, *slats], 0.01))


def make_bench(rng: Rng) -> Shape:
    """A garden bench of planks."""
    long = rng.uniform(1.6, 2.4)
    seat = [((0.14, 0.05, long), (x, -0.5, 0.0)) for x in (-0.17, 0.0, 0.17)]
    back = [((0.05, 0.14, long), (-0.3, y, 0.0)) for y in (-0.64, -0.84)]
    ends = [((0.07, 1.0, 0.08), (-0.35, 0.0, s * 0.42 * long)) for s in (-1, 1)]
    ends += [((0.07, 0.5, 0.08), (0.2, 0.0, s * 0.42 * long)) for s in (-1, 1)]
    return several(wood=boxes([*seat, *back], 0.012), metal=boxes(ends, 0.01))


def make_shelf(rng: Rng) -> Shape:
    """A bookcase with books; its front is +x."""
    wide, deep, levels = rng.uniform(0.45, 0.8), 0.2, rng.integer(3, 5)
    sides = [((deep, 1.0, 0.025), (0.0, 0.0, s * wide / 2)) for s in (-1, 1)]
    gap = 0.96 / levels
    boards = [((deep, 0.022, wide), (0.0, -gap * k, 0.0)) for k in range(levels + 1)]
    back = ((0.012, 0.98, wide), (-deep / 2, 0.0, 0.0))
    stacks: tuple[list, list] = ([], [])
    for level in range(levels):
        place = -0.46 * wide
        while place < rng.uniform(0.1, 0.42) * wide:
            thick, tall = rng.uniform(0.028, 0.055), gap * rng.uniform(0.55, 0.85)
            stacks[rng.integer(0, 1)].append(
                ((0.13, tall, thick), (0.01, -gap * level - 0.022, place + thick / 2))
            )
            place += thick + 0.002
    case = boxes([*sides, *boards, back], 0.004)
    books = {
        role: boxes(stack, 0.003)
        for role, stack in zip(("book", "accent"), stacks, strict=True)
        if stack
    }
    return several(wood=case, **books)


def make_sofa(rng: Rng) -> Shape:
    """A sofa that faces +x."""
    long = rng.uniform(1.7, 2.5)
    base = box((0.95, 0.3, long), 0.05).at(y=-0.1)
    back = box((0.26, 0.72, long), 0.09).turned(about_z(-0.1)).at(x=-0.38, y=-0.3)
    arms = [box((0.95, 0.62, 0.2), 0.07).at(0.0, -0.08, s * (long / 2)) for s in (-1, 1)]
    count = rng.integer(2, 3)
    width = (long - 0.25) / count
    seats = [
        box((0.72, 0.17, width - 0.03), 0.06).at(0.1, -0.4, (k - (count - 1) / 2) * width)
        for k in range(count)
    ]
    feet = boxes(
        [((0.07, 0.1, 0.07), (x, 0.0, z)) for x in (-0.38, 0.38) for z in (-long / 2, long / 2)]
    )
    return several(cloth=merged(base, back, *arms, *seats), wood=feet)


def make_steps(rng: Rng) -> Shape:
    """A few stone steps that rise towards −x."""
    count, wide = rng.integer(3, 5), rng.uniform(1.6, 2.6)
    treads = [
        ((0.5, 1.0 / count * (k + 1), wide), (0.5 * ((count - 1) / 2 - k), 0.0, 0.0))
        for k in range(count)
    ]
    return one("block", boxes(treads, 0.02))


def make_books(rng: Rng) -> Shape:
    """A stack of books, none quite straight."""
    count = rng.integer(3, 5)
    pieces: tuple[list, list] = ([], [])
    for k in range(count):
        turn = rng.uniform(-0.25, 0.25)
        c, s = np.cos(turn), np.sin(turn)
        rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        book = box((rng.uniform(1.4, 1.9), 0.97 / count, rng.uniform(1.0, 1.3)), 0.02)
        pieces[k % 2].append(book.turned(rotation).at(y=-k / count))
    return several(book=merged(*pieces[0]), accent=merged(*pieces[1]))
