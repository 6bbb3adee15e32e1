"""Slabs cut from an outline: stars, gears, hearts and letters that stand upright."""

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import Shape, one
from diff4splat.data_prep.synthetic.shapes.surfaces.facets import extruded

_LETTERS = {
    "L": [(0, 0), (0.6, 0), (0.6, 0.2), (0.22, 0.2), (0.22, 1), (0, 1)],
    "T": [(0.27, 0), (0.49, 0), (0.49, 0.8), (0.76, 0.8), (0.76, 1), (0, 1), (0, 0.8), (0.27, 0.8)],
    "H": [
        (0, 0),
        (0.22, 0),
        (0.22, 0.4),
        (0.52, 0.4),
        (0.52, 0),
        (0.74, 0),
        (0.74, 1),
        (0.52, 1),
        (0.52, 0.6),
        (0.22, 0.6),
        (0.22, 1),
        (0, 1),
    ],
    "E": [
        (0, 0),
        (0.62, 0),
        (0.62, 0.19),
        (0.22, 0.19),
        (0.22, 0.41),
        (0.54, 0.41),
        (0.54, 0.6),
        (0.22, 0.6),
        (0.22, 0.81),
        (0.62, 0.81),
        (0.62, 1),
        (0, 1),
    ],
    "Z": [
        (0, 0),
        (0.72, 0),
        (0.72, 0.2),
        (0.28, 0.2),
        (0.72, 0.82),
        (0.72, 1),
        (0, 1),
        (0, 0.8),
        (0.42, 0.8),
        (0, 0.2),
    ],
    "U": [(0, 0), (0.74, 0), (0.74, 1), (0.52, 1), (0.52, 0.22), (0.22, 0.22), (0.22, 1), (0, 1)],
}


def _star(points: int, inner: float) -> Float64[np.ndarray, "n 2"]:
    angle = np.pi / 2 + np.arange(2 * points) * (np.pi / points)
    radius = np.where(np.arange(2 * points) % 2 == 0, 1.0, inner)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], -1)


def make_star(rng: Rng) -> Shape:
    """A star with 5 to 7 points."""
    outline = _star(rng.integer(5, 7), rng.uniform(0.45, 0.6))
    return one("toy", extruded(outline, rng.uniform(0.35, 0.6), 0.06))


def make_gear(rng: Rng) -> Shape:
    """A gear wheel."""
    teeth = rng.integer(8, 12)
    step = np.pi / teeth
    angle = np.concatenate(
        [(2 * k * step + np.array([-0.55, -0.35, 0.35, 0.55]) * step) for k in range(teeth)]
    )
    radius = np.tile([0.8, 1.0, 1.0, 0.8], teeth)
    outline = np.stack([radius * np.cos(angle), radius * np.sin(angle)], -1)
    return one("metal", extruded(outline, rng.uniform(0.3, 0.5), 0.04))


def make_heart(rng: Rng) -> Shape:
    """A heart."""
    angle = np.linspace(0, 2 * np.pi, 28, endpoint=False)
    x = np.sin(angle) ** 3
    height = (
        13 * np.cos(angle) - 5 * np.cos(2 * angle) - 2 * np.cos(3 * angle) - np.cos(4 * angle)
    ) / 16
    outline = np.stack([x, height], -1)[::-1]
    return one("toy", extruded(np.ascontiguousarray(outline), rng.uniform(0.4, 0.7), 0.08))


def make_letter(rng: Rng) -> Shape:
    """A capital letter."""
    outline = np.array(_LETTERS[rng.choice(sorted(_LETTERS))], np.float64)
    return one("toy", extruded(outline, rng.uniform(0.2, 0.4), 0.03))
