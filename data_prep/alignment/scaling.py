"""All lengths of a clip times one factor."""

from dataclasses import replace

from diff4splat.data.clip import Clip, View
from diff4splat.geometry import rigid


def scaled_clip(clip: Clip, factor: float) -> Clip:
    """Translations, depth and tracks times ``factor``; rotations and pixels stay."""
    if factor == 1:
        return clip
    tracks = clip.tracks
    if tracks is not None:
        tracks = replace(tracks, positions=tracks.positions * factor)
    return replace(clip, views=tuple(_scaled(view, factor) for view in clip.views), tracks=tracks)


def _scaled(view: View, factor: float) -> View:
    pose = view.cameras.world_from_camera
    cameras = view.cameras.with_pose(rigid.from_parts(pose[:, :3, :3], pose[:, :3, 3] * factor))
    return replace(view, cameras=cameras, depth=None if view.depth is None else view.depth * factor)
