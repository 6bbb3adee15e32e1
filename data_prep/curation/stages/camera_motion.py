"""Stage 5: path, turns and jumps of the camera.

Lengths are relative to the median depth, so that no threshold depends on the unit of the poses.
Axes: ``t`` frames.
"""

import numpy as np
import torch
from jaxtyping import Float64

from diff4splat.data.clip import View
from diff4splat.data_prep.curation.working_clip import WorkingClip


def score_camera_motion(working: WorkingClip) -> WorkingClip:
    """``rotation_deg``, ``path_over_depth``, ``parallax`` and two measures of single steps."""
    cameras = working.view.cameras
    centers = cameras.position.numpy()
    turns = turn_angles_deg(cameras.world_from_camera[:, :3, :3].numpy())
    depth = median_depth(working.view)
    steps = np.linalg.norm(np.diff(centers, axis=0), axis=1)
    reach = np.linalg.norm(centers - centers[0], axis=1).max()
    return working.scored(
        rotation_deg=float(turns.sum()),
        rotation_step_deg=float(turns.max(initial=0.0)),
        path_over_depth=None if depth is None else float(steps.sum()) / depth,
        parallax=None if depth is None else float(reach) / depth,
        acceleration_residual=None if depth is None else twice_in_a_row(residuals(centers)) / depth,
    )


def turn_angles_deg(rotation: Float64[np.ndarray, "t 3 3"]) -> Float64[np.ndarray, " s"]:
    """Angle between the cameras of successive frames."""
    between = np.einsum("tji,tjk->tik", rotation[:-1], rotation[1:])
    # By the chord |R − I| = 2 √2 sin(angle / 2): the arc cosine has no digits near 0.
    chord = np.linalg.norm(between - np.eye(3), axis=(1, 2))
    return np.degrees(2 * np.arcsin((chord / (2 * np.sqrt(2))).clip(0, 1)))


def residuals(centers: Float64[np.ndarray, "t 3"]) -> Float64[np.ndarray, " s"]:
    """How far each centre is from where constant acceleration would put it."""
    if len(centers) < 4:
        return np.zeros(0)
    return np.linalg.norm(np.diff(centers, n=3, axis=0), axis=1)


def twice_in_a_row(values: Float64[np.ndarray, " s"]) -> float:
    """Largest value that two successive entries reach, as SpatialVID counts jumps."""
    return float(np.minimum(values[:-1], values[1:]).max(initial=0.0))


def median_depth(view: View) -> float | None:
    """Over all pixels with depth; None without any."""
    if view.depth is None:
        return None
    known = view.depth[view.depth > 0]
    return float(known.median()) if len(known) and torch.isfinite(known).all() else None
