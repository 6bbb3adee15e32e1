"""End-point errors of tracked points.

Axes: ``t`` times, ``n`` points. A point is tracked from every source frame in which it is visible
in the input view on the correct object. Its error at a time is the distance between the predicted
and the true offset from the source frame. Points that are occluded later count too.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.evaluation.measures.images import Entries
from diff4splat.evaluation.protocols.protocol import Protocol
from diff4splat.evaluation.protocols.sample import EvalSample
from diff4splat.evaluation.records import Score, Skip
from diff4splat.evaluation.systems.predictions import PointQuery, Prediction
from diff4splat.metrics.tracks import track_endpoint_error
from diff4splat.training.batches.targets import visible_cells

MIN_MOTION = 1e-3
"""Mean true offset in model units below which a clip counts as static."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackedPoints:
    """Points of one source frame, and their true offsets."""

    query: PointQuery
    offsets: Float[Tensor, "t n 3"]


def tracked_points(sample: EvalSample, protocol: Protocol) -> list[TrackedPoints]:
    """The tracked points of every source frame that shows any."""
    view, tracks = sample.input_view, sample.clip.tracks
    if tracks is None or view.track_uv is None or view.track_visible is None:
        return []
    tracked = []
    for frame in sample.targets.source_frames:
        times = [later for later in protocol.track_frames if later != frame]
        points, cells = _visible_points(sample, frame)
        if len(points) == 0 or not times:
            continue
        positions = tracks.positions.double()
        query = PointQuery(
            camera=view.cameras[frame],
            source_s=sample.time_s(frame),
            cells=cells,
            times_s=tuple(sample.time_s(later) for later in times),
        )
        true = positions[times][:, points] - positions[frame, points]
        tracked.append(TrackedPoints(query=query, offsets=true.float()))
    return tracked


def track_entries(
    row: str, sample: EvalSample, prediction: Prediction, tracked: list[TrackedPoints]
) -> Entries:
    """End-point error, and its ratio to the error of zero motion."""
    keys = ("track_error", "track_ratio")
    predicted = [prediction.offsets(points.query) for points in tracked]
    if any(offsets is None for offsets in predicted):
        return []
    if not tracked or not sample.has_depth:
        why = "no tracked point in a source frame" if sample.has_depth else "the clip has no depth"
        return [Skip(row=row, key=key, why=why) for key in keys]
    error = _end_point_error(predicted, tracked)
    zeros = [torch.zeros_like(points.offsets) for points in tracked]
    zero_motion_error = _end_point_error(zeros, tracked)
    entries: Entries = [Score(row=row, key=keys[0], value=round(error, 6))]
    if zero_motion_error < MIN_MOTION:
        return [*entries, Skip(row=row, key=keys[1], why="nothing moves in the clip")]
    return [*entries, Score(row=row, key=keys[1], value=round(error / zero_motion_error, 6))]


def _end_point_error(
    predicted: list[Float[Tensor, "_t _n 3"]], tracked: list[TrackedPoints]
) -> float:
    """Mean over all points, times and source frames."""
    estimated = torch.cat([offsets.cpu().float().flatten(0, 1) for offsets in predicted])
    true = torch.cat([points.offsets.flatten(0, 1) for points in tracked])
    return float(track_endpoint_error(estimated, true, torch.ones(len(true), dtype=torch.bool)))


def _visible_points(sample: EvalSample, frame: int) -> tuple[Int[Tensor, " n"], Int[Tensor, "n 2"]]:
    """Points visible in ``frame`` of the input view on the correct object, and their pixels."""
    visible = visible_cells(sample.clip)
    visible = visible[visible[:, 1] == frame]
    return visible[:, 0], visible[:, 2:]
