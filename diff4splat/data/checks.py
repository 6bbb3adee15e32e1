"""Does a clip keep its contract? Shapes, types and ranges; ``agreement`` compares the contents.

Axes as in ``clip``. Every message names clip, view and field.
"""

import torch
from torch import Tensor

from diff4splat.data.clip import Clip, Flow, Tracks, View
from diff4splat.data.json_fields import IDENTIFIER, MAX_FRAMES, MAX_SIDE_PX, MAX_VIEWS
from diff4splat.data.scale_record import require_valid_scale
from diff4splat.errors import InputError
from diff4splat.geometry import rigid

_RIGID_TOLERANCE = 1e-5
_HOME_TOLERANCE = 1e-6
"""Of the first camera, which should be the identity."""


def require_valid_clip(clip: Clip, least_depth_share: float = 0.0) -> None:
    """Refuse a clip that contradicts itself; ``least_depth_share`` of all pixels must have depth.

    Raises:
        InputError: one line that names clip and field, what was expected and what was got.
    """
    try:
        _require_note(clip)
        _require_times(clip)
        for number, view in enumerate(clip.views):
            _require_view(clip, view, f"view {number}")
        _require_tracks(clip)
        _require_depth_share(clip, least_depth_share)
    except InputError as error:
        raise InputError(f"clip '{clip.note.identifier[:80]}', {error}") from error


def require_first_camera(clip: Clip) -> None:
    """Refuse a clip whose world frame is not the first camera of its first view.

    Raises:
        InputError: says by how much it differs.
    """
    pose = clip.views[0].cameras.world_from_camera[0]
    off = float((pose - torch.eye(4, dtype=pose.dtype)).abs().max())
    if off > _HOME_TOLERANCE:
        raise InputError(
            f"clip '{clip.note.identifier}', view 0: expected the identity as its first pose, "
            f"got a difference of {off:.2g}; express poses and tracks in the first camera's axes"
        )


def _require_note(clip: Clip) -> None:
    note = clip.note
    if not IDENTIFIER.fullmatch(note.identifier):
        raise InputError("identifier: expected up to 80 letters, digits, '_' and '-'")
    if not note.license or not note.source:
        raise InputError("note: expected a source and a license, got an empty one; fill it in")
    if note.scale is not None:
        require_valid_scale(note.scale)
    numbers = [each.instance for each in note.objects]
    if len(set(numbers)) != len(numbers) or not all(1 <= number <= 255 for number in numbers):
        raise InputError(f"objects: expected different instances from 1 to 255, got {numbers}")


def _require_times(clip: Clip) -> None:
    times = clip.times_s
    _require(times, "times_s", torch.float64, (clip.frames,))
    if not 1 <= clip.frames <= MAX_FRAMES:
        raise InputError(f"times_s: expected 1 to {MAX_FRAMES} frames, got {clip.frames}")
    if not bool(torch.isfinite(times).all() and (times.diff() > 0).all()):
        raise InputError("times_s: expected finite times that increase from frame to frame")
    if not 1 <= len(clip.views) <= MAX_VIEWS:
        raise InputError(f"views: expected 1 to {MAX_VIEWS}, got {len(clip.views)}")
    if max(clip.size_px) > MAX_SIDE_PX:
        raise InputError(f"size: expected at most {MAX_SIDE_PX} per side, got {clip.size_px}")


def _require_view(clip: Clip, view: View, where: str) -> None:
    if view.cameras.size_px != clip.size_px:
        raise InputError(
            f"{where}: expected images of (height, width) {clip.size_px} like view 0, "
            f"got {view.cameras.size_px}"
        )
    shape = (clip.frames, *clip.size_px)
    _require(view.rgb, f"{where}, rgb", torch.uint8, (*shape, 3))
    if view.depth is not None:
        _require_depth(view.depth, f"{where}, depth", shape)
    _require_cameras(clip, view, f"{where}, cameras")
    for name, kind in (("instances", torch.uint8), ("sky", torch.bool), ("moving", torch.bool)):
        if (mask := getattr(view, name)) is not None:
            _require(mask, f"{where}, {name}", kind, shape)
    if view.flow is not None:
        _require_flow(view.flow, f"{where}, flow", (clip.frames - 1, *clip.size_px))
    _require_seen_tracks(clip, view, where)


def _require_depth(depth: Tensor, where: str, shape: tuple[int, ...]) -> None:
    _require(depth, where, torch.float32, shape)
    # One pass over the memory; comparisons with NaN are False.
    low, high = torch.aminmax(depth)
    if not bool(low >= 0 and high < torch.inf):
        raise InputError(f"{where}: expected finite depth, 0 for none, got other values")


def _require_cameras(clip: Clip, view: View, where: str) -> None:
    camera, count = view.cameras, clip.frames
    _require(camera.world_from_camera, where, torch.float64, (count, 4, 4))
    _require(camera.focal_px, f"{where}, focal_px", torch.float64, (count, 2))
    _require(camera.center_px, f"{where}, center_px", torch.float64, (count, 2))
    rigid.require_rigid(camera.world_from_camera, where, _RIGID_TOLERANCE)
    if not bool((camera.world_from_camera[:, 3] == torch.eye(4)[3]).all()):
        raise InputError(f"{where}: expected 0 0 0 1 as the last row of every pose")
    intrinsics = torch.cat([camera.focal_px, camera.center_px], -1)
    if not bool(torch.isfinite(intrinsics).all() and (camera.focal_px > 0).all()):
        raise InputError(f"{where}: expected finite intrinsics and focal lengths above 0")


def _require_flow(flow: Flow, where: str, shape: tuple[int, ...]) -> None:
    _require(flow.to_next, where, torch.float32, (*shape, 2))
    _require(flow.known, f"{where}.known", torch.bool, shape)
    _require(flow.visible, f"{where}.visible", torch.bool, shape)
    if bool((~torch.isfinite(flow.to_next).all(-1) & flow.known).any()):
        raise InputError(f"{where}: expected finite flow where it is known, got NaN or infinity")
    if bool((flow.visible & ~flow.known).any()):
        raise InputError(f"{where}: expected known flow where it is visible, got unknown flow")


def _require_seen_tracks(clip: Clip, view: View, where: str) -> None:
    uv, visible = view.track_uv, view.track_visible
    if uv is None and visible is None:
        return
    if uv is None or visible is None or clip.tracks is None:
        raise InputError(f"{where}: expected tracks with both uv and visible, or none of them")
    count = clip.tracks.positions.shape[1]
    _require(uv, f"{where}, track_uv", torch.float32, (clip.frames, count, 2))
    _require(visible, f"{where}, track_visible", torch.bool, (clip.frames, count))
    if not bool(torch.isfinite(uv).all()):
        raise InputError(f"{where}, track_uv: expected finite numbers, got NaN or infinity")
    known = clip.tracks.known
    if known is not None and bool((visible & ~known).any()):
        raise InputError(f"{where}, track_visible: expected visible points to be known ones")


def _require_tracks(clip: Clip) -> None:
    tracks: Tracks | None = clip.tracks
    if tracks is None:
        return
    count = len(tracks.found_at)
    _require(tracks.positions, "tracks, positions", torch.float32, (clip.frames, count, 3))
    if tracks.instances is not None:
        _require(tracks.instances, "tracks, instances", torch.uint8, (count,))
    if tracks.known is not None:
        _require(tracks.known, "tracks, known", torch.bool, (clip.frames, count))
    _require(tracks.found_at, "tracks, found_at", torch.int64, (count, 2))
    if not bool(torch.isfinite(tracks.positions).all()):
        raise InputError("tracks, positions: expected finite numbers, got NaN or infinity")
    limits = torch.tensor([len(clip.views), clip.frames])
    inside = ((tracks.found_at >= 0) & (tracks.found_at < limits)).all(-1)
    unknown = (tracks.found_at == -1).all(-1)
    if not bool((inside | unknown).all()):
        raise InputError("tracks, found_at: expected (view, frame) of this clip or (-1, -1)")


def _require_depth_share(clip: Clip, least: float) -> None:
    if least <= 0:
        return
    known = sum(int((v.depth > 0).sum()) for v in clip.views if v.depth is not None)
    share = known / (len(clip.views) * clip.frames * clip.size_px[0] * clip.size_px[1])
    if share < least:
        raise InputError(
            f"depth: expected some in {least:.0%} of all pixels or more, got {share:.1%}"
        )


def _require(value: Tensor, where: str, dtype: torch.dtype, shape: tuple[int, ...]) -> None:
    if value.dtype != dtype or tuple(value.shape) != shape:
        want, got = str(dtype).removeprefix("torch."), str(value.dtype).removeprefix("torch.")
        raise InputError(
            f"{where}: expected {want} of shape {shape}, got {got} of shape {tuple(value.shape)}"
        )
