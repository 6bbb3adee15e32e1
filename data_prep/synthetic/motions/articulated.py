"""Motions of things with joints or a flexible spine: walking, flying, crawling, driving."""

import numpy as np

from diff4splat.data_prep.synthetic.motions.act import (
    Act,
    Performance,
    above_ground,
    bent,
    jointed,
    settled,
    shifted,
    shifts,
)


def walks(act: Act) -> Performance:
    """Walks along: diagonal legs together, fast enough that standing feet do not slip."""
    x = act.along()
    leg = -act.shape.joints[0].pivot[1]
    stride = act.draws.between(0.38, 0.5)
    phase = (x - x[0]) / (stride * leg) + act.draws.between(0.0, 6.28)
    lag = (0.0, np.pi, np.pi, 0.0)
    # joints turn +x towards the ground, so a foot goes forward at negative angles
    angles = {k + 1: stride * np.cos(phase + lag[k]) for k in range(4)}
    angles[5] = 0.09 * np.sin(2 * phase)
    angles[6] = 0.45 * np.sin(1.5 * phase)
    parts = settled(jointed(act.shape, angles, len(x)))
    return Performance(shape=act.shape, parts=shifted(parts, shifts(x=x)))


def flies(act: Act) -> Performance:
    """Flies past with beating wings."""
    x, phase = act.along(), act.waving(1.6, 2.6)
    beat = 0.15 + 0.65 * np.sin(phase)
    tip = 0.15 + 0.5 * np.sin(phase - 0.9)
    parts = jointed(act.shape, {1: beat, 2: -beat, 3: tip, 4: -tip}, len(x))
    altitude = act.draws.between(1.0, 2.0) * act.shape.radius
    heave = 0.06 * act.shape.radius * np.cos(phase)
    return Performance(
        shape=act.shape, parts=above_ground(shifted(parts, shifts(x=x, y=-altitude + heave)))
    )


def swims(act: Act) -> Performance:
    """Swims: a wave runs down the body, wider towards the tail."""
    x, phase = act.along(), act.waving(1.2, 2.0)
    low, high = act.shape.bounds
    long = float(high[0] - low[0])

    def wave(rest):
        tail = (high[0] - rest[:, 0]) / long
        side = 0.16 * long * tail**1.6 * np.sin(phase[:, None] - 4.2 * tail)
        return rest + shifts(z=side.ravel()).reshape(*side.shape, 3)

    altitude = act.draws.between(0.5, 1.6) * act.shape.height
    return Performance(
        shape=act.shape, parts=shifted(bent(act.shape, wave), shifts(x=x, y=-altitude))
    )


def slithers(act: Act) -> Performance:
    """Every part of the body follows the head along one winding track."""
    x = act.along()
    low, high = act.shape.bounds
    long = float(high[0] - low[0])
    wide, rate = 0.085 * long, 2 * np.pi * act.draws.between(1.3, 1.8) / long
    start = act.draws.between(0.0, 6.28)

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

    return Performance(shape=act.shape, parts=bent(act.shape, follow))


def crawls(act: Act) -> Performance:
    """Humps run from the tail to the head."""
    x, phase = act.along(), act.waving(0.8, 1.3)
    high = act.shape.height
    long = float(act.shape.bounds[1][0] - act.shape.bounds[0][0])

    def hump(rest):
        lift = 0.3 * high * np.maximum(np.sin(phase[:, None] - 7.0 * rest[:, 0] / long), 0) ** 1.5
        return rest + shifts(y=-lift.ravel()).reshape(*lift.shape, 3)

    parts = settled(bent(act.shape, hump))
    return Performance(shape=act.shape, parts=shifted(parts, shifts(x=x)))


def drives(act: Act) -> Performance:
    """Drives straight on; wheels turn with the road."""
    x = act.along()
    joints = act.shape.joints
    radius = -joints[0].pivot[1]
    angles = {k + 1: (x - x[0]) / radius for k in range(len(joints))}
    parts = jointed(act.shape, angles, len(x))
    return Performance(shape=act.shape, parts=shifted(above_ground(parts), shifts(x=x)))


def reaches(act: Act) -> Performance:
    """A robot arm turns, reaches out and nods."""
    u = act.progress
    ease = u * u * (3 - 2 * u)
    way = act.draws.sign()
    nod = act.waving(0.5, 0.9)
    angles = {
        1: way * act.draws.between(0.7, 1.4) * (ease - 0.5) + act.draws.between(0.0, 6.28),
        2: 0.3 + act.draws.between(0.25, 0.5) * np.sin(nod),
        3: -0.3 + act.draws.between(0.3, 0.6) * np.sin(nod + 1.3),
        4: 0.5 * np.sin(2 * nod),
    }
    parts = above_ground(jointed(act.shape, angles, len(u)))
    return Performance(shape=act.shape, parts=parts)


def turns_sails(act: Act) -> Performance:
    """The wheel goes round."""
    angle = 2 * np.pi * act.draws.between(0.25, 0.55) * act.draws.sign() * act.progress
    parts = jointed(act.shape, {1: angle + act.draws.between(0.0, 6.0)}, len(angle))
    return Performance(shape=act.shape, parts=parts)
