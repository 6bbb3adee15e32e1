"""Key frames that replace any motion, with as few keys as a tolerance in pixels allows.

Between two keys the error of a smooth motion goes as the square of their distance. Cubic curves
gain a factor and no power: at both ends their tangents are one-sided, and rotations and scales do
not follow them. A field on planes has kinks wherever a time node is passed, which a line with a key
there follows and a curve rounds off. With lines an error depends on the two keys around it alone,
so that keys come only where they are needed, and key frames at other times can be joined exactly.
Lines are the default.

Opacity and colour are no part of key frames. How much they change is reported.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

import torch

from diff4splat.errors import ConfigError, InputError
from diff4splat.geometry.camera import Camera
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.bake_error import BakeError, largest
from diff4splat.scene.motion.bake_sampling import Interpolation, sampler
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.protocol import Motion

TOLERANCE_PX = 0.1
_MOST_PARTS = 8
"""Into how many parts a gap is split at once."""


@torch.no_grad()
def bake(
    gaussians: Gaussians,
    motion: Motion,
    keys: int | Sequence[float],
    cameras: Camera,
    interpolation: Interpolation = "linear",
) -> tuple[KeyframeMotion, BakeError]:
    """Key frames at the given times, in seconds, or at so many evenly over the motion's range.

    ``cameras`` is one camera or a batch. The error is looked at between the keys and, where they do
    not reach the ends of the range, up to there.

    Raises:
        InputError: no key, a time that is not finite, or a motion that leaves finite numbers.
    """
    source = sampler(gaussians, motion, cameras, interpolation)
    times = source.even_times(keys) if isinstance(keys, int) else source.rounded(keys)
    if not times or not all(map(math.isfinite, times)):
        raise InputError(f"bake: expected at least one finite key time, got {keys}")
    made = source.keyed({time_s: source.key_at(time_s) for time_s in times})
    ends = [time_s for time_s in motion.time_range_s if not times[0] <= time_s <= times[-1]]
    gaps = list(pairwise(sorted([*times, *ends]))) or [(times[0], times[0])]
    return source.placed(made), largest(
        error for gap in gaps for error in source.probe(made, gap).values()
    )


@torch.no_grad()
def bake_within(
    gaussians: Gaussians,
    motion: Motion,
    cameras: Camera,
    tolerance_px: float = TOLERANCE_PX,
    max_keys: int = 1024,
    interpolation: Interpolation = "linear",
) -> tuple[KeyframeMotion, BakeError]:
    """Few keys that keep every Gaussian that ``cameras`` see within ``tolerance_px``.

    Starts from both ends of the range. A gap with too large an error is split into as many parts as
    its error asks for, or, when that is two, where the error is largest; at kinks of the motion
    before anywhere else.

    Raises:
        ConfigError: ``max_keys`` are not enough, or the tolerance is not above 0.
        InputError: a motion that leaves finite numbers.
    """
    if not tolerance_px > 0:
        raise ConfigError(f"tolerance_px: expected a number above 0, got {tolerance_px}")
    source = sampler(gaussians, motion, cameras, interpolation)
    keys = {time_s: source.key_at(time_s) for time_s in source.even_times(2)}
    known: dict[tuple[float, ...], BakeError] = {}
    kinks_s = source.kinks_s()
    while True:
        made, gaps, added = source.keyed(keys), _gaps(sorted(keys), interpolation), set[float]()
        for around, gap in gaps.items():
            if around not in known:
                probes = source.probe(made, gap)
                known[around] = largest(probes.values())
                wanted = _split(gap, probes, tolerance_px)
                added.update(_at_kinks(wanted, [t for t in kinks_s if gap[0] < t < gap[1]]))
        added = set(source.rounded(added)) - keys.keys()
        error = largest(known[around] for around in gaps)
        if not added and error.largest_px <= tolerance_px:
            return source.placed(made), error
        if not added or len(keys) + len(added) > max_keys:
            raise ConfigError(
                f"bake_within: expected {tolerance_px} px with at most {max_keys} keys, got "
                f"{error.largest_px:.3g} px with {len(keys)}; allow more of either"
            )
        keys.update((time_s, source.key_at(time_s)) for time_s in added)


def _gaps(
    times: Sequence[float], interpolation: Interpolation
) -> dict[tuple[float, ...], tuple[float, float]]:
    """Each gap under the keys that its error depends on."""
    reach = 0 if interpolation == "linear" else 1
    if len(times) == 1:
        return {(times[0],): (times[0], times[0])}
    return {
        tuple(times[max(k - reach, 0) : k + 2 + reach]): gap
        for k, gap in enumerate(pairwise(times))
    }


def _split(
    gap: tuple[float, float], probes: Mapping[float, BakeError], tolerance_px: float
) -> Iterable[float]:
    """Times at which new keys make the error small enough, as far as one can tell."""
    worst_s = max(probes, key=lambda time_s: probes[time_s].largest_px)
    excess = probes[worst_s].largest_px / tolerance_px
    if excess <= 1:
        return []
    parts = min(math.ceil(excess**0.5), _MOST_PARTS)
    if parts == 2:
        return [worst_s]
    return [gap[0] + (gap[1] - gap[0]) * k / parts for k in range(1, parts)]


def _at_kinks(times_s: Iterable[float], kinks_s: Sequence[float]) -> list[float]:
    """The nearest kink for each time; the times themselves where there is none."""
    return [min(kinks_s, key=lambda kink: abs(kink - t), default=t) for t in times_s]
