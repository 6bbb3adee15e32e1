"""Which Gaussians are static for every viewer: their tracks change nothing that a pixel could show.

Axes: ``m`` moving Gaussians. At depth z a Gaussian's visible rim lies 3 · largest scale from its
centre, so over all keys it moves in the image by at most

    focal / z · (offset + rim · (angle + exp(log scale change) − 1))     pixels of the input view
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry.camera import Camera, project
from diff4splat.models.config.model import ModelConfig
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframe_algebra import keep_moving, largest_change
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.protocol import Motion

RIM_SIGMAS = 3.0
NEAREST_DEPTH = 1e-3
"""Gaussians at or behind the camera count as this near: they keep their tracks."""


def prune_static_tracks(
    gaussians: Gaussians, motion: Motion, camera: Camera, threshold_px: float, log: RunLog
) -> Motion:
    """No key times for Gaussians that ``camera`` sees move by at most ``threshold_px`` pixels."""
    if not isinstance(motion, KeyframeMotion):
        return motion
    moves = largest_displacement_px(gaussians, motion, camera) > threshold_px
    static = len(moves) - int(moves.sum())
    if static == 0:
        return motion
    why = f"they move by at most {threshold_px:g} px"
    saved = f"{static:,} tracks"
    log.record_skipped("key times of static Gaussians", why, saved, threshold_px, "px")
    return keep_moving(motion, moves)


def deformation_threshold_px(config: ModelConfig, camera: Camera, threshold_px: float) -> float:
    """The larger of what is asked for and how far the network moves what is static."""
    scale = max(camera.size_px) / max(config.size_px)
    return max(threshold_px, config.deformation.static_threshold_px * scale)


def largest_displacement_px(
    gaussians: Gaussians, motion: KeyframeMotion, camera: Camera
) -> Float[Tensor, " m"]:
    """An upper bound on how far any point of each moving Gaussian moves, over all keys."""
    index, change = motion.moving_index, largest_change(motion)
    rim = RIM_SIGMAS * gaussians.scales[index].amax(-1)
    reach = change.offset + rim * (change.angle_rad + change.log_scale.expm1())
    depth = project(camera, gaussians.means[index])[1].clamp_min(NEAREST_DEPTH)
    return torch.nan_to_num(reach * camera.focal_px.max() / depth, nan=torch.inf)
