"""What depth, flow and cameras say of each other, pixel by pixel. Computed in double precision."""

from collections.abc import Iterator
from itertools import permutations

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.data.clip import Clip, View
from diff4splat.data.consistency.sampling import Sampled, sample
from diff4splat.data.consistency.static_pixels import static_pixels
from diff4splat.geometry.camera import Camera, project
from diff4splat.geometry.depth import unproject
from diff4splat.geometry.rays import pixel_centers

_BEFORE = 0.02
"""Nearer than what is seen there by this much, relative, is a contradiction."""


def rotation_errors(camera: Camera) -> Float[Tensor, " t"]:
    """Largest entry of RᵀR − I or of det R − 1, per pose."""
    rotation = camera.world_from_camera[:, :3, :3].double()
    off = (rotation.mT @ rotation - torch.eye(3, dtype=torch.float64)).abs().amax((-1, -2))
    return torch.maximum(off, (torch.linalg.det(rotation) - 1).abs())


def over_time(clip: Clip, view: View) -> Iterator[Float[Tensor, " n"]]:
    """Relative depth errors from each frame to the one half the clip later.

    From frame to frame even wrong cameras move little, and the median would not notice.
    """
    still = static_pixels(clip, view)
    if still is None:
        return
    step = max(1, clip.frames // 2)
    for here, there in enumerate(range(step, clip.frames)):
        points = _points(view, here, still[here])
        z, seen = _carried(view, there, points, still[there])
        yield ((z - seen.depth).abs() / seen.depth)[seen.smooth & (z > 0)]


def across_views(clip: Clip) -> Iterator[Bool[Tensor, " n"]]:
    """Whether points of one view lie at, or hidden behind, what each other sees there and then."""
    for here, there in permutations(clip.views, 2):
        for frame in range(clip.frames):
            every = torch.ones(clip.size_px, dtype=torch.bool)
            z, seen = _carried(there, frame, _points(here, frame, every), every)
            yield (z >= seen.depth * (1 - _BEFORE))[seen.smooth & (z > 0)]


def flow_errors(clip: Clip, view: View) -> Iterator[Float[Tensor, " n"]]:
    """Pixels between stored flow and that of depth and cameras, frame by frame."""
    still = static_pixels(clip, view)
    if still is None or view.flow is None:
        return
    centers = pixel_centers(clip.size_px, view.cameras.focal_px.double())
    for frame in range(clip.frames - 1):
        shown = still[frame] & view.flow.known[frame] & (view.depth[frame] > 0)
        uv, z = project(_camera(view, frame + 1), _points(view, frame, shown))
        stored = view.flow.to_next[frame][shown].double()
        yield (stored - (uv - centers[shown])).norm(dim=-1)[z > 0]


def _camera(view: View, frame: int) -> Camera:
    return view.cameras[frame].to(torch.float64)


def _points(view: View, frame: int, chosen: Bool[Tensor, "h w"]) -> Float[Tensor, "n 3"]:
    """World points of the chosen pixels that have depth."""
    depth = view.depth[frame].double()
    return unproject(_camera(view, frame), depth)[chosen & (depth > 0)]


def _carried(
    view: View, frame: int, points: Float[Tensor, "n 3"], usable: Bool[Tensor, "h w"]
) -> tuple[Float[Tensor, " n"], Sampled]:
    """The z of the points in a frame, and the depth of its usable pixels where they fall."""
    uv, z = project(_camera(view, frame), points)
    depth = torch.where(usable, view.depth[frame].double(), 0.0)
    return z, sample(depth, uv)
