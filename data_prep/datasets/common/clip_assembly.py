"""A window of a sequence as a clip: read, reduced, in the axes of its first camera.

Axes: ``t`` frames, ``h w`` pixels, ``n`` points.
"""

from collections.abc import Sequence as Many
from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.checks import require_first_camera, require_valid_clip
from diff4splat.data.clip import Clip, ClipMetadata, Flow, Tracks, View
from diff4splat.data_prep.datasets.common.flow_visibility import visible_pixels
from diff4splat.data_prep.datasets.common.resizing import reduced_size, resized_frame
from diff4splat.data_prep.datasets.common.sequence import (
    DatasetFacts,
    FrameMaps,
    PointTracks,
    Sequence,
    SequenceView,
)
from diff4splat.data_prep.datasets.common.windows import WindowOptions
from diff4splat.geometry import rigid
from diff4splat.geometry.camera import Camera

_MOST_LABELS = 254


def assemble_clip(
    sequence: Sequence, window: range, facts: DatasetFacts, identifier: str, options: WindowOptions
) -> Clip:
    """Read the frames of ``window`` and make the clip.

    Raises:
        FileFormatError: a file is missing, damaged or of another form; names it.
        InputError: the clip contradicts itself.
    """
    home = rigid.invert(sequence.views[0].cameras.world_from_camera[window.start])
    views = tuple(
        _view(view, window, home, options) for view in sequence.views[: options.most_views]
    )
    tracks = None
    if sequence.tracks is not None:
        tracks, views = _tracked(sequence, window, home, views, options)
    clip = Clip(
        note=_note(sequence, facts, identifier),
        times_s=torch.from_numpy(sequence.times_s[window.start : window.stop]),
        views=views,
        tracks=tracks,
    )
    require_valid_clip(clip)
    require_first_camera(clip)
    return clip


def _note(sequence: Sequence, facts: DatasetFacts, identifier: str) -> ClipMetadata:
    return ClipMetadata(
        identifier=identifier,
        source=facts.title,
        dataset=facts.name,
        scene=sequence.scene,
        license=sequence.license or facts.license,
        caption=sequence.caption,
        metric=facts.metric,
        is_static=facts.is_static,
        timed=facts.timed,
        track_source=facts.track_source,
    )


def _view(
    view: SequenceView, window: range, home: Float[Tensor, "4 4"], options: WindowOptions
) -> View:
    size_px = reduced_size(view.cameras.size_px, options.max_side_px)
    frames = [resized_frame(view.read(index), size_px) for index in window]
    return View(
        rgb=torch.from_numpy(np.stack([frame.rgb for frame in frames])),
        depth=_stacked([frame.depth for frame in frames]),
        cameras=_cameras(view.cameras, window, home, size_px),
        sky=_stacked([frame.sky for frame in frames]),
        instances=_instances([frame.labels for frame in frames]),
        flow=_flow(frames),
    )


def _cameras(
    cameras: Camera, window: range, home: Float[Tensor, "4 4"], size_px: tuple[int, int]
) -> Camera:
    chosen = cameras[window.start : window.stop].resized(size_px)
    poses = home @ chosen.world_from_camera
    # Exact where a product of a pose and its inverse is not: the identity, and the last rows.
    rotation = rigid.nearest_rotation(poses[:, :3, :3])
    return chosen.with_pose(rigid.from_parts(rotation, poses[:, :3, 3]))


def _stacked(maps: Many[np.ndarray | None]) -> Tensor | None:
    """None where a frame lacks the map: a clip has it everywhere or nowhere."""
    present = [each for each in maps if each is not None]
    return torch.from_numpy(np.stack(present)) if len(present) == len(maps) else None


def _instances(labels: Many[np.ndarray | None]) -> Tensor | None:
    """Objects numbered from 1 over all frames; None where there are more than a byte can tell."""
    present = [each for each in labels if each is not None]
    if len(present) != len(labels):
        return None
    values = np.unique(np.concatenate([np.unique(each) for each in present]))
    values = values[values != 0]
    if len(values) > _MOST_LABELS:
        return None
    every = np.stack(present)
    numbers = np.searchsorted(values, every) + 1
    return torch.from_numpy(np.where(every == 0, 0, numbers).astype(np.uint8))


def _flow(frames: Many[FrameMaps]) -> Flow | None:
    forward = [frame.to_next for frame in frames[:-1]]
    if not forward or any(flow is None for flow in forward):
        return None
    back = [frame.to_previous for frame in frames[1:]]
    known = np.stack([flow.known for flow in forward])
    offsets = np.where(known[..., None], np.stack([flow.offset_px for flow in forward]), 0)
    visible = [visible_pixels(*pair) for pair in zip(forward, back, strict=True)]
    return Flow(
        to_next=torch.from_numpy(offsets.astype(np.float32)),
        known=torch.from_numpy(known),
        visible=torch.from_numpy(np.stack(visible)),
    )


def _tracked(
    sequence: Sequence,
    window: range,
    home: Float[Tensor, "4 4"],
    views: tuple[View, ...],
    options: WindowOptions,
) -> tuple[Tracks | None, tuple[View, ...]]:
    """Points that the input view sees at least once, and it with their pixels."""
    size_px = views[0].cameras.size_px
    points = _seen_points(sequence.tracks(window), sequence.views[0].cameras.size_px, options)
    if not points.known.shape[1]:
        return None, views
    world = torch.from_numpy(points.positions)
    positions = rigid.transform_points(home, world.reshape(-1, 3)).reshape(world.shape)
    known = torch.from_numpy(points.known)
    whole = sequence.views[0].cameras.size_px
    factor = np.array([size_px[1] / whole[1], size_px[0] / whole[0]])
    uv = np.where(points.known[..., None], points.uv * factor, 0)
    first = replace(
        views[0],
        track_uv=torch.from_numpy(uv.astype(np.float32)),
        track_visible=torch.from_numpy(points.visible),
    )
    tracks = Tracks(
        positions=torch.where(known[..., None], positions, 0.0).float(),
        known=None if bool(known.all()) else known,
        found_at=torch.full((known.shape[1], 2), -1, dtype=torch.int64),
    )
    return tracks, (first, *views[1:])


def _seen_points(
    points: PointTracks, size_px: tuple[int, int], options: WindowOptions
) -> PointTracks:
    """Finite, visible inside the image alone, seen at least once, and no more than wanted."""
    finite = np.isfinite(points.positions).all(-1) & np.isfinite(points.uv).all(-1)
    known = points.known & finite
    uv = np.where(known[..., None], points.uv, -1.0)
    inside = ((uv >= 0) & (uv < np.array(size_px[::-1]))).all(-1)
    visible = points.visible & known & inside
    seen = np.flatnonzero(visible.any(0))
    if len(seen) > options.most_tracks:
        seen = seen[np.linspace(0, len(seen) - 1, options.most_tracks).round().astype(int)]
    positions = np.where(known[..., None], points.positions, 0.0)
    return PointTracks(
        positions=positions[:, seen], known=known[:, seen], uv=uv[:, seen], visible=visible[:, seen]
    )
