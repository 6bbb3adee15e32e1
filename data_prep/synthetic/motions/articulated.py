"""Motions of objects with joints or a flexible spine: walking, flying, crawling, driving."""

import numpy as np

from diff4splat.data_prep.synthetic.motions.context import (
    MotionContext,
    MotionResult,
    above_ground,
    articulated,
    deformed,
    offsets,
    on_ground,
    translated,
)


def walks(context: MotionContext) -> MotionResult:
    """Walks along: diagonal legs together, fast enough that standing feet do not slip."""
    x = context.along()
    leg = -context.shape.joints[0].pivot[1]
    stride = context.rng.uniform(0.38, 0.5)
    phase = (x - x[0]) / (stride * leg) + context.rng.uniform(0.0, 6.28)
    lag = (0.0, np.pi, np.pi, 0.0)
    # joints turn +x towards the ground, so a foot goes forward at negative angles
    angles = {k + 1: stride * np.cos(phase + lag[k]) for k in range(4)}
    angles[5] = 0.09 * np.sin(2 * phase)
    angles[6] = 0.45 * np.sin(1.5 * phase)
    parts = on_ground(articulated(context.shape, angles, len(x)))
    return MotionResult(shape=context.shape, parts=translated(parts, offsets(x=x)))


def flies(context: MotionContext) -> MotionResult:
    """Flies past with beating wings."""
    x, phase = context.along(), context.phase(1.6, 2.6)
    beat = 0.15 + 0.65 * np.sin(phase)
    tip = 0.15 + 0.5 * np.sin(phase - 0.9)
    parts = articulated(context.shape, {1: beat, 2: -beat, 3: tip, 4: -tip}, len(x))
    altitude = context.rng.uniform(1.0, 2.0) * context.shape.radius
    heave = 0.06 * context.shape.radius * np.cos(phase)
    return MotionResult(
        shape=context.shape,
        parts=above_ground(translated(parts, offsets(x=x, y=-altitude + heave))),
    )


def swims(context: MotionContext) -> MotionResult:
    """Swims: a wave runs down the body, wider towards the tail."""
    x, phase = context.along(), context.phase(1.2, 2.0)
    low, high = context.shape.bounds
    long = float(high[0] - low[0])

    def wave(rest):
        tail = (high[0] - rest[:, 0]) / long
        side = 0.16 * long * tail**1.6 * np.sin(phase[:, None] - 4.2 * tail)
        return rest + offsets(z=side.ravel()).reshape(*side.shape, 3)

    altitude = context.rng.uniform(0.5, 1.6) * context.shape.height
    return MotionResult(
        shape=context.shape,
        parts=translated(deformed(context.shape, wave), offsets(x=x, y=-altitude)),
    )


def slithers(context: MotionContext) -> MotionResult:
    """Every part of the body follows the head along one winding track."""
    x = context.along()
    low, high = context.shape.bounds
    long = float(high[0] - low[0])
    wide, rate = 0.085 * long, 2 * np.pi * context.rng.uniform(1.3, 1.8) / long
    start = context.rng.uniform(0.0, 6.28)

    def follow(rest):
        s = rest[None, :, 0] + x[:, None]
        turn = np.arctan(wide * rate * np.cos(rate * s + start))
        side = rest[:, 2]
        return np.stack(
            [
                s - np.sin(turn) * side,
                np.broadcast_to(rest[:, 1], s.shape),
                wide * np.sin(rate * s + start) + np.cos(turn) * side,
            ],
            -1,
        )

    return MotionResult(shape=context.shape, parts=deformed(context.shape, follow))


def crawls(context: MotionContext) -> MotionResult:
    """Humps run from the tail to the head."""
    x, phase = context.along(), context.phase(0.8, 1.3)
    high = context.shape.height
    long = float(context.shape.bounds[1][0] - context.shape.bounds[0][0])

    def hump(rest):
        lift = 0.3 * high * np.maximum(np.sin(phase[:, None] - 7.0 * rest[:, 0] / long), 0) ** 1.5
        return rest + offsets(y=-lift.ravel()).reshape(*lift.shape, 3)

    parts = on_ground(deformed(context.shape, hump))
    return MotionResult(shape=context.shape, parts=translated(parts, offsets(x=x)))


def drives(context: MotionContext) -> MotionResult:
    """Drives straight on; wheels turn with the road."""
    x = context.along()
    joints = context.shape.joints
    radius = -joints[0].pivot[1]
    angles = {k + 1: (x - x[0]) / radius for k in range(len(joints))}
    parts = articulated(context.shape, angles, len(x))
    return MotionResult(shape=context.shape, parts=translated(above_ground(parts), offsets(x=x)))


def reaches(context: MotionContext) -> MotionResult:
    """A robot arm turns, reaches out and nods."""
    u = context.progress
    ease = u * u * (3 - 2 * u)
    way = context.rng.sign()
    nod = context.phase(0.5, 0.9)
    angles = {
        1: way * context.rng.uniform(0.7, 1.4) * (ease - 0.5) + context.rng.uniform(0.0, 6.28),
        2: 0.3 + context.rng.uniform(0.25, 0.5) * np.sin(nod),
        3: -0.3 + context.rng.uniform(0.3, 0.6) * np.sin(nod + 1.3),
        4: 0.5 * np.sin(2 * nod),
    }
    parts = above_ground(articulated(context.shape, angles, len(u)))
    return MotionResult(shape=context.shape, parts=parts)


def turns_sails(context: MotionContext) -> MotionResult:
    """The wheel goes round."""
    angle = 2 * np.pi * context.rng.uniform(0.25, 0.55) * context.rng.sign() * context.progress
    parts = articulated(context.shape, {1: angle + context.rng.uniform(0.0, 6.0)}, len(angle))
    return MotionResult(shape=context.shape, parts=parts)
