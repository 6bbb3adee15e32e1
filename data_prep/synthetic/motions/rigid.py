"""Motions of objects that keep their form: along the ground, through the air, in place.

Rolling and tumbling do not slip: the contact point is static. Flight is y″ = g.
"""

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.synthetic.motions.context import (
    GRAVITY,
    MotionContext,
    MotionResult,
    PartPositions,
    axis_rotations,
    offsets,
    on_ground,
    rest_positions,
    transformed,
    translated,
)
from diff4splat.data_prep.synthetic.shapes.shape import Part, Shape
from diff4splat.data_prep.synthetic.shapes.surfaces.facets import boxes
from diff4splat.data_prep.synthetic.shapes.surfaces.sweep import tube


def _done(context: MotionContext, parts: PartPositions) -> MotionResult:
    return MotionResult(shape=context.shape, parts=parts)


def _yawed(context: MotionContext, *, any_way: bool) -> PartPositions:
    """At rest in every frame, facing any way unless the object has a front."""
    frames = len(context.times_s)
    angle = context.rng.uniform(0.0, 2 * np.pi) if any_way else 0.0
    turn = axis_rotations((0.0, 1.0, 0.0), np.full(frames, angle))
    return transformed(rest_positions(context.shape), turn, np.zeros(3), np.zeros((frames, 3)))


def slides(context: MotionContext) -> MotionResult:
    """Glides over the ground."""
    return _done(context, translated(_yawed(context, any_way=True), offsets(x=context.along())))


def rolls(context: MotionContext) -> MotionResult:
    """Rolls on its round side about z."""
    x, radius = context.along(), 0.5 * context.shape.height
    start = context.rng.uniform(0.0, 2 * np.pi)
    turned = transformed(
        rest_positions(context.shape),
        axis_rotations((0.0, 0.0, 1.0), x / radius + start),
        np.array([0.0, -radius, 0.0]),
        offsets(x=x),
    )
    return _done(context, on_ground(turned))


def tumbles(context: MotionContext) -> MotionResult:
    """Turns over its own corners about z."""
    points = np.concatenate([part.surface.vertices for part in context.shape.parts])
    pivot = np.array([0.0, -0.5 * context.shape.height, 0.0])
    reach = float(np.linalg.norm((points - pivot)[:, :2], axis=1).mean())
    total = context.travel_m / max(reach, 1e-6)
    fine = np.linspace(0.0, 1.0, 8 * (len(context.times_s) - 1) + 1)
    angle = total * fine * (1.25 - 0.25 * fine)
    x = _without_slip((points - pivot)[:, :2], angle)
    x -= 0.5 * (x[0] + x[-1])
    turned = transformed(
        rest_positions(context.shape),
        axis_rotations((0.0, 0.0, 1.0), angle[::8]),
        pivot,
        offsets(x=x[::8]),
    )
    return _done(context, on_ground(turned))


def _without_slip(
    points: Float64[np.ndarray, "v 2"], angle: Float64[np.ndarray, " n"]
) -> Float64[np.ndarray, " n"]:
    """How far the pivot has come while the lowest point stays where it is."""
    sine, cosine = np.sin(angle)[:, None], np.cos(angle)[:, None]
    across = points[:, 0] * cosine - points[:, 1] * sine
    down = points[:, 0] * sine + points[:, 1] * cosine
    contact, row = down.argmax(1), np.arange(len(angle))
    steps = across[row[:-1], contact[:-1]] - across[row[1:], contact[:-1]]
    return np.concatenate([[0.0], np.cumsum(steps)])


def spins(context: MotionContext) -> MotionResult:
    """Turns about the vertical."""
    turns = context.rng.uniform(0.35, 0.9) * context.rng.sign()
    u = context.progress
    angle = 2 * np.pi * turns * (u + 0.3 * u * u) / 1.3 + context.rng.uniform(0.0, 6.0)
    offset = np.zeros((len(u), 3))
    return _done(
        context,
        transformed(
            rest_positions(context.shape),
            axis_rotations((0.0, 1.0, 0.0), angle),
            np.zeros(3),
            offset,
        ),
    )


def _flight(context: MotionContext, height: float, keep: float) -> Float64[np.ndarray, " t"]:
    """Heights of what falls from ``height`` and rebounds with ``keep`` of its speed."""
    times = context.times_s - context.times_s[0]
    fall = (2 * height / GRAVITY) ** 0.5
    above = np.maximum(height - 0.5 * GRAVITY * times**2, 0.0)
    start, speed = fall, keep * GRAVITY * fall
    for _ in range(30):
        if speed < 0.25:
            break
        since = times - start
        inside = (since >= 0) & (since < 2 * speed / GRAVITY)
        above = np.where(inside, speed * since - 0.5 * GRAVITY * since**2, above)
        start, speed = start + 2 * speed / GRAVITY, keep * speed
    return above


def bounces(context: MotionContext) -> MotionResult:
    """Falls and rebounds again and again, going on meanwhile."""
    height = max(context.rng.uniform(0.8, 1.6) * context.shape.height, 0.35)
    above = _flight(context, height, context.rng.uniform(0.72, 0.85))
    x = context.travel_m * (context.progress - 0.5)
    turn = axis_rotations((0.0, 0.0, 1.0), x / context.shape.height)
    pivot = np.array([0.0, -0.5 * context.shape.height, 0.0])
    turned = on_ground(transformed(rest_positions(context.shape), turn, pivot, offsets(x=x)))
    return _done(context, translated(turned, offsets(y=-above)))


def drops(context: MotionContext) -> MotionResult:
    """Falls from above and comes to rest."""
    height = max(context.rng.uniform(1.2, 2.2) * context.shape.height, 0.4)
    above = _flight(context, min(height, 2.2), context.rng.uniform(0.2, 0.4))
    return _done(context, translated(_yawed(context, any_way=True), offsets(y=-above)))


def hops(context: MotionContext) -> MotionResult:
    """Jumps along in even leaps, standing a moment between them."""
    height = min(max(0.6 * context.shape.height, 0.12), 0.4)
    leap = 2 * (2 * height / GRAVITY) ** 0.5
    count = max(1, round(context.seconds / (1.2 * leap)))
    place = context.progress * count
    number = np.minimum(np.floor(place), count - 1)
    u = np.clip((place - number) / 0.85, 0.0, 1.0)
    x = context.travel_m * ((number + u) / count - 0.5)
    parts = _yawed(context, any_way=not context.shape.joints)
    return _done(context, translated(parts, offsets(x=x, y=-4 * height * u * (1 - u))))


def rises(context: MotionContext) -> MotionResult:
    """Floats upward, drifting a little."""
    u = context.progress
    lift = context.travel_m * (0.6 * u + 0.4 * u * u)
    phase = context.phase(0.3, 0.6)
    drift = 0.05 * context.travel_m * (np.sin(phase) - np.sin(phase[0]))
    return _done(context, translated(_yawed(context, any_way=True), offsets(x=drift, y=-lift)))


def circles(context: MotionContext) -> MotionResult:
    """Goes round the origin on the ground, as a toy train does."""
    radius = max(0.5 * context.travel_m, 1.6 * context.shape.radius)
    sweep = context.rng.uniform(0.35, 0.7) * 2 * np.pi * context.rng.sign()
    angle = context.rng.uniform(0.0, 2 * np.pi) + sweep * context.progress
    pose = axis_rotations((0.0, 1.0, 0.0), -angle)
    offset = offsets(x=radius * np.cos(angle), z=radius * np.sin(angle))
    return _done(context, transformed(rest_positions(context.shape), pose, np.zeros(3), offset))


def swings(context: MotionContext) -> MotionResult:
    """Hangs on a rope from a frame and swings along x like a pendulum."""
    size = context.shape.height
    rope = context.rng.uniform(1.0, 1.8) * size
    swing = context.rng.uniform(0.35, 0.6)
    top = 0.35 * size + size + rope
    rate = (GRAVITY / (rope + 0.5 * size)) ** 0.5
    angle = swing * np.cos(rate * context.times_s + context.rng.uniform(0.0, 6.28))
    body = translated(rest_positions(context.shape), offsets(y=-0.35 * size))
    line = np.array([[0.0, -top, 0.0], [0.0, -top + rope + 0.02 * size, 0.0]])
    cord = tube(line, np.full(2, 0.018 * size), 6)
    moving = transformed(
        (*body, cord.vertices[None]),
        axis_rotations((0.0, 0.0, 1.0), -angle),
        np.array([0.0, -top, 0.0]),
        np.zeros((len(angle), 3)),
    )
    frame = _gallows(top, 2 * (np.sin(swing) * (rope + size) + 0.8 * size), 0.06 * size)
    extra = (Part(role="rubber", surface=cord), Part(role="wood", surface=frame))
    shape = Shape(parts=(*context.shape.parts, *extra), joints=context.shape.joints)
    return MotionResult(shape=shape, parts=(*moving, frame.vertices[None].repeat(len(angle), 0)))


def _gallows(top: float, span: float, thick: float):
    """Two posts and a beam along x."""
    posts = [((thick, top, thick), (s * span / 2, 0.0, 0.0)) for s in (-1, 1)]
    feet = [((thick, thick, 0.3 * top), (s * span / 2, 0.0, 0.0)) for s in (-1, 1)]
    beam = ((span + 2 * thick, thick, thick), (0.0, -top + 0.5 * thick, 0.0))
    return boxes([*posts, *feet, beam], 0.15 * thick)
