"""People of plain pieces: whole figures, and their upper halves as in a portrait.

A figure of height 1 looks to +x, its left is at −z. A network that never sees people takes a dark
suit before a dark wall for the wall.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import Part, Shape
from diff4splat.data_prep.synthetic.shapes.surfaces.facets import box
from diff4splat.data_prep.synthetic.shapes.surfaces.revolve import (
    ball,
    revolved,
    rod,
    smooth_profile,
)
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import (
    Surface,
    about_y,
    about_z,
    merged,
)
from diff4splat.data_prep.synthetic.shapes.surfaces.sweep import tube

PORTRAIT_SHARE, HAT_SHARE, SKIRT_SHARE, TIE_SHARE = 0.6, 0.3, 0.3, 0.4
CLOTHES = ("cloth", "accent", "rubber", "painted", "coat")
SKINS, HAIRS = ("fur", "plaster", "wood"), ("fur", "rubber", "bark")
CHIN, SHOULDER, HIP, KNEE, ANKLE = 0.86, 0.81, 0.5, 0.27, 0.04
"""Heights."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Build:
    """Proportions of one figure."""

    wide: float
    """Over the usual width of shoulders and hips."""
    head: float
    """Over the usual size."""
    lean_rad: float
    turn_rad: float
    """Of the head about the vertical."""

    @staticmethod
    def of(rng: Rng) -> "Build":
        """A random one, from a child to an adult."""
        return Build(
            wide=rng.uniform(0.8, 1.4),
            head=rng.uniform(0.9, 1.4),
            lean_rad=rng.uniform(-0.2, 0.2),
            turn_rad=rng.uniform(-0.9, 0.9),
        )


def make_person(rng: Rng) -> Shape:
    """A standing figure in clothes, with hair, often with a hat, or the half above the hips."""
    build = Build.of(rng.child("build"))
    skin, hair = _head(build, rng.child("head"))
    hands, sleeves = _arms(build, rng.child("arms"))
    roles = rng.child("roles")
    pieces = [
        (roles.choice(CLOTHES), merged(_torso(build), *sleeves)),
        (roles.choice(SKINS), merged(skin, hands)),
        (roles.choice(HAIRS), hair),
    ]
    if roles.bernoulli(TIE_SHARE):
        pieces.append((roles.choice(CLOTHES), _tie(build)))
    pieces = [(role, _leaning(piece, build)) for role, piece in pieces]
    if not roles.bernoulli(PORTRAIT_SHARE):
        pieces.append((roles.choice(CLOTHES), _legs(build, rng.child("legs"))))
    parts = tuple(Part(role=role, surface=piece) for role, piece in pieces)
    return Shape(parts=parts).of_height(1.0)


def _leaning(piece: Surface, build: Build) -> Surface:
    """Turned at the hips."""
    return piece.at(y=HIP).turned(about_z(build.lean_rad)).at(y=-HIP)


def _torso(build: Build) -> Surface:
    knots = [(0.05, 0.85), (0.105, 0.815), (0.122, 0.73), (0.1, 0.62), (0.118, 0.52), (0.1, 0.46)]
    side = smooth_profile([(build.wide * radius, height) for radius, height in knots], 4)
    ends = [(0.0, side[0][1]), side[0]], [side[-1], (0.0, side[-1][1])]
    return revolved([ends[0], side, ends[1]], 20).stretched(x=0.62)


def _tie(build: Build) -> Surface:
    return box((0.02, 0.2, 0.035), 0.005).at(x=0.068 * build.wide, y=-0.6)


def _head(build: Build, rng: Rng) -> tuple[Surface, Surface]:
    """Skin of head and neck, and hair with a hat, turned about the neck."""
    turn, size = about_y(build.turn_rad), build.head
    skull = ball(0.075 * size, 18).stretched(x=0.88, z=0.74)
    nose = ball(0.014 * size, 8).stretched(y=1.4).at(x=0.066 * size, y=-0.055 * size)
    skin = merged(skull, nose).turned(turn).at(y=-CHIN)
    neck = rod(0.036 * build.wide, 0.09, segments=12).at(y=-0.8)
    return merged(skin, neck), _hair(size, rng).turned(turn).at(y=-CHIN)


def _hair(size: float, rng: Rng) -> Surface:
    """Over the back and the top of the head, long or short, under a hat."""
    back = rng.uniform(0.012, 0.03)
    long = rng.uniform(1.0, 1.8)
    cap = ball(0.081 * size, 16).stretched(x=0.88, y=long, z=rng.uniform(0.78, 1.0))
    pieces = [cap.at(x=-back * size, y=0.162 * size * (long - 1.0) - 0.012 * size)]
    if rng.bernoulli(HAT_SHARE):
        crown = rod(rng.uniform(0.06, 0.075) * size, rng.uniform(0.04, 0.09), bevel=0.01)
        brim = rod(rng.uniform(0.08, 0.14) * size, 0.012)
        pieces += [merged(crown, brim).at(y=-0.125 * size)]
    return merged(*pieces)


def _arms(build: Build, rng: Rng) -> tuple[Surface, list[Surface]]:
    """Hands, and sleeves; each arm hangs, or is bent before the body."""
    hands, sleeves = [], []
    for side in (-1, 1):
        child = rng.child("left" if side < 0 else "right")
        path = _arm_path(side * 0.125 * build.wide, side, child)
        sleeves.append(tube(path, np.array([0.026, 0.042, 0.034, 0.027, 0.024]) * build.wide, 10))
        hands.append(ball(0.03, 10).at(*(path[-1] + np.array([0.0, 0.03, 0.0])).tolist()))
    return merged(*hands), sleeves


def _arm_path(z: float, side: int, rng: Rng) -> Float64[np.ndarray, "5 3"]:
    """From the shoulder over the elbow to the wrist."""
    out, forward = rng.uniform(0.0, 0.6), rng.uniform(-0.3, 0.8)
    upper = np.array([np.sin(forward), np.cos(forward), side * np.sin(out)])
    elbow = np.array([0.0, -SHOULDER + 0.02, z]) + 0.17 * upper / np.linalg.norm(upper)
    bend, inward = forward + rng.uniform(0.0, 2.2), rng.uniform(-0.9, 0.3)
    lower = np.array([np.sin(bend), np.cos(bend), side * np.sin(inward)])
    wrist = elbow + 0.16 * lower / np.linalg.norm(lower)
    shoulder = np.array([0.0, -SHOULDER + 0.015, 0.8 * z])
    return np.array(
        [shoulder, 0.5 * (shoulder + elbow), elbow, 0.5 * (elbow + wrist), wrist]
    )  # fmt: skip


def _legs(build: Build, rng: Rng) -> Surface:
    """Legs with shoes, or a skirt over them."""
    wide, pieces = build.wide, []
    for side in (-1, 1):
        stride = side * rng.uniform(-0.12, 0.12)
        path = np.array(
            [[0.0, -HIP, 0.055 * side * wide], [0.5 * stride + 0.01, -KNEE, 0.06 * side * wide],
             [stride, -ANKLE, 0.06 * side * wide]]
        )  # fmt: skip
        pieces.append(tube(path, np.array([0.066, 0.05, 0.034]) * wide, 12))
        shoe = ball(0.035, 10).stretched(x=1.8).at(x=stride + 0.03)
        pieces.append(shoe.at(z=0.06 * side * wide))
    if rng.bernoulli(SKIRT_SHARE):
        hem = (rng.uniform(0.12, 0.24) * wide, rng.uniform(0.08, 0.35))
        waist = (0.09 * wide, 0.6)
        sides = [[(0.0, 0.6), waist], [waist, hem], [hem, (0.0, hem[1])]]
        pieces.append(revolved(sides, 20).stretched(x=0.75))
    return merged(*pieces)
