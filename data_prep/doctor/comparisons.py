"""What of a clip constrains each other, in numbers: medians that few moving things cannot change.

Axes: ``h w`` pixels, ``n`` points. Everything is float64.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.clip import Clip, View
from diff4splat.data.consistency.pixels import rotation_errors
from diff4splat.data.consistency.sampling import sample
from diff4splat.data_prep.doctor.matches import Matches, epipolar_distance_px
from diff4splat.geometry.camera import project
from diff4splat.geometry.depth import unproject
from diff4splat.geometry.rays import pixel_centers

MOST_PIXELS = 20_000
"""Per pair of frames; more change no median."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """One kind of comparison."""

    name: str
    unit: str
    limit: float
    meaning: str


COMPARISONS = (
    Comparison(
        name="rotation", unit="", limit=1e-5, meaning="rotations: determinant +1, orthonormal"
    ),
    Comparison(
        name="depth", unit="%", limit=2.0, meaning="depth of a frame, seen from a later one"
    ),
    Comparison(name="eyes", unit="%", limit=2.0, meaning="depth of one view, seen from the other"),
    Comparison(name="flow", unit="px", limit=0.5, meaning="flow against depth and cameras"),
    Comparison(name="tracks", unit="px", limit=0.35, meaning="3D tracks against their pixels"),
    Comparison(name="track_depth", unit="%", limit=3.0, meaning="3D tracks against depth"),
    Comparison(name="matches", unit="px", limit=1.0, meaning="matched corners against cameras"),
)


def measured(clip: Clip, matches: Matches | None) -> dict[str, float | None]:
    """The median of each comparison in its unit; None where the clip lacks the data."""
    first = clip.views[0]
    return {
        "rotation": max(float(rotation_errors(view.cameras).max()) for view in clip.views),
        "depth": _percent(_over_time(first)),
        "eyes": _percent(_between_views(clip)),
        "flow": _median(_flow(first)),
        "tracks": _median(_tracks(clip)),
        "track_depth": _percent(_track_depth(clip)),
        "matches": None if matches is None else epipolar_distance_px(first.cameras, matches),
    }


def step_of(frames: int) -> int:
    """Frames between the two that are compared: neighbours would hide wrong cameras."""
    return max(1, frames // 2)


def camera_motion(view: View) -> float:
    """Largest way of the camera over the median depth; over 1 m without depth."""
    position = view.cameras.position
    way = float((position - position[0]).norm(dim=-1).max())
    known = None if view.depth is None else view.depth[view.depth > 0]
    return way / float(known.median()) if known is not None and len(known) else way


def _over_time(view: View) -> Tensor:
    if view.depth is None:
        return torch.zeros(0)
    step = step_of(len(view.depth))
    pairs = [(t, t + step) for t in range(0, len(view.depth) - step, max(1, step // 2))]
    return _joined([depth_errors(view, a, view, b)[1] for a, b in pairs])


def _between_views(clip: Clip) -> Tensor:
    seeing = [view for view in clip.views if view.depth is not None]
    return _joined([depth_errors(seeing[0], 0, other, 0)[1] for other in seeing[1:]])


def depth_errors(
    here: View, frame: int, there: View, other: int
) -> tuple[Float[Tensor, "n 2"], Float[Tensor, " n"]]:
    """(pixel, relative error) of points of one frame whose depth another frame shows."""
    points, centers = _points(here, frame)
    uv, z = project(there.cameras[other].to(torch.float64), points)
    sampled = sample(there.depth[other].double(), uv)
    usable = sampled.smooth & (z > 0)
    return centers[usable], ((z - sampled.depth).abs() / sampled.depth)[usable]


def flow_of_cameras(view: View, frame: int) -> tuple[Tensor, Tensor]:
    """(pixel centres, displacement to the next frame if nothing moved) where there is depth."""
    points, centers = _points(view, frame)
    uv, _ = project(view.cameras[frame + 1].to(torch.float64), points)
    return centers, uv - centers


def _points(view: View, frame: int) -> tuple[Float[Tensor, "n 3"], Float[Tensor, "n 2"]]:
    depth = view.depth[frame].double()
    known = (depth > 0).flatten().nonzero()[:, 0]
    known = known[:: max(1, len(known) // MOST_PIXELS)]
    points = unproject(view.cameras[frame].to(torch.float64), depth).reshape(-1, 3)[known]
    return points, pixel_centers(depth.shape, depth).reshape(-1, 2)[known]


def _flow(view: View) -> Tensor:
    if view.flow is None or view.depth is None:
        return torch.zeros(0)
    errors = []
    for frame in range(len(view.flow.to_next)):
        centers, expected = flow_of_cameras(view, frame)
        column, row = centers.long().unbind(-1)
        known = view.flow.known[frame][row, column]
        given = view.flow.to_next[frame][row, column].double()
        errors.append((given - expected).norm(dim=-1)[known])
    return _joined(errors)


def projected_tracks(clip: Clip) -> tuple[Tensor, Tensor, Tensor] | None:
    """(given pixels, projected pixels, z) of the visible points, and None without tracks."""
    view = clip.views[0]
    if clip.tracks is None or view.track_uv is None or view.track_visible is None:
        return None
    uv, z = project(view.cameras.to(torch.float64), clip.tracks.positions.double())
    seen = view.track_visible
    return view.track_uv.double()[seen], uv[seen], z[seen]


def _tracks(clip: Clip) -> Tensor:
    found = projected_tracks(clip)
    if found is None or _made_of_each_other(clip):
        return torch.zeros(0)
    return (found[0] - found[1]).norm(dim=-1)


def _made_of_each_other(clip: Clip) -> bool:
    """Pixels and depth that a reader made of 3D tracks say nothing about these."""
    return clip.note.track_source == "estimated"


def _track_depth(clip: Clip) -> Tensor:
    view = clip.views[0]
    if projected_tracks(clip) is None or view.depth is None or _made_of_each_other(clip):
        return torch.zeros(0)
    _, z = project(view.cameras.to(torch.float64), clip.tracks.positions.double())
    errors = []
    for frame in range(clip.frames):
        seen = view.track_visible[frame]
        sampled = sample(view.depth[frame].double(), view.track_uv[frame][seen].double())
        relative = (z[frame][seen] - sampled.depth).abs() / sampled.depth
        errors.append(relative[sampled.smooth])
    return _joined(errors)


def _joined(errors: list[Tensor]) -> Tensor:
    return torch.cat([torch.zeros(0, dtype=torch.float64), *errors])


def _median(errors: Tensor) -> float | None:
    return float(errors.median()) if len(errors) else None


def _percent(errors: Tensor) -> float | None:
    found = _median(errors)
    return None if found is None else 100 * found
