"""Which images and points of a clip a sample is evaluated on.

Axes: ``f`` frames, ``m`` target times, ``p`` views per time, ``n`` points. At least half of the
images come from other cameras than the input's: supervision by the input views alone over-fits
them (Wonderland §3.3, in effect).
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.data.clip import Clip
from diff4splat.training.recipe.data import DataSettings

INPUT_VIEW = 0
MIN_MOTION = 0.02
"""Displacement of a point that counts as motion; the plane is at depth 4."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Targets:
    """Frames, and for each of them views."""

    frames: Int[Tensor, " m"]
    views: Int[Tensor, "m p"]
    image_frames: Int[Tensor, "m p"]
    """Frame of each image: that of its row, or another frame of a static clip."""

    def images(self) -> list[list[tuple[int, int]]]:
        """(view, frame) of every image, by row."""
        rows = zip(self.views.tolist(), self.image_frames.tolist(), strict=True)
        return [list(zip(views, frames, strict=True)) for views, frames in rows]

    def at_first_frame(self) -> "Targets":
        """The same views, all of the first frame."""
        still = torch.zeros_like(self.image_frames)
        return Targets(frames=torch.zeros_like(self.frames), views=self.views, image_frames=still)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackTargets:
    """Points seen by the input view and where they go; padded to one length."""

    cell: Int[Tensor, "n 3"]
    offset: Float[Tensor, "m n 3"]
    valid: Bool[Tensor, " n"]


def draw_targets(
    frames: int,
    views: int,
    settings: DataSettings,
    generator: torch.Generator,
    *,
    is_static: bool = False,
) -> Targets:
    """Different times, and per time another camera's view and, if there is room, the input's.

    A clip of fewer cameras than the recipe's gives as many images: of a static one the camera at
    another frame is another view; of a moving one the input view counts for both.
    """
    per_time = 2 if settings.views > 1 and settings.target_frames > 1 else 1
    count = min(max(settings.target_frames // per_time, 1), frames)
    times = torch.randperm(frames, generator=generator)[:count].sort().values
    chosen = torch.zeros(count, per_time, dtype=torch.long)
    shown = times[:, None].repeat(1, per_time)
    if views > 1:
        chosen[:, 0] = torch.randint(1, views, (count,), generator=generator)
    elif is_static and settings.views > 1:
        shown[:, 0] = torch.randint(frames, (count,), generator=generator)
    return Targets(frames=times, views=chosen, image_frames=shown)


def draw_tracks(
    clip: Clip,
    target_frames: Int[Tensor, " m"],
    settings: DataSettings,
    generator: torch.Generator,
) -> TrackTargets:
    """Points, each at one of the input frames in which the input view sees it."""
    count, seen = settings.tracks, visible_cells(clip)
    seen = seen[_known_at(clip, target_frames)[seen[:, 0]]]
    seen = seen[seen[:, 1] % (settings.input_stride * settings.keyframe_stride) == 0]
    chosen = torch.randperm(len(seen), generator=generator)
    # One cell per point: the first of its frames in random order.
    point = seen[chosen, 0]
    first = _first_of_each(point)
    seen = _balanced(seen[chosen[first]], clip, count)
    offset = torch.zeros(len(target_frames), count, 3)
    cell = torch.zeros(count, 3, dtype=torch.long)
    valid = torch.arange(count) < len(seen)
    if len(seen):
        cell[: len(seen)] = seen[:, 1:]
        cell[:, 0] //= settings.input_stride
        positions = clip.tracks.positions
        here = positions[seen[:, 1], seen[:, 0]]
        offset[:, : len(seen)] = positions[target_frames][:, seen[:, 0]] - here
    return TrackTargets(cell=cell, offset=offset, valid=valid)


def _known_at(clip: Clip, frames: Int[Tensor, " m"]) -> Bool[Tensor, " n"]:
    """Points that the source has in all of these frames: elsewhere their positions are no truth."""
    if clip.tracks is None:
        return torch.zeros(0, dtype=torch.bool)
    if clip.tracks.known is None:
        return torch.ones(clip.tracks.positions.shape[1], dtype=torch.bool)
    return clip.tracks.known[frames].all(0)


def _balanced(seen: Int[Tensor, "u 4"], clip: Clip, count: int) -> Int[Tensor, "s 4"]:
    """Up to ``count`` rows; points that move come first, for at most half of them.

    Most points of most clips are static, and the median of their displacements, which a distance
    is minimised by, would be nothing at all.
    """
    if not len(seen):
        return seen
    positions, known = clip.tracks.positions[:, seen[:, 0]], clip.tracks.known
    here = positions[seen[:, 1], torch.arange(len(seen))]
    away = (positions - here).norm(dim=-1)
    if known is not None:
        away = torch.where(known[:, seen[:, 0]], away, 0.0)
    moves = away.amax(0) > MIN_MOTION
    first = moves & (moves.cumsum(0) <= count // 2)
    return torch.cat([seen[first], seen[~first & ~moves], seen[~first & moves]])[:count]


def visible_cells(clip: Clip) -> Int[Tensor, "s 4"]:
    """(point, frame, row, column) wherever the input view sees a point on its own object."""
    view = clip.views[INPUT_VIEW]
    if clip.tracks is None or view.track_uv is None or view.track_visible is None:
        return torch.zeros(0, 4, dtype=torch.long)
    frame, point = view.track_visible.nonzero(as_tuple=True)
    column, row = view.track_uv[frame, point].floor().long().unbind(-1)
    height, width = view.cameras.size_px
    inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    if view.instances is not None and clip.tracks.instances is not None:
        # Near an edge the pixel's centre may show another object than the point lies on.
        shown = view.instances[frame, row.clamp(0, height - 1), column.clamp(0, width - 1)]
        inside &= shown == clip.tracks.instances[point]
    return torch.stack([point, frame, row, column], -1)[inside]


def _first_of_each(values: Int[Tensor, " s"]) -> Int[Tensor, " u"]:
    """Positions of the first occurrence of every value, in order."""
    order = torch.argsort(values, stable=True)
    ordered = values[order]
    starts = torch.ones_like(ordered, dtype=torch.bool)
    starts[1:] = ordered[1:] != ordered[:-1]
    return order[starts].sort().values
