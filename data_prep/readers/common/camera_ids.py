"""Assigns camera ids to frames of which only poses and times are known.

Axes: ``f`` frames. Repeated poses are static cameras. Otherwise one camera moves, and the second
frame of a time belongs to a second camera.
"""

from collections import Counter

from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.split import same_view_groups

_MIN_FRAMES_PER_POSE = 2
"""Mean frames per pose from which poses count as static cameras."""


def assign_camera_ids(world_from_camera: Float[Tensor, "f 4 4"], times_s: list[float]) -> list[int]:
    """A camera id from 0 for each frame, in the order of first appearance."""
    groups = _by_appearance(same_view_groups(world_from_camera).tolist())
    static = len(times_s) >= _MIN_FRAMES_PER_POSE * len(set(groups))
    once = len(set(zip(groups, times_s, strict=True))) == len(times_s)
    return groups if static and once else _by_turn(times_s)


def _by_appearance(groups: list[int]) -> list[int]:
    order = {group: number for number, group in enumerate(dict.fromkeys(groups))}
    return [order[group] for group in groups]


def _by_turn(times_s: list[float]) -> list[int]:
    seen: Counter[float] = Counter()
    numbers = []
    for time_s in times_s:
        numbers.append(seen[time_s])
        seen[time_s] += 1
    return numbers
