"""Animals with joints: quadrupeds, birds, fish; and cars, which have joints too."""

import numpy as np

from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import Joint, Part, Shape
from diff4splat.data_prep.synthetic.shapes.surfaces.facets import box, extruded
from diff4splat.data_prep.synthetic.shapes.surfaces.revolve import ball, rod
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import Surface, about_x, merged
from diff4splat.data_prep.synthetic.shapes.surfaces.sweep import tube


def make_quadruped(rng: Rng) -> Shape:
    """A four-legged animal that looks to +x, between a dog and a foal."""
    leg, long = rng.uniform(0.38, 0.56), rng.uniform(0.42, 0.55)
    fat, neck = rng.uniform(0.13, 0.19), rng.uniform(0.12, 0.3)
    back = -leg - fat * 0.8
    s = np.array([-1.12, -1.0, -0.6, 0.0, 0.6, 1.0, 1.15])
    thick = fat * np.array([0.25, 0.8, 1.0, 0.88, 1.02, 0.85, 0.3])
    spine = np.stack([long * s, back + 0.02 * np.cos(3 * s), 0 * s], -1)
    top = (long + 0.5 * neck, back - neck - 0.04)
    throat = np.array(
        [[0.8 * long, back, 0.0], [long + 0.25 * neck, back - 0.5 * neck, 0.0], [*top, 0.0]]
    )
    snout = np.array(
        [
            [top[0] - 0.09, top[1] - 0.02, 0],
            [top[0] + 0.02, top[1] - 0.03, 0],
            [top[0] + 0.13, top[1] + 0.02, 0],
            [top[0] + 0.23, top[1] + 0.06, 0],
        ]
    )
    head = merged(
        tube(throat, np.array([0.75, 0.55, 0.5]) * fat, 10),
        tube(snout, np.array([0.35, 0.65, 0.45, 0.3]) * fat * 1.1, 10),
        *(_ear(top, side, fat) for side in (-1, 1)),
    ).on_joint(5)
    tail = np.array(
        [
            [-1.05 * long, back - 0.03, 0],
            [-1.3 * long, back + 0.05, 0],
            [-1.38 * long, back + 0.24, 0],
        ]
    )
    hips = [(x * long, side) for x in (-0.78, 0.78) for side in (-1, 1)]
    legs = [
        _leg(x, side * 0.55 * fat, leg, fat).on_joint(k + 1) for k, (x, side) in enumerate(hips)
    ]
    skin = merged(
        tube(spine, thick, 14),
        head,
        tube(tail, np.array([0.3, 0.22, 0.1]) * fat, 7).on_joint(6),
        *legs,
    )
    eyes = [ball(0.16 * fat, 8).at(top[0] + 0.06, top[1] - 0.02, s * 0.5 * fat) for s in (-1, 1)]
    hoofs = [
        box((0.1, 0.04, 0.075), 0.01).at(x + 0.01, 0.0, side * 0.55 * fat).on_joint(k + 1)
        for k, (x, side) in enumerate(hips)
    ]
    dark = merged(*(eye.on_joint(5) for eye in eyes), *hoofs)
    joints = [
        Joint(name=f"leg{k + 1}", parent=0, pivot=(x, -leg, side * 0.1), axis=(0.0, 0.0, 1.0))
        for k, (x, side) in enumerate(hips)
    ]
    joints.append(Joint(name="head", parent=0, pivot=(long, back, 0.0), axis=(0.0, 0.0, 1.0)))
    joints.append(Joint(name="tail", parent=0, pivot=(-long, back, 0.0), axis=(0.0, 1.0, 0.0)))
    return Shape(
        parts=(Part(role="fur", surface=skin), Part(role="rubber", surface=dark)),
        joints=tuple(joints),
    )


def _ear(top: tuple[float, float], side: int, fat: float) -> Surface:
    root = np.array([top[0] - 0.03, top[1] - 0.4 * fat, side * 0.35 * fat])
    path = np.stack(
        [
            root,
            root + np.array([-0.01, -0.06, side * 0.02]),
            root + np.array([-0.02, -0.11, side * 0.03]),
        ]
    )
    return tube(path, np.array([0.28, 0.2, 0.03]) * fat, 7)


def _leg(x: float, z: float, leg: float, fat: float) -> Surface:
    knee = 0.02 if x > 0 else -0.03
    path = np.array(
        [
            [x, -leg - 0.5 * fat, z],
            [x, -0.85 * leg, z],
            [x + knee, -0.48 * leg, z],
            [x, -0.12 * leg, z],
            [x, 0.0, z],
        ]
    )
    return tube(path, np.array([0.5, 0.5, 0.27, 0.21, 0.25]) * fat, 8)


def make_bird(rng: Rng) -> Shape:
    """A bird in flight with two-part wings along z; it looks to +x."""
    fat, span = rng.uniform(0.13, 0.18), rng.uniform(0.62, 0.9)
    s = np.array([-0.52, -0.4, -0.15, 0.12, 0.3, 0.42, 0.5, 0.56])
    thick = fat * np.array([0.15, 0.45, 0.9, 1.0, 0.75, 0.68, 0.55, 0.1])
    lift = np.array([0.0, 0.0, 0.0, 0.0, -0.04, -0.08, -0.09, -0.08])
    body = tube(np.stack([s, lift - 0.4, 0 * s], -1), thick, 12)
    tail = _slab([(-0.45, -0.04), (-0.8, -0.13), (-0.84, 0.0), (-0.8, 0.13), (-0.45, 0.04)], -0.41)
    wings = []
    for number, side in ((1, -1), (2, 1)):
        inner = [(0.2, 0.0), (0.22, 0.55 * span), (-0.08, 0.55 * span), (-0.22, 0.0)]
        outer = [(0.22, 0.55 * span), (0.05, span), (-0.12, 0.96 * span), (-0.08, 0.55 * span)]
        wings.append(_slab([(x, side * (0.4 * fat + z)) for x, z in inner], -0.44).on_joint(number))
        wings.append(
            _slab([(x, side * (0.4 * fat + z)) for x, z in outer], -0.44).on_joint(number + 2)
        )
    beak = tube(np.array([[0.52, -0.48, 0.0], [0.66, -0.46, 0.0]]), np.array([0.3, 0.02]) * fat, 7)
    eyes = [ball(0.16 * fat, 8).at(0.47, -0.49, s * 0.5 * fat) for s in (-1, 1)]
    joints = []
    for side in (-1, 1):
        joints.append(
            Joint(name="wing", parent=0, pivot=(0.0, -0.43, side * 0.3 * fat), axis=(1.0, 0.0, 0.0))
        )
    for parent, side in ((1, -1), (2, 1)):
        at = side * (0.4 * fat + 0.55 * span)
        joints.append(
            Joint(name="tip", parent=parent, pivot=(0.0, -0.44, at), axis=(1.0, 0.0, 0.0))
        )
    parts = (
        Part(role="feather", surface=merged(body, tail, *wings)),
        Part(role="accent", surface=beak),
        Part(role="rubber", surface=merged(*eyes)),
    )
    return Shape(parts=parts, joints=tuple(joints))


def _slab(outline: list[tuple[float, float]], y: float, thick: float = 0.022) -> Surface:
    """A thin lying slab with the outline (x, z) at height ``y``."""
    points = np.array([(x, -z) for x, z in outline])
    area = np.sum(
        points[:, 0] * np.roll(points[:, 1], -1) - np.roll(points[:, 0], -1) * points[:, 1]
    )
    upright = extruded(points if area > 0 else points[::-1].copy(), thick, 0.004)
    return upright.turned(about_x(np.pi / 2)).at(y=y)


def make_fish(rng: Rng) -> Shape:
    """A fish that looks to +x and stays above the ground."""
    high, flat = rng.uniform(0.2, 0.32), rng.uniform(0.45, 0.65)
    s = np.linspace(-0.75, 0.6, 12)
    u = (s + 0.75) / 1.35
    thick = high * np.clip(1.9 * np.sin(np.pi * u**1.15) ** 0.8 * 0.52 + 0.07, 0.05, 1)
    body = tube(np.stack([s, 0 * s, 0 * s], -1), thick, 14).stretched(1.0, 1.0, flat)
    fin = extruded(
        np.array([(-0.7, 0.03), (-1.02, 0.3), (-0.93, 0.0), (-1.02, -0.3), (-0.7, -0.03)]),
        0.03,
        0.008,
    )
    ridge = extruded(
        np.array(
            [(0.2, 0.8 * high), (-0.05, 1.5 * high), (-0.4, 1.25 * high), (-0.35, 0.55 * high)]
        ),
        0.03,
        0.008,
    )
    sides = [
        _slab(
            [
                (0.1, s * 0.5 * high * flat),
                (-0.15, s * 1.7 * high * flat),
                (-0.2, s * 0.6 * high * flat),
            ],
            0.08,
        )
        for s in (-1, 1)
    ]
    eyes = [ball(0.035, 8).at(0.42, -0.01, s * 0.6 * high * flat) for s in (-1, 1)]
    parts = (
        Part(role="scales", surface=body),
        Part(role="accent", surface=merged(fin, ridge, *sides)),
        Part(role="rubber", surface=merged(*eyes)),
    )
    return Shape(parts=parts)


def make_car(rng: Rng) -> Shape:
    """A small car that drives to +x; wheels turn about z."""
    long, wide, radius = rng.uniform(2.1, 2.6), rng.uniform(1.05, 1.2), rng.uniform(0.2, 0.25)
    front = rng.uniform(0.25, 0.4)
    low = radius * 0.75
    half = long / 2
    profile = [
        (-half, low),
        (half, low),
        (half, 0.5),
        (half - 0.1, 0.58),
        (front, 0.64),
        (front - 0.28, 1.0),
        (-0.62 * half, 1.0),
        (-half + 0.08, 0.66),
        (-half, 0.6),
    ]
    body = extruded(np.array(profile), wide, 0.05)
    glass_outline = np.array(
        [(front - 0.1, 0.66), (front - 0.33, 0.95), (-0.58 * half, 0.95), (-half + 0.2, 0.68)]
    )
    glass = extruded(glass_outline, wide + 0.02, 0.01)
    screen = extruded(
        np.array(
            [(front - 0.02, 0.66), (front + 0.02, 0.68), (front - 0.23, 0.97), (front - 0.27, 0.95)]
        ),
        0.8 * wide,
        0.005,
    )
    axle = rod(radius, 0.2, bevel=0.03, segments=20).turned(about_x(np.pi / 2))
    hub = rod(0.55 * radius, 0.215, segments=6).turned(about_x(np.pi / 2))
    wheels, hubs, joints = [], [], []
    for k, (x, s) in enumerate((x, s) for x in (-0.62 * half, 0.62 * half) for s in (-1, 1)):
        z = s * (wide / 2 - 0.06)
        wheels.append(axle.at(x, -radius, z - 0.1).on_joint(k + 1))
        hubs.append(hub.at(x, -radius, z - 0.1075).on_joint(k + 1))
        joints.append(Joint(name="wheel", parent=0, pivot=(x, -radius, z), axis=(0.0, 0.0, 1.0)))
    lights = [box((0.03, 0.09, 0.16), 0.01).at(half, -0.42, s * 0.36 * wide) for s in (-1, 1)]
    parts = (
        Part(role="coat", surface=body),
        Part(role="pane", surface=merged(glass, screen)),
        Part(role="rubber", surface=merged(*wheels)),
        Part(role="metal", surface=merged(*hubs)),
        Part(role="plaster", surface=merged(*lights)),
    )
    return Shape(parts=parts, joints=tuple(joints))
