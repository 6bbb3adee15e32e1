"""A random temporal crop of a clip, or keyframes repeated to all frames.

Axes: ``f`` frames. The world of what is cut out is again its first input camera.
"""

from dataclasses import replace

import torch
from jaxtyping import Int
from torch import Tensor

from diff4splat.data.clip import Clip, Tracks
from diff4splat.data.view_labels import edited_labels
from diff4splat.errors import InputError
from diff4splat.training.batches.targets import INPUT_VIEW


def crop(clip: Clip, frames: int, generator: torch.Generator) -> Clip:
    """``frames`` consecutive frames from a random start; the new first camera is the identity.

    Raises:
        InputError: the clip has fewer frames.
    """
    if clip.frames < frames:
        raise InputError(
            f"clip {clip.note.identifier}: expected at least {frames} frames, got {clip.frames}; "
            "leave the clip out or train on shorter samples"
        )
    if clip.frames == frames:
        return clip
    first = int(torch.randint(clip.frames - frames + 1, (), generator=generator))
    return from_first_camera(_frames(clip, slice(first, first + frames)))


def at_frame_rate(clip: Clip, fps: float, least_frames: int) -> Clip:
    """Every k-th frame, so that the rate is nearest to ``fps`` with enough frames left.

    0, clips without a frame rate and slower clips keep every frame.
    """
    if not fps or clip.fps is None:
        return clip
    longest = (clip.frames - 1) // max(least_frames - 1, 1)
    step = max(min(round(clip.fps / fps), longest), 1)
    return clip if step == 1 else _frames(clip, slice(None, None, step))


def repeat_keyframes(clip: Clip, stride: int) -> Clip:
    """Keyframes as a full clip: each is repeated for the ``stride`` frames up to it."""
    every = torch.arange(1 + (clip.frames - 1) * stride)
    return _frames(clip, (every + stride - 1) // stride)


def _frames(clip: Clip, window: slice | Int[Tensor, " t"]) -> Clip:
    views = tuple(
        replace(
            view,
            **edited_labels(view, lambda label: label[window]),
            rgb=view.rgb[window],
            cameras=view.cameras[window],
            flow=None,
            track_uv=None if view.track_uv is None else view.track_uv[window],
            track_visible=None if view.track_visible is None else view.track_visible[window],
        )
        for view in clip.views
    )
    tracks = clip.tracks
    if tracks is not None:
        known = None if tracks.known is None else tracks.known[window]
        tracks = replace(drop_projections(tracks), positions=tracks.positions[window], known=known)
    return replace(clip, times_s=clip.times_s[window], views=views, tracks=tracks)


def drop_projections(tracks: Tracks) -> Tracks:
    """The same points without their source frames, which may lie outside the crop."""
    return replace(tracks, found_at=torch.full_like(tracks.found_at, -1))


def from_first_camera(clip: Clip) -> Clip:
    """The clip in the world of its first input camera."""
    first_from_world = clip.views[INPUT_VIEW].cameras.camera_from_world[0]
    views = tuple(
        replace(
            view, cameras=view.cameras.with_pose(first_from_world @ view.cameras.world_from_camera)
        )
        for view in clip.views
    )
    tracks = clip.tracks
    if tracks is not None:
        rotation, shift = first_from_world[:3, :3], first_from_world[:3, 3]
        moved = tracks.positions.to(rotation) @ rotation.mT + shift
        tracks = replace(tracks, positions=moved.to(tracks.positions))
    return replace(clip, views=views, tracks=tracks)
