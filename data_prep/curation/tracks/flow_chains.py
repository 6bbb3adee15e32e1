"""Tracks of clips that have true flow and depth but no tracks: flow followed from frame to frame.

A chain goes on while the flow is known and visible, and what it reaches has depth on one surface;
where the clip has no mask of what moves, a static point must also stay where it is. Positions are
lifted from the depth map of each frame. Axes: ``t`` frames, ``n`` tracks.
"""

from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Bool, Float64
from torch import Tensor

from diff4splat.data.clip import Clip, Tracks, View
from diff4splat.data.consistency.sampling import sample
from diff4splat.data_prep.alignment.opencv.dis_flow import sampled
from diff4splat.errors import InputError
from diff4splat.geometry import rigid

FEWEST_FRAMES = 8


def with_chained_tracks(clip: Clip, most: int = 1024) -> Clip:
    """The clip with tracks that start on a grid of pixels of the first frame.

    Raises:
        InputError: the input view lacks flow or depth, or no chain is long enough.
    """
    view = clip.views[0]
    if view.flow is None or view.depth is None:
        raise InputError("tracks: expected a clip with flow and depth to chain, got one without")
    uv, visible = _chains(view, _grid(view.depth[0], most))
    positions, known = _lifted(view, uv, visible)
    visible = visible & known
    long_enough = visible.sum(0) >= min(FEWEST_FRAMES, clip.frames)
    if not bool(long_enough.any()):
        raise InputError(f"tracks: expected chains of {FEWEST_FRAMES} frames, got shorter ones")
    return _with_tracks(
        clip, uv[:, long_enough], visible[:, long_enough], positions[:, long_enough]
    )


def _grid(depth: Tensor, most: int) -> Float64[np.ndarray, "n 2"]:
    """Pixel centres with depth, evenly, up to ``most``."""
    height, width = depth.shape
    step = max(1, int(np.ceil(np.sqrt(height * width / most))))
    rows, columns = np.mgrid[step // 2 : height : step, step // 2 : width : step]
    rows, columns = rows.reshape(-1), columns.reshape(-1)
    known = depth.numpy()[rows, columns] > 0
    return np.stack([columns[known], rows[known]], 1) + 0.5


def _chains(view: View, start: Float64[np.ndarray, "n 2"]) -> tuple[Tensor, Bool[Tensor, "t n"]]:
    """(x, y) per frame, and whether the chain still holds; a broken one stays where it broke."""
    places, alive = [start], [np.ones(len(start), bool)]
    flow = view.flow
    for step in range(len(flow.known)):
        x, y = (places[-1] - 0.5).T
        offset = sampled(flow.to_next[step].numpy(), x[None], y[None])[0]
        good = flow.known[step] & flow.visible[step]
        # All four neighbours count: next to a hidden one the flow in between belongs to nothing.
        whole = sampled(good.numpy().astype(np.float32), x[None], y[None])[0] > 0.999
        holds = alive[-1] & whole & np.isfinite(offset).all(-1)
        places.append(np.where(holds[:, None], places[-1] + np.nan_to_num(offset), places[-1]))
        alive.append(holds)
    return torch.from_numpy(np.stack(places)), torch.from_numpy(np.stack(alive))


def _lifted(view: View, uv: Tensor, alive: Tensor) -> tuple[Tensor, Bool[Tensor, "t n"]]:
    """World positions from depth, and where the depth is on one surface."""
    positions, known = [], []
    for frame, places in enumerate(uv):
        found = sample(view.depth[frame].double(), places)
        camera = view.cameras[frame]
        ray = torch.cat(
            [(places - camera.center_px) / camera.focal_px, torch.ones(len(places), 1).double()], 1
        )
        world = rigid.transform_points(camera.world_from_camera, ray * found.depth[:, None])
        positions.append(world)
        known.append(found.smooth & alive[frame])
    # Once lost, a chain stays lost: what it reaches later may be another surface.
    kept = torch.stack(known).int().cummin(0).values.bool()
    return torch.stack(positions), kept


def _with_tracks(clip: Clip, uv: Tensor, visible: Tensor, positions: Tensor) -> Clip:
    count = uv.shape[1]
    view = replace(clip.views[0], track_uv=uv.float(), track_visible=visible)
    tracks = Tracks(
        positions=torch.where(visible[..., None], positions, 0.0).float(),
        known=None if bool(visible.all()) else visible,
        found_at=torch.zeros(count, 2, dtype=torch.int64),
    )
    note = replace(clip.note, track_source="chained")
    others = tuple(replace(v, track_uv=None, track_visible=None) for v in clip.views[1:])
    return replace(clip, note=note, views=(view, *others), tracks=tracks)
