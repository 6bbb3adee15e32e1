"""A posed video to a scene in the world frame and the unit of its cameras.

video, cameras ─ unit of the cameras ─ cameras in model units ─ scene_from_video ─ back to the world
"""

from dataclasses import dataclass, replace

import torch

from diff4splat.errors import InputError
from diff4splat.generation.inputs.input_video import InputVideo
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.video.camera_scale import CameraScale, find_camera_scale, scaled
from diff4splat.generation.video.video_to_scene import scene_from_video
from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import Camera
from diff4splat.models.hub.model import Model, with_parts
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.models.networks import reconstruction_parts
from diff4splat.progress.run_log import RunLog
from diff4splat.render.api import DEFAULTS
from diff4splat.scene.edit import Similarity, transform
from diff4splat.scene.scene import Scene

LEAST_MEDIAN_DEPTH = 10 * DEFAULTS.near_depth
"""Below it much of a scene is nearer than renderers draw."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reconstruction:
    """A scene and the unit that was found for it."""

    scene: Scene
    """In the world frame, unit and times of the video; its path has all frames of the camera."""
    scale: CameraScale


def reconstruct(
    model: Model,
    video: InputVideo,
    median_depth: float | None = None,
    settings: GenerationSettings | None = None,
    log: RunLog | None = None,
) -> Reconstruction:
    """The scene of a video; ``median_depth`` is that of its first frame, in the cameras' unit.

    Without it the unit is found by ``find_camera_scale``.

    Raises:
        InputError: frames or size are not what the model can take, or the unit is so large that
            renderers leave out what is near.
    """
    settings, log = settings or GenerationSettings(), log or RunLog()
    model = with_parts(model, reconstruction_parts(model.config))
    if median_depth is None:
        with log.phases.phase("find the unit of the cameras"):
            scale = find_camera_scale(model, video)
    else:
        scale = CameraScale(factor=PLANE_DEPTH / median_depth)
    _require_visible(scale)
    path = replace(video.path, cameras=scaled(video.path.cameras, scale.factor))
    scene = scene_from_video(model, video.rgb, path.to(torch.float32), settings, log)
    scene = transform(scene, to_world(video.path.cameras[0], 1 / scale.factor))
    return Reconstruction(scene=replace(scene, path=video.full_path.to(torch.float32)), scale=scale)


def _require_visible(scale: CameraScale) -> None:
    if scale.median_depth < LEAST_MEDIAN_DEPTH:
        raise InputError(
            "cameras: expected a unit in which the median depth of the first frame is at least "
            f"{LEAST_MEDIAN_DEPTH:g}, got {scale.median_depth:.3g}; multiply their positions"
        )


def to_world(first: Camera, factor: float) -> Similarity:
    """From the first camera's frame to the world, lengths times ``factor``."""
    pose = first.world_from_camera
    rotation = quaternion.from_matrix(pose[:3, :3])
    return Similarity(rotation=rotation, translation=pose[:3, 3], scale=factor)
