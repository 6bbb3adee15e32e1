"""Initial models: static for the coarse stage, and the motion of the fine stage.

Axes: ``n`` Gaussians.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.fitting.model.canonical import params_from_gaussians, params_from_points
from diff4splat.fitting.model.initial_points import initial_points
from diff4splat.fitting.model.scene_bounds import SceneBounds
from diff4splat.fitting.model.scene_model import SceneModel
from diff4splat.fitting.motions.hexplane import HexPlaneField
from diff4splat.fitting.motions.protocol import LearnedMotion
from diff4splat.fitting.motions.spacetime import SpacetimeGaussians
from diff4splat.fitting.motions.static import NoMotion
from diff4splat.fitting.optics.learned import LearnedOptics
from diff4splat.fitting.settings import FitSettings
from diff4splat.geometry import quaternion
from diff4splat.scene.edit import Similarity, transform_gaussians
from diff4splat.scene.scene import Scene

BOUNDS_QUANTILE, BOUNDS_MARGIN = 0.01, 0.1


def static_model(
    capture: Capture,
    bounds: SceneBounds,
    settings: FitSettings,
    optics: LearnedOptics | None = None,
) -> SceneModel:
    """Gaussians at the points of the capture, without motion."""
    count = min(settings.points, settings.density.budget)
    points = initial_points(capture, bounds, count, settings.use_depth, settings.seed)
    moving_mask = torch.zeros(len(points.positions), dtype=torch.bool)
    rows = params_from_points(points, settings.harmonics)
    motion = NoMotion(capture.time_range_s)
    return SceneModel(rows, motion, moving_mask, optics, dtype=settings.torch_dtype)


def field_bounds(means: Float[Tensor, "n 3"]) -> Float[Tensor, "2 3"]:
    """Bounding box (low, high) between quantiles, so that outliers do not stretch the planes."""
    if len(means) == 0:
        return means.new_tensor([[-1.0] * 3, [1.0] * 3])
    low = torch.quantile(means, BOUNDS_QUANTILE, 0)
    high = torch.quantile(means, 1 - BOUNDS_QUANTILE, 0)
    margin = BOUNDS_MARGIN * (high - low).clamp_min(1e-3 * float((high - low).max()) + 1e-9)
    return torch.stack([low - margin, high + margin])


def create_motion(
    capture: Capture, settings: FitSettings, bounds: Float[Tensor, "2 3"]
) -> LearnedMotion:
    """The initial motion of the fine stage, with no displacement."""
    start_s, stop_s = capture.time_range_s
    if settings.motion == "static" or stop_s == start_s:
        return NoMotion(capture.time_range_s)
    if settings.motion == "hexplane":
        size = (settings.planes, settings.decoder)
        return HexPlaneField(size, bounds, capture.time_range_s, settings.seed)
    times = len(capture.times_s.unique())
    return SpacetimeGaussians(capture.time_range_s, 0.5 * (stop_s - start_s) / max(times - 1, 1))


def model_from_scene(
    scene: Scene, capture: Capture, settings: FitSettings, optics: LearnedOptics | None = None
) -> SceneModel:
    """An existing scene at the middle of its time range, in the world of the capture.

    The first camera of the path of the scene is aligned with the camera of the first training
    frame. The scale is that of the scene.
    """
    first = int(capture.learnt[0])
    world_from_camera = capture.cameras[first].world_from_camera.double()
    camera_from_scene = scene.path.cameras[0].camera_from_world.double()
    world_from_scene = world_from_camera @ camera_from_scene
    similarity = Similarity(
        rotation=quaternion.from_matrix(world_from_scene[:3, :3]),
        translation=world_from_scene[:3, 3],
    )
    state = scene.state_at(sum(scene.motion.time_range_s) / 2)
    rows = params_from_gaussians(transform_gaussians(state, similarity), settings.harmonics)
    moving_mask = torch.zeros(len(state), dtype=torch.bool)
    motion = NoMotion(capture.time_range_s)
    return SceneModel(rows, motion, moving_mask, optics, dtype=settings.torch_dtype)
