"""Motions that change the form: cloth in the wind, jelly, foliage, growth.

``q`` is the height of a vertex above the ground as a share of the object's own height.
"""

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.synthetic.motions.context import (
    MotionContext,
    MotionResult,
    PartPositions,
    deformed,
    on_ground,
)


def _done(context: MotionContext, parts: PartPositions) -> MotionResult:
    return MotionResult(shape=context.shape, parts=parts)


def _share(context: MotionContext, rest: Float64[np.ndarray, "v 3"]) -> Float64[np.ndarray, " v"]:
    return np.clip(-rest[:, 1] / context.shape.height, 0.0, 1.0)


def _scaled(
    rest: Float64[np.ndarray, "v 3"],
    upright: Float64[np.ndarray, " t"],
    across: Float64[np.ndarray, " t"],
) -> Float64[np.ndarray, "t v 3"]:
    return rest * np.stack([across, upright, across], -1)[:, None]


def flutters(context: MotionContext) -> MotionResult:
    """Cloth waves in the wind; what holds it is static."""
    phase, gust = context.phase(0.9, 1.5), context.phase(0.2, 0.4)
    parts = []
    for part in context.shape.parts:
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
    return _done(context, tuple(parts))


def squashes(context: MotionContext) -> MotionResult:
    """Gets flat and wide, then high and thin, keeping its volume."""
    upright = 1.0 + context.rng.uniform(0.18, 0.3) * np.sin(context.phase(0.7, 1.1))
    return _done(
        context, deformed(context.shape, lambda rest: _scaled(rest, upright, upright**-0.5))
    )


def grows(context: MotionContext) -> MotionResult:
    """Swells to its full size."""
    u = context.progress
    size = 1.0 - context.rng.uniform(0.3, 0.45) * (1 - u * u * (3 - 2 * u))
    return _done(context, deformed(context.shape, lambda rest: _scaled(rest, size, size)))


def shrinks(context: MotionContext) -> MotionResult:
    """Shrinks from its full size."""
    u = context.progress
    size = 1.0 - context.rng.uniform(0.3, 0.45) * u * u * (3 - 2 * u)
    return _done(context, deformed(context.shape, lambda rest: _scaled(rest, size, size)))


def twists(context: MotionContext) -> MotionResult:
    """The top turns against the bottom, to and fro."""
    angle = context.rng.uniform(0.7, 1.2) * np.sin(context.phase(0.45, 0.7))

    def turn(rest):
        by = angle[:, None] * _share(context, rest)
        c, s = np.cos(by), np.sin(by)
        x, z = rest[:, 0], rest[:, 2]
        return np.stack([c * x + s * z, np.broadcast_to(rest[:, 1], by.shape), c * z - s * x], -1)

    return _done(context, deformed(context.shape, turn))


def bends(context: MotionContext) -> MotionResult:
    """Bows along x and rises again: a circular arc of the upright axis."""
    curve = context.rng.uniform(0.5, 0.8) * np.sin(context.phase(0.45, 0.7))
    curve = np.where(np.abs(curve) < 1e-3, 1e-3, curve)[:, None]
    high = context.shape.height

    def bow(rest):
        q = _share(context, rest)
        angle = curve * q
        x = high / curve * (1 - np.cos(angle)) + rest[:, 0] * np.cos(angle)
        y = -high / curve * np.sin(angle) + rest[:, 0] * np.sin(angle) * q
        return np.stack([x, y, np.broadcast_to(rest[:, 2], x.shape)], -1)

    return _done(context, on_ground(deformed(context.shape, bow)))


def wobbles(context: MotionContext) -> MotionResult:
    """Shakes like jelly, less and less."""
    phase, high = context.phase(1.4, 2.0), context.shape.height
    strength = (
        context.rng.uniform(0.22, 0.34)
        * high
        * np.exp(-0.6 * (context.times_s - context.times_s[0]))
    )

    def shake(rest):
        q = _share(context, rest) ** 1.4
        x = (strength * np.sin(phase))[:, None] * q
        z = 0.6 * (strength * np.sin(phase + 1.3))[:, None] * q
        return rest + np.stack([x, 0.25 * np.abs(x) * q, z], -1)

    return _done(context, deformed(context.shape, shake))


def sways(context: MotionContext) -> MotionResult:
    """Foliage moves in the wind, each branch a little for itself."""
    phase, high = context.phase(0.45, 0.8), context.shape.height
    strength = context.rng.uniform(0.07, 0.12) * high

    def lean(rest):
        q = _share(context, rest)
        own = 9.0 * rest[:, 0] / high + 5.0 * rest[:, 2] / high
        reach = np.hypot(rest[:, 0], rest[:, 2]) / high
        main = (strength * (0.35 + np.sin(phase)))[:, None] * q**1.5
        flutter = 0.35 * strength * np.sin(2.3 * phase[:, None] + own) * q * (reach + 0.1) * 2
        return rest + np.stack(
            [main + flutter, 0.3 * np.abs(main) * q + 0.4 * flutter, 0.6 * flutter], -1
        )

    return _done(context, on_ground(deformed(context.shape, lean)))
