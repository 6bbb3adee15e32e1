"""Tracks as sparse depth: the z of every visible point at its pixel, the nearest one wins."""

import numpy as np
import torch
from jaxtyping import Float32

from diff4splat.data.clip import Clip
from diff4splat.data_prep.alignment.references.reference import Reference, aligned_metric
from diff4splat.errors import InputError
from diff4splat.geometry.camera import project


def track_reference(clip: Clip) -> Reference:
    """The depth of the tracks of the input view.

    Raises:
        InputError: the clip has none.
    """
    view = clip.views[0]
    if clip.tracks is None or view.track_uv is None or view.track_visible is None:
        raise InputError(
            "reference tracks: expected a clip with tracks, got none; choose triangulation"
        )
    _, z = project(view.cameras, clip.tracks.positions.double())
    shown = view.track_visible & (z > 0)
    depth = np.stack(
        [
            splat_depth(uv[now].numpy(), here[now].numpy(), clip.size_px)
            for uv, here, now in zip(view.track_uv, z, shown, strict=True)
        ]
    )
    return Reference(depth=depth, name="tracks", metric=aligned_metric(clip.note.metric))


def splat_depth(
    uv: np.ndarray, z: np.ndarray, size_px: tuple[int, int]
) -> Float32[np.ndarray, "h w"]:
    """A depth map of single points (x, y in pixels); of several in a pixel the nearest."""
    height, width = size_px
    column, row = np.floor(np.nan_to_num(uv, nan=-1)).astype(np.int64).T.reshape(2, -1)
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height) & np.isfinite(z)
    nearest = torch.full((height * width,), torch.inf, dtype=torch.float64)
    index = torch.from_numpy((row * width + column)[inside])
    nearest.scatter_reduce_(0, index, torch.from_numpy(z[inside].astype(np.float64)), "amin")
    found = nearest.numpy().reshape(size_px)
    return np.where(np.isfinite(found), found, 0).astype(np.float32)
