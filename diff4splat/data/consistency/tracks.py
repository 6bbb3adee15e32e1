"""Tracks against cameras, depth and flow, in double precision.

Axes: ``t`` frames, ``n`` tracks, ``m`` of them with their query pixel in the view.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.data.clip import Clip, Tracks, View
from diff4splat.data.consistency.sampling import sample
from diff4splat.geometry.camera import project

_SAME_DEPTH = 0.03
"""Largest relative difference between a visible point and the depths around it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class QueryErrors:
    """Errors of tracks at their query pixels in one view."""

    pixel_px: Float[Tensor, " m"]
    """Distance of ``uv`` to the nearest pixel centre."""
    depth: Float[Tensor, " m"]
    """Relative error of z; 1 where depth is unknown."""
    flow_px: Float[Tensor, " k"]
    """Flow against the displacement of ``uv``, where flow is known."""
    visible: Bool[Tensor, " m"]


@dataclass(frozen=True, slots=True, kw_only=True)
class VisibleErrors:
    """Errors of all tracks in one view, where they are visible."""

    projection_px: Float[Tensor, " k"]
    at_depth: Bool[Tensor, " k"]
    """Whether the depths of the four nearest pixels span z; also valid at edges."""


def compare_at_query(clip: Clip, number: int) -> QueryErrors | None:
    """Errors of the tracks with query pixels in view ``number``; None without tracks or depth."""
    view, tracks = clip.views[number], clip.tracks
    if tracks is None or view.track_uv is None or view.track_visible is None or view.depth is None:
        return None
    chosen = (tracks.found_at[:, 0] == number).nonzero()[:, 0]
    frames = tracks.found_at[chosen, 1]
    uv = view.track_uv[frames, chosen].double()
    pixel = uv.floor()
    limit = torch.tensor(clip.size_px[::-1], dtype=torch.float64)
    column, row = torch.minimum(pixel.nan_to_num().clamp(min=0), limit - 1).long().unbind(-1)
    depth = view.depth[frames, row, column].double()
    z = _positions(view, tracks)[1][frames, chosen]
    return QueryErrors(
        pixel_px=(uv - pixel - 0.5).norm(dim=-1),
        depth=torch.where(depth > 0, (z - depth).abs() / depth.clamp(min=1e-12), 1.0),
        flow_px=_flow_steps(view, chosen, frames, (row, column)),
        visible=view.track_visible[frames, chosen],
    )


def compare_where_visible(clip: Clip, view: View) -> VisibleErrors | None:
    """Errors of all tracks in ``view``; None without track projections."""
    if clip.tracks is None or view.track_uv is None or view.track_visible is None:
        return None
    uv, z = _positions(view, clip.tracks)
    off = (uv - view.track_uv.double()).norm(dim=-1)[view.track_visible]
    agrees = [torch.zeros(0, dtype=torch.bool)]
    if view.depth is not None:
        agrees += [
            _at_depth(depth.double(), places[visible].double(), z_now[visible])
            for depth, places, z_now, visible in zip(
                view.depth, view.track_uv, z, view.track_visible, strict=True
            )
        ]
    return VisibleErrors(projection_px=off, at_depth=torch.cat(agrees))


def _positions(view: View, tracks: Tracks) -> tuple[Tensor, Tensor]:
    return project(view.cameras.to(torch.float64), tracks.positions.double())


def _flow_steps(
    view: View,
    chosen: Int[Tensor, " m"],
    frames: Int[Tensor, " m"],
    pixel: tuple[Int[Tensor, " m"], Int[Tensor, " m"]],
) -> Float[Tensor, " k"]:
    """Flow against the displacement of ``uv`` at query pixels with known flow."""
    if view.flow is None or view.track_uv is None or not len(view.flow.known):
        return torch.zeros(0, dtype=torch.float64)
    # The last frame has no next one: look up any frame, and mask it out.
    before = frames.clamp(max=len(view.flow.known) - 1)
    known = view.flow.known[before, *pixel] & (before == frames)
    step = view.track_uv[before + 1, chosen].double() - view.track_uv[before, chosen].double()
    return (view.flow.to_next[before, *pixel].double() - step).norm(dim=-1)[known]


def _at_depth(
    depth: Float[Tensor, "h w"], uv: Float[Tensor, "k 2"], z: Float[Tensor, " k"]
) -> Bool[Tensor, " k"]:
    corners = sample(depth, uv).corners
    nearest = torch.where(corners > 0, corners, torch.inf).amin(-1)
    return (z >= nearest * (1 - _SAME_DEPTH)) & (z <= corners.amax(-1) * (1 + _SAME_DEPTH))
