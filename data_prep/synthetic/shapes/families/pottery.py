"""Objects from a potter's wheel or a lathe: vases, bowls, bottles, lamps, mugs, pillars."""

from itertools import pairwise

import numpy as np

from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import Shape, one, several
from diff4splat.data_prep.synthetic.shapes.surfaces.revolve import (
    arc,
    ball,
    revolved,
    rod,
    smooth_profile,
)
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import merged
from diff4splat.data_prep.synthetic.shapes.surfaces.sweep import tube


def make_vase(rng: Rng) -> Shape:
    """A vase, open at the top."""
    belly, neck, lip = rng.uniform(0.2, 0.36), rng.uniform(0.09, 0.16), rng.uniform(0.12, 0.2)
    foot, low = rng.uniform(0.1, 0.18), rng.uniform(0.25, 0.5)
    outer = smooth_profile([(lip, 1.0), (neck, 0.84), (belly, low), (foot, 0.0)], 8)
    inner = smooth_profile([(0.0, 0.7), (0.85 * neck, 0.8), (lip - 0.02, 1.0)], 5)
    return one(
        "ceramic", revolved([inner, [inner[-1], outer[0]], outer, [outer[-1], (0.0, 0.0)]], 30)
    )


def make_bowl(rng: Rng) -> Shape:
    """A bowl with a foot."""
    width, foot = rng.uniform(0.8, 1.3), rng.uniform(0.3, 0.5)
    outer = smooth_profile([(width, 1.0), (0.86 * width, 0.5), (foot, 0.12), (foot, 0.0)], 6)
    inner = smooth_profile([(0.0, 0.16), (0.55 * width, 0.3), (width - 0.06, 1.0)], 6)
    return one(
        "ceramic", revolved([inner, [inner[-1], outer[0]], outer, [outer[-1], (0.0, 0.0)]], 30)
    )


def make_bottle(rng: Rng) -> Shape:
    """A bottle with a stopper."""
    body, neck = rng.uniform(0.14, 0.2), rng.uniform(0.045, 0.065)
    shoulder = rng.uniform(0.5, 0.68)
    side = smooth_profile(
        [(neck, 0.92), (neck, shoulder + 0.14), (body, shoulder), (body, 0.02)], 7
    )
    glass = revolved([[(0.0, 0.92), side[0]], side, [side[-1], (0.0, 0.0)]], 24)
    return several(glass=glass, wood=rod(0.85 * neck, 0.1, bevel=0.01).at(y=-0.9))


def make_lamp(rng: Rng) -> Shape:
    """A table lamp: turned foot and cloth shade."""
    wide, narrow = rng.uniform(0.28, 0.38), rng.uniform(0.14, 0.24)
    foot = smooth_profile(
        [(0.03, 0.62), (0.04, 0.5), (rng.uniform(0.09, 0.16), 0.25), (0.06, 0.08), (0.16, 0.04)],
        6,
    )
    stand = revolved(
        [[(0.0, 0.62), foot[0]], foot, [foot[-1], (0.16, 0.0)], [(0.16, 0.0), (0.0, 0.0)]]
    )
    shade = revolved(
        [
            [(0.0, 0.98), (narrow - 0.01, 0.98), (narrow, 1.0)],
            [(narrow, 1.0), (wide, 0.58)],
            [(wide, 0.58), (wide - 0.015, 0.585), (0.0, 0.66)],
        ],
        28,
    )
    return several(shade=shade, ceramic=stand)


def make_mug(rng: Rng) -> Shape:
    """A mug with a handle."""
    radius = rng.uniform(0.38, 0.48)
    side = [(radius, 1.0), (radius, 0.06)]
    inside = [(0.0, 0.14), (radius - 0.06, 0.14), (radius - 0.06, 1.0)]
    body = revolved(
        [
            inside[:2],
            inside[1:],
            [inside[-1], side[0]],
            side,
            [side[-1], (radius - 0.05, 0.0)],
            [(radius - 0.05, 0.0), (0.0, 0.0)],
        ],
        28,
    )
    bend = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 9)
    path = np.stack(
        [radius - 0.02 + 0.26 * np.cos(bend), -0.52 + 0.27 * np.sin(bend), 0 * bend], -1
    )
    return one("ceramic", merged(body, tube(path, np.full(9, 0.055), 8)))


def make_barrel(rng: Rng) -> Shape:
    """A barrel with hoops."""
    belly = rng.uniform(0.38, 0.46)
    rim = 0.8 * belly
    side = smooth_profile([(rim, 1.0), (belly, 0.5), (rim, 0.0)], 7)
    hoops = [
        _hoop(rim + 0.012 + (belly - rim) * (1 - (2 * h - 1) ** 2), h)
        for h in (0.12, 0.3, 0.7, 0.88)
    ]
    body = revolved(
        [
            [(0.0, 0.95), (rim - 0.03, 0.95)],
            [(rim - 0.03, 0.95), (rim - 0.03, 1.0), side[0]],
            side,
            [side[-1], (0.0, 0.0)],
        ],
        28,
    )
    return several(staves=body, metal=merged(*hoops))


def _hoop(radius: float, height: float):
    low, high = height - 0.025, height + 0.025
    return revolved(
        [
            [(0.0, high), (radius, high)],
            [(radius, high), (radius, low)],
            [(radius, low), (0.0, low)],
        ],
        28,
    )


def make_pillar(rng: Rng) -> Shape:
    """A column with base and capital."""
    radius = rng.uniform(0.08, 0.12)
    wide = 1.45 * radius
    points = [
        (wide, 1.0),
        (wide, 0.95),
        (1.1 * radius, 0.92),
        (0.88 * radius, 0.9),
        (radius, 0.12),
        (1.2 * radius, 0.09),
        (wide, 0.06),
        (wide, 0.0),
    ]
    runs = [[a, b] for a, b in pairwise(points)]
    return one("stone", revolved([[(0.0, 1.0), points[0]], *runs, [points[-1], (0.0, 0.0)]], 26))


def make_mushroom(rng: Rng) -> Shape:
    """A toadstool."""
    wide = rng.uniform(0.36, 0.55)
    cap = smooth_profile([(0.0, 1.0), (0.6 * wide, 0.93), (wide, 0.66), (0.9 * wide, 0.6)], 7)
    under = [cap[-1], (0.12, 0.64), (0.0, 0.64)]
    stem = smooth_profile([(0.1, 0.66), (0.09, 0.3), (0.14, 0.0)], 6)
    stalk = revolved([[(0.0, 0.66), stem[0]], stem, [stem[-1], (0.0, 0.0)]], 18)
    return several(cap=revolved([cap, under], 28), plaster=stalk)


def make_balloon(rng: Rng) -> Shape:
    """A balloon on a string."""
    fat = rng.uniform(0.26, 0.32)
    body = smooth_profile(
        [(0.0, 1.0), (0.75 * fat, 0.94), (fat, 0.74), (0.55 * fat, 0.5), (0.02, 0.4)], 8
    )
    skin = revolved([body, [body[-1], (0.035, 0.375), (0.0, 0.375)]], 28)
    height = np.linspace(0.0, 0.4, 14)
    string = np.stack([0.02 * np.sin(22 * height), -height, 0.02 * np.cos(17 * height)], -1)
    return several(toy=skin, plaster=tube(string, np.full(14, 0.006), 5))


def make_lantern(rng: Rng) -> Shape:
    """A street lamp: post, arm ring and glass head."""
    post = rod(0.018, 0.86, segments=10)
    foot = revolved(
        [
            smooth_profile([(0.0, 0.12), (0.022, 0.12), (0.05, 0.03), (0.055, 0.0)], 5),
            [(0.055, 0.0), (0.0, 0.0)],
        ],
        14,
    )
    wide = rng.uniform(0.055, 0.08)
    hat = revolved(
        [[(0.0, 1.0), (0.015, 0.985), (1.25 * wide, 0.955)], [(1.25 * wide, 0.955), (0.0, 0.95)]],
        14,
    )
    return several(
        metal=merged(post, foot, hat), shade=ball(wide, 16).at(y=-0.955 + 2 * wide - 0.01)
    )


def make_stool(rng: Rng) -> Shape:
    """A round stool with splayed legs."""
    radius = rng.uniform(0.3, 0.42)
    seat = rod(radius, 0.1, bevel=0.025, segments=26).at(y=-0.9)
    legs = []
    for k in range(4):
        angle = np.pi * (0.25 + 0.5 * k)
        side = np.array([np.cos(angle), 0.0, np.sin(angle)])
        path = np.stack([0.6 * radius * side + [0, -0.92, 0], 0.98 * radius * side])
        legs.append(tube(path, np.array([0.045, 0.035]), 8))
    return several(wood=merged(seat, *legs))


def make_pumpkin(rng: Rng) -> Shape:
    """A pumpkin: a flattened ball with ribs."""
    ribs = rng.integer(8, 12)
    body = revolved([arc((0.0, 0.45), 0.45, (90.0, -90.0), 13)], 6 * ribs)
    angle = np.arctan2(body.vertices[:, 2], body.vertices[:, 0])
    rib = 1.0 - 0.09 * np.abs(np.sin(0.5 * ribs * angle)) ** 0.5
    rib = 1.1 * (1.0 - 0.12 * np.abs(np.cos(0.5 * ribs * angle)) ** 3) * rib
    dent = 1.0 - 0.12 * np.exp(-((body.vertices[:, 0] ** 2 + body.vertices[:, 2] ** 2) / 0.02))
    shaped = body.stretched()
    shaped.vertices[:, [0, 2]] *= rib[:, None] * rng.uniform(1.0, 1.3)
    shaped.vertices[:, 1] = -0.45 + (shaped.vertices[:, 1] + 0.45) * dent
    stalk = np.array([[0.0, -0.82, 0.0], [0.02, -0.92, 0.0], [0.07, -1.0, 0.02]])
    return several(pumpkin=shaped, bark=tube(stalk, np.array([0.07, 0.045, 0.04]), 8))
