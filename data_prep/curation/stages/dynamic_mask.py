"""Stage 8: which pixels move by themselves.

A given mask counts. Otherwise a pixel moves where flow and the flow that the camera causes differ
by more than 1 pixel and 3 deviations (MAD), in three frames in a row. Without depth the distance to
the epipolar line takes that place: motion along the line stays unnoticed. Axes: ``t`` frames,
``h w`` reduced pixels.
"""

from dataclasses import replace

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float64

from diff4splat.data_prep.curation.stages.geometry import induced_flow
from diff4splat.data_prep.curation.working_clip import WorkingClip, reduced_map
from diff4splat.geometry.rays import camera_rays

_LEAST_PX, _DEVIATIONS, _MAD_TO_DEVIATION = 1.0, 3.0, 1.4826
_MOST_SHARE = 0.6
"""Above, the estimate is wrong more often than the world moves: poses, sky, water."""
_KERNEL = np.ones((5, 5), np.uint8)


def score_dynamic_mask(working: WorkingClip) -> WorkingClip:
    """``moving_share`` and, where it was estimated, ``moving_estimated`` = 1."""
    if working.clip.note.is_static:
        none = np.zeros(working.images.shape[:3], bool)
        return replace(working, moving=none).scored(moving_share=0.0)
    if working.view.moving is not None:
        moving = reduced_map(working.view.moving.numpy(), working.size_px)
        return replace(working, moving=moving).scored(moving_share=float(moving.mean()))
    moving = estimated_moving(working)
    if moving is None:
        return working
    share = float(moving.mean())
    kept = moving if share <= _MOST_SHARE else None
    return replace(working, moving=kept).scored(moving_share=share, moving_estimated=1.0)


def estimated_moving(working: WorkingClip) -> Bool[np.ndarray, "t h w"] | None:
    """The mask out of flow and cameras; None without flow."""
    if not working.flows:
        return None
    masks = [_moves(residual, flow.consistent) for residual, flow in _residuals(working)]
    masks.append(masks[-1])
    moving = lasting(np.stack(masks))
    if working.view.sky is not None:
        moving &= ~reduced_map(working.view.sky.numpy(), working.size_px)
    return moving


def lasting(masks: Bool[np.ndarray, "t h w"]) -> Bool[np.ndarray, "t h w"]:
    """Pixels that are marked in three frames in a row, or near such ones: noise does not last."""
    if len(masks) < 3:
        return masks
    grown = np.stack([cv2.dilate(m.astype(np.uint8), _KERNEL) for m in masks]).astype(bool)
    middle = masks[1:-1] & grown[:-2] & grown[2:]
    whole = np.concatenate([middle[:1], middle, middle[-1:]])
    opened = [cv2.morphologyEx(m.astype(np.uint8), cv2.MORPH_OPEN, _KERNEL[:3, :3]) for m in whole]
    return np.stack(opened).astype(bool)


def _residuals(working: WorkingClip):
    depth = working.view.depth
    reduced = None
    if depth is not None and bool((depth > 0).any()):
        reduced = torch.from_numpy(reduced_map(depth.numpy(), working.size_px))
    for here, flow in enumerate(working.flows):
        if reduced is None:
            yield epipolar_distance(working, here), flow
        else:
            induced = induced_flow(working.cameras, here, reduced[here])
            yield np.linalg.norm(flow.forward - induced, axis=-1), flow


def epipolar_distance(working: WorkingClip, here: int) -> Float64[np.ndarray, "h w"]:
    """Distance in pixels of where flow leads from the epipolar line of the pixel."""
    first, second = working.cameras[here], working.cameras[here + 1]
    move = (second.camera_from_world @ first.world_from_camera).double().numpy()
    turned = camera_rays(first).double().numpy() @ move[:3, :3].T
    x, y, z = move[:3, 3]
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    height, width = working.size_px
    grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1) + 0.5
    focal = second.focal_px.double().numpy()
    there = (grid + working.flows[here].forward - second.center_px.double().numpy()) / focal
    if np.linalg.norm(move[:3, 3]) < 1e-9:
        # Without translation there are no lines: everything static is where the turn puts it.
        return np.linalg.norm((there - turned[..., :2] / turned[..., 2:]) * focal, axis=-1)
    line = turned @ cross.T
    away = np.abs((np.concatenate([there, np.ones((height, width, 1))], -1) * line).sum(-1))
    return away / np.maximum(np.linalg.norm(line[..., :2] / focal, axis=-1), 1e-12)


def _moves(residual: Float64[np.ndarray, "h w"], consistent: Bool[np.ndarray, "h w"]) -> np.ndarray:
    known = np.isfinite(residual) & consistent
    if not known.any():
        return np.zeros(residual.shape, bool)
    middle = np.median(residual[known])
    spread = _MAD_TO_DEVIATION * np.median(np.abs(residual[known] - middle))
    limit = max(_LEAST_PX, middle + _DEVIATIONS * spread)
    return known & (np.nan_to_num(residual) > limit)
