"""Where followed points go, against the truth.

Axes: ``t`` times, ``n`` points. A point is followed from every source frame in which the input view
sees it on its own object; its error at a time is the distance between its predicted and its true
offset from there. Points hidden later count too: a scene knows where they are.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.evaluation.picture_measures import Entries
from diff4splat.evaluation.predictions import Answer, PointQuery
from diff4splat.evaluation.protocol import Protocol
from diff4splat.evaluation.records import Score, Skip
from diff4splat.evaluation.sample import Case
from diff4splat.metrics.tracks import track_endpoint_error
from diff4splat.training.batches.targets import visible_cells

MIN_MOTION = 1e-3
"""Mean true offset, in model units, below which a clip has no motion to compare with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Followed:
    """Points of one source frame with their true offsets."""

    query: PointQuery
    offsets: Float[Tensor, "t n 3"]


def followed_points(case: Case, protocol: Protocol) -> list[Followed]:
    """One record per source frame that shows any tracked point."""
    view, tracks = case.input_view, case.clip.tracks
    if tracks is None or view.track_uv is None or view.track_visible is None:
        return []
    found = []
    for frame in case.judged.source_frames:
        times = [later for later in protocol.track_frames if later != frame]
        points, cells = _seen(case, frame)
        if len(points) == 0 or not times:
            continue
        positions = tracks.positions.double()
        query = PointQuery(
            camera=view.cameras[frame],
            source_s=case.time_s(frame),
            cells=cells,
            times_s=tuple(case.time_s(later) for later in times),
        )
        true = positions[times][:, points] - positions[frame, points]
        found.append(Followed(query=query, offsets=true.float()))
    return found


def track_entries(row: str, case: Case, answer: Answer, followed: list[Followed]) -> Entries:
    """End-point error and its share of standing still's."""
    keys = ("track_error", "track_ratio")
    predicted = [answer.offsets(one.query) for one in followed]
    if any(offsets is None for offsets in predicted):
        return []
    if not followed or not case.has_depth:
        why = "no tracked point in a source frame" if case.has_depth else "the clip has no depth"
        return [Skip(row=row, key=key, why=why) for key in keys]
    error = _end_point_error(predicted, followed)
    still = _end_point_error([torch.zeros_like(one.offsets) for one in followed], followed)
    entries: Entries = [Score(row=row, key=keys[0], value=round(error, 6))]
    if still < MIN_MOTION:
        return [*entries, Skip(row=row, key=keys[1], why="nothing moves in the clip")]
    return [*entries, Score(row=row, key=keys[1], value=round(error / still, 6))]


def _end_point_error(predicted: list[Float[Tensor, "_t _n 3"]], followed: list[Followed]) -> float:
    """Over all points, times and source frames alike."""
    own = torch.cat([offsets.cpu().float().flatten(0, 1) for offsets in predicted])
    true = torch.cat([one.offsets.flatten(0, 1) for one in followed])
    return float(track_endpoint_error(own, true, torch.ones(len(true), dtype=torch.bool)))


def _seen(case: Case, frame: int) -> tuple[Int[Tensor, " n"], Int[Tensor, "n 2"]]:
    """Points that the input view shows in ``frame`` on their own object, and their pixels."""
    seen = visible_cells(case.clip)
    seen = seen[seen[:, 1] == frame]
    return seen[:, 0], seen[:, 2:]
