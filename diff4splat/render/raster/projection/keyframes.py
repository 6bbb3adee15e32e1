"""Kernel: key-framed Gaussians at a time, projected without ever being stored as a state.

Axes: ``t`` key times, ``m`` moving Gaussians. Same rules as ``scene.motion.keyframes``: offsets
follow a line or a cubic, which at one time is a weighted sum of two or four keys; rotations slerp;
log-scales follow a line. Only the moved means are written, because colours look along them.
"""

import math
from typing import NamedTuple

import numpy as np

from diff4splat.geometry.quaternion import HALF_TURN
from diff4splat.kernels.jit import contracted
from diff4splat.render.raster.jit import kernel
from diff4splat.render.raster.projection.footprint import quadruple, triple, unit
from diff4splat.render.raster.projection.project import is_visible
from diff4splat.render.raster.tables import Doubles, Floats, Integers
from diff4splat.scene.motion.keyframes import KeyframeMotion

_NEARBY = 1 - 1e-6
"""Above this cosine a slerp is a line, as in ``geometry.quaternion``."""


class Keys(NamedTuple):
    """The motion of the Gaussians at ``moving``."""

    moving: Integers
    offsets: Floats
    rotations: Floats
    log_scales: Floats


class Moment(NamedTuple):
    """A time between two keys."""

    lower: int
    upper: int
    weight: float
    """Of the upper key."""
    offset_keys: Integers
    """The keys that positions depend on."""
    offset_weights: Doubles


def keys_of(motion: KeyframeMotion) -> Keys:
    """Arrays of a motion."""
    return Keys(
        motion.moving_index.detach().int().contiguous().numpy(),
        motion.offsets.detach().float().contiguous().numpy(),
        motion.rotations.detach().float().contiguous().numpy(),
        motion.log_scale_offsets.detach().float().contiguous().numpy(),
    )


def moment_at(motion: KeyframeMotion, time_s: float) -> Moment:
    """Where ``time_s`` lies among the keys."""
    times = motion.key_times_s.double().numpy()
    if len(times) == 1:
        return Moment(0, 0, 0.0, np.zeros(1, np.int32), np.ones(1))
    lower = int(np.clip(np.searchsorted(times, time_s, side="right") - 1, 0, len(times) - 2))
    gap = times[lower + 1] - times[lower]
    weight = float(np.clip((time_s - times[lower]) / gap, 0.0, 1.0))
    weights = np.zeros(len(times))
    if motion.interpolation == "linear" or len(times) < 3:
        weights[lower], weights[lower + 1] = 1 - weight, weight
    else:
        _add_hermite(weights, times, lower, weight)
    used = np.flatnonzero(weights)
    return Moment(lower, lower + 1, weight, used.astype(np.int32), weights[used])


def _add_hermite(weights: Doubles, times: Doubles, lower: int, w: float) -> None:
    """Cubic Hermite basis, with central differences for the tangents."""
    weights[lower] += 2 * w**3 - 3 * w**2 + 1
    weights[lower + 1] += 3 * w**2 - 2 * w**3
    gap = times[lower + 1] - times[lower]
    for key, factor in ((lower, w**3 - 2 * w**2 + w), (lower + 1, w**3 - w**2)):
        first, last = max(key - 1, 0), min(key + 1, len(times) - 1)
        slope = factor * gap / (times[last] - times[first])
        weights[last] += slope
        weights[first] -= slope


@kernel
def project_keyframed(first, last, keys, moment, means, inputs, outputs):
    """As ``project``, for moving Gaussians; writes their moved ``means``."""
    cloud, sh, view, rules = inputs
    prints, depth, visible, unusable = outputs
    count = 0
    for place in range(first, last):
        i = keys.moving[place]
        mean = _moved(triple(cloud.means, i), place, keys, moment)
        means[i, 0], means[i, 1], means[i, 2] = mean
        quat = _turned(quadruple(cloud.quats, i), place, keys, moment)
        scales = _stretched(triple(cloud.scales, i), place, keys, moment)
        state = (mean, quat, scales, np.float64(cloud.opacities[i]))
        if is_visible(i, state, sh, view, rules, prints, depth, unusable):
            visible[first + count] = i
            count += 1
    return count


@contracted
def _moved(mean, place, keys, moment):
    x, y, z = mean
    for k in range(len(moment.offset_keys)):
        key, weight = moment.offset_keys[k], moment.offset_weights[k]
        x += weight * keys.offsets[key, place, 0]
        y += weight * keys.offsets[key, place, 1]
        z += weight * keys.offsets[key, place, 2]
    return x, y, z


@contracted
def _turned(quat, place, keys, moment):
    """The canonical rotation, then along the arc between two keys."""
    w1, x1, y1, z1, _ = unit(quat)
    lower = unit(_key(keys.rotations, moment.lower, place))
    upper = unit(_key(keys.rotations, moment.upper, place))
    cosine = lower[0] * upper[0] + lower[1] * upper[1] + lower[2] * upper[2] + lower[3] * upper[3]
    sign = -1.0 if cosine < -HALF_TURN else 1.0
    from_lower, from_upper = _arc(sign * cosine, moment.weight)
    from_upper *= sign
    w2 = from_lower * lower[0] + from_upper * upper[0]
    x2 = from_lower * lower[1] + from_upper * upper[1]
    y2 = from_lower * lower[2] + from_upper * upper[2]
    z2 = from_lower * lower[3] + from_upper * upper[3]
    return (
        w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
        w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
        w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
        w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
    )


@contracted
def _arc(cosine, weight):
    """Weights of both ends of an arc."""
    if cosine > _NEARBY:
        return 1 - weight, weight
    angle = math.acos(cosine)
    return math.sin((1 - weight) * angle) / math.sin(angle), (
        math.sin(weight * angle) / math.sin(angle)
    )


@contracted
def _stretched(scales, place, keys, moment):
    lower, upper, weight = moment.lower, moment.upper, moment.weight
    x = (1 - weight) * keys.log_scales[lower, place, 0] + weight * keys.log_scales[upper, place, 0]
    y = (1 - weight) * keys.log_scales[lower, place, 1] + weight * keys.log_scales[upper, place, 1]
    z = (1 - weight) * keys.log_scales[lower, place, 2] + weight * keys.log_scales[upper, place, 2]
    return scales[0] * math.exp(x), scales[1] * math.exp(y), scales[2] * math.exp(z)


@contracted
def _key(rows, key, place):
    return (
        np.float64(rows[key, place, 0]),
        np.float64(rows[key, place, 1]),
        np.float64(rows[key, place, 2]),
        np.float64(rows[key, place, 3]),
    )
