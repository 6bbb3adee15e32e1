"""The unit of length that a model sees.

One image does not tell its scale, so every clip is scaled until the median depth of its first
input frame is where the photograph's plane lies (``models/ldrm/plane_prior.py``). Camera paths at
generation time are in the same unit.
"""

from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.data.clip import Clip, View
from diff4splat.errors import InputError
from diff4splat.geometry.camera import Camera
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.training.recipe.data import DataSettings


def in_unit(clip: Clip, settings: DataSettings) -> Clip:
    """The clip in the unit of the recipe; a metric clip in metres keeps its lengths.

    Without any depth map the farthest camera is 1 from the first: images alone tell no scale.

    Raises:
        InputError: too little depth, or metres are wanted and the clip does not have them.
    """
    metric = clip.note.metric in ("exact", "aligned")
    if settings.unit == "median_depth" or (settings.unit == "known" and not metric):
        if clip.views[0].depth is None:
            return rescaled(clip, 1 / (_travel(clip) or 1))
        return normalized(clip, settings.min_valid_depth)
    if metric:
        return clip
    raise InputError(
        f"clip {clip.note.identifier}: expected lengths in metres, got metric "
        f"'{clip.note.metric}'; align the clip or train with data.unit=median_depth"
    )


def normalized(clip: Clip, min_valid_depth: float = 0.01) -> Clip:
    """The clip in model units.

    Raises:
        InputError: too few pixels of the first input frame have a depth.
    """
    return rescaled(clip, PLANE_DEPTH / typical_depth(clip, min_valid_depth))


def _travel(clip: Clip) -> float:
    """Greatest distance of a camera of the clip from the first; below 1e-6 it counts as 0."""
    first = clip.views[0].cameras.world_from_camera[0, :3, 3]
    away = [(v.cameras.world_from_camera[:, :3, 3] - first).norm(dim=-1).max() for v in clip.views]
    farthest = float(max(away))
    return farthest if farthest > 1e-6 else 0.0


def typical_depth(clip: Clip, min_valid_depth: float) -> float:
    """Median depth of the first input frame.

    Raises:
        InputError: fewer than ``min_valid_depth`` of its pixels have a depth.
    """
    every = clip.views[0].depth
    depth = torch.zeros(clip.size_px) if every is None else every[0]
    valid = valid_depth(depth)
    share = float(valid.float().mean())
    if share < min_valid_depth or not bool(valid.any()):
        raise InputError(
            f"clip {clip.note.identifier}: expected depth in at least {min_valid_depth:.0%} of "
            f"the first input frame, got {share:.1%}; leave the clip out"
        )
    return float(depth[valid].median())


def valid_depth(depth: Float[Tensor, "*b h w"]) -> Bool[Tensor, "*b h w"]:
    """Where a depth map says something."""
    return torch.isfinite(depth) & (depth > 0)


def rescaled(clip: Clip, factor: float) -> Clip:
    """The same clip with every length multiplied by ``factor``."""
    tracks = clip.tracks
    if tracks is not None:
        tracks = replace(tracks, positions=tracks.positions * factor)
    views = tuple(_rescaled_view(view, factor) for view in clip.views)
    return replace(clip, views=views, tracks=tracks)


def _rescaled_view(view: View, factor: float) -> View:
    depth = None if view.depth is None else view.depth * factor
    return replace(view, depth=depth, cameras=rescaled_cameras(view.cameras, factor))


def rescaled_cameras(cameras: Camera, factor: float) -> Camera:
    """Cameras whose positions are multiplied by ``factor``."""
    pose: Float[Tensor, "*b 4 4"] = cameras.world_from_camera.clone()
    pose[..., :3, 3] *= factor
    return replace(cameras, world_from_camera=pose)
