"""Which tracks can be trusted, and which of them move. Axes: ``t`` frames, ``n`` tracks.

Rules of the field, in units of the image: pips2's limits of velocity, acceleration and jerk;
depth at the track within 5 % of the depth map around it; visible in eight frames or more.
"""

from dataclasses import replace

import torch
from jaxtyping import Bool
from torch import Tensor

from diff4splat.data.clip import Clip
from diff4splat.data.consistency.sampling import sample
from diff4splat.errors import InputError
from diff4splat.geometry.camera import project

FEWEST_FRAMES = 8
_LIMITS = (0.4, 0.3, 0.1)
"""Velocity, acceleration and jerk per frame over the image size."""
_SAME_DEPTH = 0.05
_LEAST_AGREEING = 0.5
"""Share of visible points at the depth of the map."""
_LEAST_MOTION = 0.02
"""Displacement over the distance to the camera."""


def reliable_tracks(clip: Clip) -> Bool[Tensor, " n"]:
    """Long enough, smooth, and at the depth of the map where there is one.

    Raises:
        InputError: the clip has no tracks.
    """
    uv, visible = _seen(clip)
    fewest = min(FEWEST_FRAMES, clip.frames)
    good = (visible.sum(0) >= fewest) & _smooth(uv / max(clip.size_px), visible)
    return good if clip.views[0].depth is None else good & _at_depth(clip, uv, visible)


def moving_tracks(clip: Clip) -> Bool[Tensor, " n"]:
    """Displaced in the world by more than 2 % of the distance to the camera."""
    if clip.tracks is None:
        raise InputError("tracks: expected a clip with tracks, got none")
    positions = clip.tracks.positions.double()
    known = clip.tracks.known
    first = torch.zeros(positions.shape[1], dtype=torch.long)
    if known is not None:
        first = known.int().argmax(0)
    start = positions[first, torch.arange(positions.shape[1])]
    off = (positions - start).norm(dim=-1)
    if known is not None:
        off = torch.where(known, off, 0.0)
    distance = (start - clip.views[0].cameras.position[first]).norm(dim=-1)
    return off.amax(0) > _LEAST_MOTION * distance.clamp(min=1e-12)


def without_tracks(clip: Clip, kept: Bool[Tensor, " n"]) -> Clip:
    """The clip with the tracks of ``kept`` alone."""
    if clip.tracks is None:
        raise InputError("tracks: expected a clip with tracks, got none")
    tracks = replace(
        clip.tracks,
        positions=clip.tracks.positions[:, kept],
        known=None if clip.tracks.known is None else clip.tracks.known[:, kept],
        instances=None if clip.tracks.instances is None else clip.tracks.instances[kept],
        found_at=clip.tracks.found_at[kept],
    )
    views = tuple(
        view
        if view.track_uv is None
        else replace(
            view, track_uv=view.track_uv[:, kept], track_visible=view.track_visible[:, kept]
        )
        for view in clip.views
    )
    return replace(clip, tracks=tracks, views=views)


def _seen(clip: Clip) -> tuple[Tensor, Tensor]:
    view = clip.views[0]
    if view.track_uv is None or view.track_visible is None:
        raise InputError("tracks: expected a clip with tracks, got none")
    return view.track_uv.double(), view.track_visible


def _smooth(uv: Tensor, visible: Tensor) -> Tensor:
    """No jump between frames in which the point is visible all along."""
    good = torch.ones(uv.shape[1], dtype=torch.bool)
    change, whole = uv, visible
    for limit in _LIMITS:
        if len(change) < 2:
            break
        change, whole = change.diff(dim=0), whole[1:] & whole[:-1]
        good &= ~((change.norm(dim=-1) > limit) & whole).any(0)
    return good


def _at_depth(clip: Clip, uv: Tensor, visible: Tensor) -> Tensor:
    view = clip.views[0]
    _, z = project(view.cameras.to(torch.float64), clip.tracks.positions.double())
    agree, compared = torch.zeros(uv.shape[1]), torch.zeros(uv.shape[1])
    for frame in range(clip.frames):
        sampled = sample(view.depth[frame].double(), uv[frame])
        usable = sampled.smooth & visible[frame]
        close = (z[frame] / sampled.depth - 1).abs() <= _SAME_DEPTH
        agree, compared = agree + (usable & close), compared + usable
    return (compared == 0) | (agree >= _LEAST_AGREEING * compared)
