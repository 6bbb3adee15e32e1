"""Depth of a rectified pair by semi-global matching (Hirschmüller 2008, OpenCV's StereoSGBM).

Pixels whose matches from left to right and back differ by more than a pixel have no depth, nor do
depth edges: the rules by which Stereo4D filtered its stereo. Axes: ``h w`` pixels.
"""

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from diff4splat.data.clip import Clip
from diff4splat.data_prep.alignment.references.reference import Reference, aligned_metric
from diff4splat.errors import InputError

_BLOCK_PX, _STEP = 5, 16
"""Disparities are searched in multiples of 16."""
_MOST_TURN_DEG, _MOST_OFFSET = 0.1, 0.02
_LEAST_DISPARITY_PX = 0.5
_EDGE = 0.03
"""Relative depth gradient per pixel."""


def stereo_reference(clip: Clip, most_disparity: float = 0.25) -> Reference:
    """Depth of the first view from the first two, which must be a rectified pair.

    ``most_disparity`` is a share of the image width; nearer points have no depth.

    Raises:
        InputError: one view only, or a pair that is not rectified.
    """
    baseline = rectified_baseline(clip)
    left, right = (view.rgb.numpy() for view in clip.views[:2])
    focal = clip.views[0].cameras.focal_px[:, 0].numpy()
    offset = (clip.views[1].cameras.center_px - clip.views[0].cameras.center_px)[:, 0].numpy()
    depth = []
    for number in range(clip.frames):
        found = sgbm_disparity(left[number], right[number], most_disparity) + offset[number]
        known = found > _LEAST_DISPARITY_PX
        z = np.where(known, focal[number] * baseline / np.where(known, found, 1), 0)
        depth.append(_without_edges(z.astype(np.float32)))
    metric = aligned_metric(clip.note.metric)
    return Reference(depth=np.stack(depth), name=f"stereo, baseline {baseline:.4g}", metric=metric)


def rectified_baseline(clip: Clip) -> float:
    """Distance of the second camera to the right of the first, the same in every frame.

    Raises:
        InputError: one view only, or a pair that is not rectified.
    """
    if len(clip.views) < 2:
        raise InputError("reference stereo: expected two views, got one; choose triangulation")
    first, second = (view.cameras for view in clip.views[:2])
    between = (first.camera_from_world @ second.world_from_camera).numpy()
    turn = np.degrees(
        np.arccos(((np.trace(between[:, :3, :3], axis1=1, axis2=2) - 1) / 2).clip(-1, 1))
    )
    x = between[:, 0, 3]
    off_axis = np.abs(between[:, 1:3, 3]).max() / max(np.abs(x).max(), 1e-12)
    alike = np.allclose(first.focal_px.numpy(), second.focal_px.numpy(), rtol=1e-3)
    if not (turn.max() < _MOST_TURN_DEG and off_axis < _MOST_OFFSET and x.min() > 0 and alike):
        raise InputError(
            "reference stereo: expected a rectified pair, the second camera right of the first, "
            f"got a turn of {turn.max():.3g} degrees and an offset of {off_axis:.3g} off the "
            "axis; rectify the images, or choose triangulation"
        )
    return float(np.median(x))


def sgbm_disparity(
    left: UInt8[np.ndarray, "h w 3"], right: UInt8[np.ndarray, "h w 3"], most: float
) -> Float32[np.ndarray, "h w"]:
    """Disparity of the left image in pixels; 0 where unknown. ``most`` is a share of the width."""
    count = max(_STEP, int(np.ceil(most * left.shape[1] / _STEP)) * _STEP)
    matcher = cv2.StereoSGBM_create(
        minDisparity=0,
        numDisparities=count,
        blockSize=_BLOCK_PX,
        P1=8 * 3 * _BLOCK_PX**2,
        P2=32 * 3 * _BLOCK_PX**2,
        disp12MaxDiff=1,
        uniquenessRatio=10,
        speckleWindowSize=50,
        speckleRange=2,
        mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )
    # Without a border on the left, the first columns have nothing to be compared with.
    padded = [cv2.copyMakeBorder(i, 0, 0, count, 0, cv2.BORDER_REPLICATE) for i in (left, right)]
    found = matcher.compute(*padded)[:, count:].astype(np.float32) / 16
    column = np.arange(left.shape[1], dtype=np.float32)
    return np.where((found > 0) & (found <= column), found, 0)


def _without_edges(depth: Float32[np.ndarray, "h w"]) -> Float32[np.ndarray, "h w"]:
    gradient = np.maximum(*(np.abs(each) for each in np.gradient(depth)))
    return np.where(gradient <= _EDGE * depth, depth, 0)
