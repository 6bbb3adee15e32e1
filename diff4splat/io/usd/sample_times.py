"""The times at which a motion is sampled for files that interpolate by themselves."""

from itertools import pairwise

from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.protocol import Motion

FPS = 24.0
MAX_TIMES = 2048


def sample_times_s(motion: Motion, halvings: int = 0) -> list[float]:
    """The key times, or ``FPS`` a second, with every gap halved so often; one if nothing moves."""
    start_s, stop_s = motion.time_range_s
    if len(motion.moving_index) == 0 or start_s == stop_s:
        return [start_s]
    if isinstance(motion, KeyframeMotion):
        times_s = motion.key_times_s.double().tolist()
    else:
        gaps = min(max(1, round((stop_s - start_s) * FPS)), MAX_TIMES - 1)
        times_s = [start_s + (stop_s - start_s) * k / gaps for k in range(gaps + 1)]
    for _ in range(halvings):
        middles = [(a + b) / 2 for a, b in pairwise(times_s)]
        times_s = sorted([*times_s, *middles])
    return times_s


def between_s(times_s: list[float], count: int) -> list[float]:
    """Up to ``count`` times spread over the gaps, at no key and off the middles."""
    gaps = list(pairwise(times_s))
    chosen = gaps if len(gaps) <= count else [gaps[k * len(gaps) // count] for k in range(count)]
    return [a + (b - a) * 0.37 for a, b in chosen]
