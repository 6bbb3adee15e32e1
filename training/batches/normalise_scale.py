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


def normalized(clip: Clip, min_valid_depth: float = 0.01) -> Clip:
    """The clip in model units.

    Raises:
        InputError: too few pixels of the first input frame have a depth.
    """
    return rescaled(clip, PLANE_DEPTH / typical_depth(clip, min_valid_depth))


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
