"""Point tracks: points sampled at pixel centres and tracked through all frames and views.

Axes: ``t`` frames, ``n`` points. A point is a triangle with barycentric weights.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from diff4splat.data_prep.synthetic.renderer.cameras import RenderCamera, sample_grid, to_camera
from diff4splat.data_prep.synthetic.renderer.ground_truth.maps import GroundTruth, camera_vertices
from diff4splat.data_prep.synthetic.renderer.ground_truth.occlusion import visible_points
from diff4splat.data_prep.synthetic.renderer.jit import kernel
from diff4splat.data_prep.synthetic.renderer.rasterise import NEAR_M, weights
from diff4splat.data_prep.synthetic.renderer.triangle_buffer import TriangleBuffer

_FRAMES = 5
"""Number of frames in which points are sampled."""
_FAR_PX = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackPoints:
    """Surface points, and the pixel centre at which each was sampled."""

    triangles: Int64[np.ndarray, " n"]
    weights: Float64[np.ndarray, "n 3"]
    sampled_at: Int64[np.ndarray, "n 2"]
    """(view, frame)"""
    sampled_px: Float64[np.ndarray, "n 2"]


def choose_track_points(
    buffer: TriangleBuffer,
    truths: list[list[GroundTruth]],
    lenses: list[list[RenderCamera]],
    count: int,
) -> TrackPoints:
    """At most ``count`` points, half of them on moving surfaces if enough are visible."""
    picks = _spread(*_candidates(buffer, truths), count)
    triangles, shares, centers = np.zeros(len(picks), np.int64), np.zeros((len(picks), 3)), []
    for at, (view, frame, row, column) in enumerate(picks.tolist()):
        triangles[at] = truths[view][frame].triangles[row, column]
        centers.append((column + 0.5, row + 0.5))
    for view, frame in np.unique(picks[:, :2], axis=0).tolist():
        here = (picks[:, 0] == view) & (picks[:, 1] == frame)
        part, lens = np.zeros((int(here.sum()), 3)), lenses[view][frame]
        pixel_weights(
            camera_vertices(buffer, frame, lens), buffer.triangles, triangles[here],
            sample_grid(lens, 1), picks[here], part,
        )  # fmt: skip
        shares[here] = part
    return TrackPoints(
        triangles=triangles,
        weights=shares,
        sampled_at=picks[:, :2].copy(),
        sampled_px=np.array(centers).reshape(-1, 2),
    )


def _candidates(
    buffer: TriangleBuffer, truths: list[list[GroundTruth]]
) -> tuple[Int64[np.ndarray, "m 4"], Bool[np.ndarray, " m"]]:
    """(view, frame, row, column) of pixels covered by a surface, and whether it moves."""
    frames = len(truths[0])
    chosen = sorted({round(step * (frames - 1) / (_FRAMES - 1)) for step in range(_FRAMES)})
    places, moves = [np.zeros((0, 4), np.int64)], [np.zeros(0, np.bool_)]
    for frame in chosen:
        for view, truth in enumerate(row[frame] for row in truths):
            rows, columns = np.nonzero(truth.triangles >= 0)
            where = np.empty((len(rows), 4), np.int64)
            where[:, 0], where[:, 1], where[:, 2], where[:, 3] = view, frame, rows, columns
            places.append(where)
            moves.append(truth.triangles[rows, columns] >= buffer.static_count)
    return np.concatenate(places), np.concatenate(moves)


def _spread(
    places: Int64[np.ndarray, "m 4"], moves: Bool[np.ndarray, " m"], count: int
) -> Int64[np.ndarray, "n 4"]:
    """Candidates evenly over views, frames and rows, in the order they come."""
    moving, still = places[moves], places[~moves]
    first = min(len(moving), max((count + 1) // 2, count - len(still)))
    return np.concatenate([_every(moving, first), _every(still, min(len(still), count - first))])


def _every(places: Int64[np.ndarray, "m 4"], count: int) -> Int64[np.ndarray, "n 4"]:
    """``count`` of them: one from each of as many equal parts, where a hash says."""
    order = np.arange(count, dtype=np.int64)
    shift = ((order * 2654435761) >> 7) & 0xFFFF
    return places[((order * 65536 + shift) * len(places)) // (max(count, 1) * 65536)]


@kernel
def pixel_weights(local, triangles, chosen, grid, picks, shares):
    """Barycentric weights at pixel centres."""
    for at in range(len(chosen)):
        x, y = grid.x[0, picks[at, 3]], grid.y[picks[at, 2]]
        shares[at, 0], shares[at, 1], shares[at, 2] = weights(local, triangles, chosen[at], x, y)


def track_positions(buffer: TriangleBuffer, points: TrackPoints) -> Float64[np.ndarray, "t n 3"]:
    """World positions over time."""
    corners = buffer.triangles[points.triangles]
    a, b, c = (buffer.positions[:, corners[:, corner]] for corner in range(3))
    share = points.weights
    moved = a * share[:, :1] + b * share[:, 1:2] + c * share[:, 2:]
    # As gathered, frames are not the slowest axis: kernels would compile for that order too.
    return np.ascontiguousarray(moved)


def observe_points(
    buffer: TriangleBuffer,
    points: TrackPoints,
    positions: Float64[np.ndarray, "n 3"],
    lens: RenderCamera,
    place: tuple[int, int],
) -> tuple[Float64[np.ndarray, "n 2"], Bool[np.ndarray, " n"]]:
    """Pixel coordinates and visibility in the (view, frame) ``place``.

    At its sampling frame a point has the exact coordinates of the pixel centre.
    """
    local = np.empty_like(positions)
    to_camera(positions, lens, local)
    z = np.maximum(local[:, 2], NEAR_M)
    seen = np.empty_like(positions)
    for axis in range(2):
        seen[:, axis] = local[:, axis] / z * lens.focal[axis] + lens.center[axis]
    found = (points.sampled_at[:, 0] == place[0]) & (points.sampled_at[:, 1] == place[1])
    seen[found, :2] = points.sampled_px[found]
    seen[:, 2] = np.where(local[:, 2] >= NEAR_M, 1.0 / z, -1.0)
    shown = visible_points(
        camera_vertices(buffer, place[1], lens), buffer.triangles, lens, seen, points.triangles
    )
    return np.clip(seen[:, :2], -_FAR_PX, _FAR_PX), shown
