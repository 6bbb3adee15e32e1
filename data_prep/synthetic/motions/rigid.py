"""Motions of things that keep their form: along the ground, through the air, in place.

Rolling and tumbling do not slip: the contact point stands still. Flight is y″ = g.
"""

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.synthetic.motions.act import (
    GRAVITY,
    Act,
    Performance,
    Posed,
    carried,
    resting,
    settled,
    shifted,
    shifts,
    turning,
)
from diff4splat.data_prep.synthetic.shapes.facets import boxes
from diff4splat.data_prep.synthetic.shapes.shape import Part, Shape
from diff4splat.data_prep.synthetic.shapes.sweep import tube


def _done(act: Act, parts: Posed) -> Performance:
    return Performance(shape=act.shape, parts=parts)


def _yawed(act: Act, *, any_way: bool) -> Posed:
    """At rest in every frame, facing any way unless the thing has a front to go by."""
    frames = len(act.times_s)
    angle = act.draws.between(0.0, 2 * np.pi) if any_way else 0.0
    turn = turning((0.0, 1.0, 0.0), np.full(frames, angle))
    return carried(resting(act.shape), turn, np.zeros(3), np.zeros((frames, 3)))


def slides(act: Act) -> Performance:
    """Glides over the ground."""
    return _done(act, shifted(_yawed(act, any_way=True), shifts(x=act.along())))


def rolls(act: Act) -> Performance:
    """Rolls on its round side about z."""
    x, radius = act.along(), 0.5 * act.shape.height
    start = act.draws.between(0.0, 2 * np.pi)
    turned = carried(
        resting(act.shape),
        turning((0.0, 0.0, 1.0), x / radius + start),
        np.array([0.0, -radius, 0.0]),
        shifts(x=x),
    )
    return _done(act, settled(turned))


def tumbles(act: Act) -> Performance:
    """Turns over its own corners about z."""
    points = np.concatenate([part.surface.vertices for part in act.shape.parts])
    pivot = np.array([0.0, -0.5 * act.shape.height, 0.0])
    reach = float(np.linalg.norm((points - pivot)[:, :2], axis=1).mean())
    total = act.travel_m / max(reach, 1e-6)
    fine = np.linspace(0.0, 1.0, 8 * (len(act.times_s) - 1) + 1)
    angle = total * fine * (1.25 - 0.25 * fine)
    x = _without_slip((points - pivot)[:, :2], angle)
    x -= 0.5 * (x[0] + x[-1])
    turned = carried(
        resting(act.shape), turning((0.0, 0.0, 1.0), angle[::8]), pivot, shifts(x=x[::8])
    )
    return _done(act, settled(turned))


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


def spins(act: Act) -> Performance:
    """Turns about the vertical."""
    turns = act.draws.between(0.35, 0.9) * act.draws.sign()
    u = act.progress
    angle = 2 * np.pi * turns * (u + 0.3 * u * u) / 1.3 + act.draws.between(0.0, 6.0)
    offset = np.zeros((len(u), 3))
    return _done(
        act, carried(resting(act.shape), turning((0.0, 1.0, 0.0), angle), np.zeros(3), offset)
    )


def _flight(act: Act, height: float, keep: float) -> Float64[np.ndarray, " t"]:
    """Heights of what falls from ``height`` and rebounds with ``keep`` of its speed."""
    times = act.times_s - act.times_s[0]
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


def bounces(act: Act) -> Performance:
    """Falls and rebounds again and again, going on meanwhile."""
    height = max(act.draws.between(0.8, 1.6) * act.shape.height, 0.35)
    above = _flight(act, height, act.draws.between(0.72, 0.85))
    x = act.travel_m * (act.progress - 0.5)
    turn = turning((0.0, 0.0, 1.0), x / act.shape.height)
    pivot = np.array([0.0, -0.5 * act.shape.height, 0.0])
    turned = settled(carried(resting(act.shape), turn, pivot, shifts(x=x)))
    return _done(act, shifted(turned, shifts(y=-above)))


def drops(act: Act) -> Performance:
    """Falls from above and comes to rest."""
    height = max(act.draws.between(1.2, 2.2) * act.shape.height, 0.4)
    above = _flight(act, min(height, 2.2), act.draws.between(0.2, 0.4))
    return _done(act, shifted(_yawed(act, any_way=True), shifts(y=-above)))


def hops(act: Act) -> Performance:
    """Jumps along in even leaps, standing a moment between them."""
    height = min(max(0.6 * act.shape.height, 0.12), 0.4)
    leap = 2 * (2 * height / GRAVITY) ** 0.5
    count = max(1, round(act.seconds / (1.2 * leap)))
    place = act.progress * count
    number = np.minimum(np.floor(place), count - 1)
    u = np.clip((place - number) / 0.85, 0.0, 1.0)
    x = act.travel_m * ((number + u) / count - 0.5)
    parts = _yawed(act, any_way=not act.shape.joints)
    return _done(act, shifted(parts, shifts(x=x, y=-4 * height * u * (1 - u))))


def rises(act: Act) -> Performance:
    """Floats upward, drifting a little."""
    u = act.progress
    lift = act.travel_m * (0.6 * u + 0.4 * u * u)
    phase = act.waving(0.3, 0.6)
    drift = 0.05 * act.travel_m * (np.sin(phase) - np.sin(phase[0]))
    return _done(act, shifted(_yawed(act, any_way=True), shifts(x=drift, y=-lift)))


def circles(act: Act) -> Performance:
    """Goes round the origin on the ground, as a toy train does."""
    radius = max(0.5 * act.travel_m, 1.6 * act.shape.radius)
    sweep = act.draws.between(0.35, 0.7) * 2 * np.pi * act.draws.sign()
    angle = act.draws.between(0.0, 2 * np.pi) + sweep * act.progress
    pose = turning((0.0, 1.0, 0.0), -angle)
    offset = shifts(x=radius * np.cos(angle), z=radius * np.sin(angle))
    return _done(act, carried(resting(act.shape), pose, np.zeros(3), offset))


def swings(act: Act) -> Performance:
    """Hangs on a rope from a frame and swings along x like a pendulum."""
    size = act.shape.height
    rope = act.draws.between(1.0, 1.8) * size
    swing = act.draws.between(0.35, 0.6)
    top = 0.35 * size + size + rope
    rate = (GRAVITY / (rope + 0.5 * size)) ** 0.5
    angle = swing * np.cos(rate * act.times_s + act.draws.between(0.0, 6.28))
    body = shifted(resting(act.shape), shifts(y=-0.35 * size))
    line = np.array([[0.0, -top, 0.0], [0.0, -top + rope + 0.02 * size, 0.0]])
    cord = tube(line, np.full(2, 0.018 * size), 6)
    moving = carried(
        (*body, cord.vertices[None]),
        turning((0.0, 0.0, 1.0), -angle),
        np.array([0.0, -top, 0.0]),
        np.zeros((len(angle), 3)),
    )
    frame = _gallows(top, 2 * (np.sin(swing) * (rope + size) + 0.8 * size), 0.06 * size)
    extra = (Part(role="rubber", surface=cord), Part(role="wood", surface=frame))
    shape = Shape(parts=(*act.shape.parts, *extra), joints=act.shape.joints)
    return Performance(shape=shape, parts=(*moving, frame.vertices[None].repeat(len(angle), 0)))


def _gallows(top: float, span: float, thick: float):
    """Two posts and a beam along x."""
    posts = [((thick, top, thick), (s * span / 2, 0.0, 0.0)) for s in (-1, 1)]
    feet = [((thick, thick, 0.3 * top), (s * span / 2, 0.0, 0.0)) for s in (-1, 1)]
    beam = ((span + 2 * thick, thick, thick), (0.0, -top + 0.5 * thick, 0.0))
    return boxes([*posts, *feet, beam], 0.15 * thick)
