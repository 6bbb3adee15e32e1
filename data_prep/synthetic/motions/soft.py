"""Motions that change the form: cloth in the wind, jelly, foliage, growth.

``q`` is the height of a vertex above the ground as a share of the thing's own height.
"""

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.synthetic.motions.act import Act, Performance, Posed, bent, settled


def _done(act: Act, parts: Posed) -> Performance:
    return Performance(shape=act.shape, parts=parts)


def _share(act: Act, rest: Float64[np.ndarray, "v 3"]) -> Float64[np.ndarray, " v"]:
    return np.clip(-rest[:, 1] / act.shape.height, 0.0, 1.0)


def _scaled(
    rest: Float64[np.ndarray, "v 3"],
    upright: Float64[np.ndarray, " t"],
    across: Float64[np.ndarray, " t"],
) -> Float64[np.ndarray, "t v 3"]:
    return rest * np.stack([across, upright, across], -1)[:, None]


def flutters(act: Act) -> Performance:
    """Cloth waves in the wind; what holds it stands still."""
    phase, gust = act.waving(0.9, 1.5), act.waving(0.2, 0.4)
    parts = []
    for part in act.shape.parts:
        rest = part.surface.vertices
        if part.role != "cloth":
            parts.append(np.repeat(rest[None], len(phase), axis=0))
            continue
        low, high = rest.min(0), rest.max(0)
        wide, tall = high[0] - low[0], high[1] - low[1]
        is_flag = wide > tall
        free = (rest[:, 0] - low[0]) / wide if is_flag else (rest[:, 1] - low[1]) / tall
        other = (rest[:, 1] - low[1]) / tall if is_flag else (rest[:, 0] - low[0]) / wide
        size = wide if is_flag else tall
        strength = (0.13 + 0.04 * np.sin(gust))[:, None] * size
        lag = 5.5 * free + 1.1 * other
        side = strength * np.sqrt(free) * free**0.3 * np.sin(phase[:, None] - lag)
        lean = 0.0 if is_flag else 0.18 * size * free**2 * (1 + 0.5 * np.sin(gust)[:, None])
        move = np.stack([0 * side, -0.25 * np.abs(side) * free, side + lean], -1)
        parts.append(rest + move)
    return _done(act, tuple(parts))


def squashes(act: Act) -> Performance:
    """Gets flat and wide, then high and thin, keeping its volume."""
    upright = 1.0 + act.draws.between(0.18, 0.3) * np.sin(act.waving(0.7, 1.1))
    return _done(act, bent(act.shape, lambda rest: _scaled(rest, upright, upright**-0.5)))


def grows(act: Act) -> Performance:
    """Swells to its full size."""
    u = act.progress
    size = 1.0 - act.draws.between(0.3, 0.45) * (1 - u * u * (3 - 2 * u))
    return _done(act, bent(act.shape, lambda rest: _scaled(rest, size, size)))


def shrinks(act: Act) -> Performance:
    """Shrinks from its full size."""
    u = act.progress
    size = 1.0 - act.draws.between(0.3, 0.45) * u * u * (3 - 2 * u)
    return _done(act, bent(act.shape, lambda rest: _scaled(rest, size, size)))


def twists(act: Act) -> Performance:
    """The top turns against the bottom, to and fro."""
    angle = act.draws.between(0.7, 1.2) * np.sin(act.waving(0.45, 0.7))

    def turn(rest):
        by = angle[:, None] * _share(act, rest)
        c, s = np.cos(by), np.sin(by)
        x, z = rest[:, 0], rest[:, 2]
        return np.stack([c * x + s * z, np.broadcast_to(rest[:, 1], by.shape), c * z - s * x], -1)

    return _done(act, bent(act.shape, turn))


def bends(act: Act) -> Performance:
    """Bows along x and rises again: a circular arc of the upright axis."""
    curve = act.draws.between(0.5, 0.8) * np.sin(act.waving(0.45, 0.7))
    curve = np.where(np.abs(curve) < 1e-3, 1e-3, curve)[:, None]
    high = act.shape.height

    def bow(rest):
        q = _share(act, rest)
        angle = curve * q
        x = high / curve * (1 - np.cos(angle)) + rest[:, 0] * np.cos(angle)
        y = -high / curve * np.sin(angle) + rest[:, 0] * np.sin(angle) * q
        return np.stack([x, y, np.broadcast_to(rest[:, 2], x.shape)], -1)

    return _done(act, settled(bent(act.shape, bow)))


def wobbles(act: Act) -> Performance:
    """Shakes like jelly, less and less."""
    phase, high = act.waving(1.4, 2.0), act.shape.height
    strength = act.draws.between(0.22, 0.34) * high * np.exp(-0.6 * (act.times_s - act.times_s[0]))

    def shake(rest):
        q = _share(act, rest) ** 1.4
        x = (strength * np.sin(phase))[:, None] * q
        z = 0.6 * (strength * np.sin(phase + 1.3))[:, None] * q
        return rest + np.stack([x, 0.25 * np.abs(x) * q, z], -1)

    return _done(act, bent(act.shape, shake))


def sways(act: Act) -> Performance:
    """Foliage moves in the wind, each branch a little for itself."""
    phase, high = act.waving(0.45, 0.8), act.shape.height
    strength = act.draws.between(0.07, 0.12) * high

    def lean(rest):
        q = _share(act, rest)
        own = 9.0 * rest[:, 0] / high + 5.0 * rest[:, 2] / high
        reach = np.hypot(rest[:, 0], rest[:, 2]) / high
        main = (strength * (0.35 + np.sin(phase)))[:, None] * q**1.5
        flutter = 0.35 * strength * np.sin(2.3 * phase[:, None] + own) * q * (reach + 0.1) * 2
        return rest + np.stack(
            [main + flutter, 0.3 * np.abs(main) * q + 0.4 * flutter, 0.6 * flutter], -1
        )

    return _done(act, settled(bent(act.shape, lean)))
