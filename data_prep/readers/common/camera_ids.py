"""Which pictures one camera took, where a file lists poses and times alone.

Axes: ``f`` frames. Poses that come back are standing cameras. Otherwise one camera moves, and the
second picture of a time is of a second camera.
"""

from collections import Counter

from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.split import same_view_groups

_FEWEST_RETURNS = 2
"""Pictures per pose, in the mean, that make a pose a standing camera."""


def assign_camera_ids(world_from_camera: Float[Tensor, "f 4 4"], times_s: list[float]) -> list[int]:
    """A number from 0 for each frame, in the order in which cameras first appear."""
    groups = _by_appearance(same_view_groups(world_from_camera).tolist())
    standing = len(times_s) >= _FEWEST_RETURNS * len(set(groups))
    once = len(set(zip(groups, times_s, strict=True))) == len(times_s)
    return groups if standing and once else _by_turn(times_s)


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
