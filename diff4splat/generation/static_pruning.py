"""Which Gaussians stand still for every eye: their tracks change nothing that a pixel could show.

Axes: ``m`` moving Gaussians. At depth z a Gaussian's visible rim lies 3 · largest scale from its
centre, so over all keys it moves on the picture by at most

    focal / z · (offset + rim · (angle + exp(log scale change) − 1))     pixels of the input view
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry.camera import Camera, project
from diff4splat.models.config.model import ModelConfig
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.motion.keyframe_algebra import keep_moving, largest_change
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.scene import Scene

RIM_SIGMAS = 3.0
NEAREST_DEPTH = 1e-3
"""Gaussians at or behind the camera count as this near: they keep their tracks."""


def prune_static_tracks(scene: Scene, camera: Camera, still_px: float, log: RunLog) -> Scene:
    """Store no key times for Gaussians that ``camera`` sees move by at most ``still_px`` pixels."""
    if not isinstance(scene.motion, KeyframeMotion):
        return scene
    moves = largest_displacement_px(scene, camera) > still_px
    still = len(moves) - int(moves.sum())
    if still == 0:
        return scene
    why = f"they move by at most {still_px:g} px"
    log.record_skipped("key times of still Gaussians", why, f"{still:,} tracks", still_px)
    return replace(scene, motion=keep_moving(scene.motion, moves))


def static_threshold_px(config: ModelConfig, camera: Camera, still_px: float) -> float:
    """The larger of what is asked for and what the model cannot tell from nothing."""
    own_px = max(camera.size_px) / max(config.size_px)
    return max(still_px, config.deformation.noise_px * own_px)


def largest_displacement_px(scene: Scene, camera: Camera) -> Float[Tensor, " m"]:
    """An upper bound on how far any point of each moving Gaussian goes, over all keys."""
    index, change = scene.motion.moving_index, largest_change(scene.motion)
    rim = RIM_SIGMAS * scene.gaussians.scales[index].amax(-1)
    reach = change.offset + rim * (change.angle_rad + change.log_scale.expm1())
    depth = project(camera, scene.gaussians.means[index])[1].clamp_min(NEAREST_DEPTH)
    return torch.nan_to_num(reach * camera.focal_px.max() / depth, nan=torch.inf)
