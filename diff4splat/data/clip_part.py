"""Which part of a clip to read: training pays only for what it uses."""

from dataclasses import dataclass
from itertools import pairwise

from diff4splat.data.entry import ClipEntry
from diff4splat.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class ClipPart:
    """Frames and views by number, in the order wanted; None is all.

    Lengths and poses stay as they are in the whole clip: the world frame is that of its first
    camera, whether that is chosen or not.
    """

    frames: tuple[int, ...] | None = None
    """Increasing. Frames that do not follow each other have no flow between them."""
    views: tuple[int, ...] | None = None
    flow: bool = True
    instances: bool = True
    masks: bool = True
    """Of sky and of what moves."""
    tracks: bool = True


FULL_CLIP = ClipPart()
"""Everything that is stored."""


def chosen_frames(part: ClipPart, entry: ClipEntry) -> tuple[int, ...]:
    """The numbers of the frames to read.

    Raises:
        InputError: none, outside the clip, out of order, or with gaps where flow is wanted.
    """
    frames = _within(part.frames, entry.frames, "frames")
    steps = [after - before for before, after in pairwise(frames)]
    if any(step < 1 for step in steps):
        raise InputError(f"frames: expected increasing numbers, got {frames}")
    if part.flow and any(step != 1 for step in steps):
        raise InputError(
            f"frames: expected neighbours where flow is read, got {frames}; set flow to False"
        )
    return frames


def chosen_views(part: ClipPart, entry: ClipEntry) -> tuple[int, ...]:
    """The numbers of the views to read, in the order wanted.

    Raises:
        InputError: none, outside the clip, or one twice.
    """
    views = _within(part.views, entry.views, "views")
    if len(set(views)) != len(views):
        raise InputError(f"views: expected each at most once, got {views}")
    return views


def _within(numbers: tuple[int, ...] | None, count: int, what: str) -> tuple[int, ...]:
    if numbers is None:
        return tuple(range(count))
    if not numbers or not all(0 <= number < count for number in numbers):
        raise InputError(f"{what}: expected one or more of 0 to {count - 1}, got {numbers}")
    return numbers
