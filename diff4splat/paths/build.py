"""From the path language to cameras.

Axes: ``t`` frames. Segments follow one another: each starts at the pose and focal length where the
last one ended. Frames lie at equal steps of total progress, so a joint is never shown twice. Poses
are computed in float64 and returned in the dtype of the view's camera.
"""

from collections.abc import Sequence
from dataclasses import replace

import torch

from diff4splat.geometry import rigid
from diff4splat.paths.camera_path import CameraPath, require_valid_path
from diff4splat.paths.easing import ease
from diff4splat.paths.language import Segment, parse_path, require_short_of_near
from diff4splat.paths.moves import Move, fixed_lens
from diff4splat.paths.settings import PathFrame, PathSettings


def build_path(text: str, view: PathFrame, settings: PathSettings) -> CameraPath:
    """The camera path that ``text`` (see ``language``) describes in ``view``.

    Raises:
        InputError: ``text`` is not understood, or the path would run into the nearest content.
    """
    segments = parse_path(text, settings.amplitude)
    require_short_of_near(segments)
    move = _chain(segments, view, settings)
    like = view.camera.world_from_camera
    cameras = view.camera.with_pose(move.world_from_camera.to(like))
    cameras = replace(cameras, focal_px=cameras.focal_px * move.focal_factor.to(like)[:, None])
    times_s = torch.arange(settings.frames, dtype=torch.float64) / settings.fps
    return require_valid_path(CameraPath(cameras=cameras, times_s=times_s.to(like)), "camera path")


def _chain(segments: Sequence[Segment], view: PathFrame, settings: PathSettings) -> Move:
    place = torch.linspace(0, len(segments), settings.frames, dtype=torch.float64)
    number_at = place.floor().clamp(max=len(segments) - 1)
    start = fixed_lens(torch.eye(4, dtype=torch.float64)[None])
    focus_depth, parts = view.focus_depth, []
    for number, segment in enumerate(segments):
        progress = ease(place[number_at == number] - number, settings.easing)
        extent = segment.preset.extent(segment.amplitude, view.near_depth)
        moved = segment.preset.move(
            torch.cat([progress, progress.new_ones(1)]), extent, focus_depth
        )
        chained = _after(start, moved)
        parts.append(chained[:-1])
        start, focus_depth = chained[-1:], _depth_from_end(moved, focus_depth)
    return Move(
        world_from_camera=torch.cat([part.world_from_camera for part in parts]),
        focal_factor=torch.cat([part.focal_factor for part in parts]),
    )


def _after(start: Move, moved: Move) -> Move:
    """``moved`` as it looks when it begins at the end of ``start`` (one pose)."""
    return Move(
        world_from_camera=start.world_from_camera @ moved.world_from_camera,
        focal_factor=start.focal_factor * moved.focal_factor,
    )


def _depth_from_end(moved: Move, focus_depth: float) -> float:
    """Depth of the focus point once the move is over; above 0, see ``require_short_of_near``."""
    focus = moved.world_from_camera.new_tensor([[0.0, 0.0, focus_depth]])
    end_from_start = rigid.invert(moved.world_from_camera[-1])
    return float(rigid.transform_points(end_from_start, focus)[0, 2])
