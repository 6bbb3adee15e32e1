"""Depth, flow and cameras against each other per pixel, in double precision."""

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
"""Relative depth difference in front of the visible surface that counts as a contradiction."""


def rotation_errors(camera: Camera) -> Float[Tensor, " t"]:
    """Largest entry of RᵀR − I or of det R − 1, per pose."""
    rotation = camera.world_from_camera[:, :3, :3].double()
    off = (rotation.mT @ rotation - torch.eye(3, dtype=torch.float64)).abs().amax((-1, -2))
    return torch.maximum(off, (torch.linalg.det(rotation) - 1).abs())


def over_time(clip: Clip, view: View) -> Iterator[Float[Tensor, " n"]]:
    """Relative depth errors from each frame to the one half the clip later.

    Adjacent frames would hide wrong cameras, because their displacement is small.
    """
    static = static_pixels(clip, view)
    if static is None or view.depth is None:
        return
    step = max(1, clip.frames // 2)
    for here, there in enumerate(range(step, clip.frames)):
        points = _points(view, here, static[here])
        z, sampled = _reproject(view, there, points, static[there])
        yield ((z - sampled.depth).abs() / sampled.depth)[sampled.smooth & (z > 0)]


def across_views(clip: Clip) -> Iterator[Bool[Tensor, " n"]]:
    """Whether points of one view lie on or behind the surface that each other view sees."""
    with_depth = [view for view in clip.views if view.depth is not None]
    for here, there in permutations(with_depth, 2):
        for frame in range(clip.frames):
            every = torch.ones(clip.size_px, dtype=torch.bool)
            z, sampled = _reproject(there, frame, _points(here, frame, every), every)
            yield (z >= sampled.depth * (1 - _BEFORE))[sampled.smooth & (z > 0)]


def flow_errors(clip: Clip, view: View) -> Iterator[Float[Tensor, " n"]]:
    """Distance in pixels between stored flow and flow from depth and cameras, per frame."""
    static = static_pixels(clip, view)
    if static is None or view.flow is None or view.depth is None:
        return
    centers = pixel_centers(clip.size_px, view.cameras.focal_px.double())
    for frame in range(clip.frames - 1):
        shown = static[frame] & view.flow.known[frame] & (view.depth[frame] > 0)
        uv, z = project(_camera(view, frame + 1), _points(view, frame, shown))
        stored = view.flow.to_next[frame][shown].double()
        yield (stored - (uv - centers[shown])).norm(dim=-1)[z > 0]


def _camera(view: View, frame: int) -> Camera:
    return view.cameras[frame].to(torch.float64)


def _points(view: View, frame: int, chosen: Bool[Tensor, "h w"]) -> Float[Tensor, "n 3"]:
    """World points of the chosen pixels that have depth."""
    depth = view.depth[frame].double()
    return unproject(_camera(view, frame), depth)[chosen & (depth > 0)]


def _reproject(
    view: View, frame: int, points: Float[Tensor, "n 3"], usable: Bool[Tensor, "h w"]
) -> tuple[Float[Tensor, " n"], Sampled]:
    """Depth z of the points in a frame, and the depth of its usable pixels at their projections."""
    uv, z = project(_camera(view, frame), points)
    depth = torch.where(usable, view.depth[frame].double(), 0.0)
    return z, sample(depth, uv)
