"""Models as they set out: standing for the coarse stage, with a motion for the fine one.

Axes: ``n`` Gaussians.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.fitting.canonical import raw_gaussians, raw_points
from diff4splat.fitting.model import SceneModel
from diff4splat.fitting.motions.hexplane import HexPlaneField
from diff4splat.fitting.motions.protocol import LearnedMotion
from diff4splat.fitting.motions.spacetime import Pulses
from diff4splat.fitting.motions.still import Still
from diff4splat.fitting.optics.learned import LearnedOptics
from diff4splat.fitting.points import starting_points
from diff4splat.fitting.scene_bounds import Region
from diff4splat.fitting.settings import FitSettings
from diff4splat.geometry import quaternion
from diff4splat.scene.edit import Similarity, transform_gaussians
from diff4splat.scene.scene import Scene

BOUNDS_QUANTILE, BOUNDS_MARGIN = 0.01, 0.1


def standing_model(
    capture: Capture, region: Region, settings: FitSettings, optics: LearnedOptics | None = None
) -> SceneModel:
    """Points of the capture, without motion."""
    count = min(settings.points, settings.density.budget)
    points = starting_points(capture, region, count, settings.use_depth, settings.seed)
    nobody = torch.zeros(len(points.positions), dtype=torch.bool)
    rows = raw_points(points, settings.harmonics)
    return SceneModel(rows, Still(capture.time_range_s), nobody, optics)


def field_bounds(means: Float[Tensor, "n 3"]) -> Float[Tensor, "2 3"]:
    """A box around all but the outermost, so that nodes lie where something moves."""
    if len(means) == 0:
        return torch.tensor([[-1.0] * 3, [1.0] * 3])
    low = torch.quantile(means, BOUNDS_QUANTILE, 0)
    high = torch.quantile(means, 1 - BOUNDS_QUANTILE, 0)
    margin = BOUNDS_MARGIN * (high - low).clamp_min(1e-3 * float((high - low).max()) + 1e-9)
    return torch.stack([low - margin, high + margin])


def create_motion(
    capture: Capture, settings: FitSettings, bounds: Float[Tensor, "2 3"]
) -> LearnedMotion:
    """The motion of the fine stage at its start: nothing moves yet."""
    start_s, stop_s = capture.time_range_s
    if settings.motion == "static" or stop_s == start_s:
        return Still(capture.time_range_s)
    if settings.motion == "hexplane":
        size = (settings.planes, settings.decoder)
        return HexPlaneField(size, bounds, capture.time_range_s, settings.seed)
    times = len(capture.times_s.unique())
    return Pulses(capture.time_range_s, 0.5 * (stop_s - start_s) / max(times - 1, 1))


def initial_model(
    scene: Scene, capture: Capture, settings: FitSettings, optics: LearnedOptics | None = None
) -> SceneModel:
    """A ready scene, at the middle of its time, seen from the world of the capture.

    The first camera of the scene's path is put where the first training frame was taken; lengths
    are those of the scene.
    """
    first = int(capture.learnt[0])
    there = capture.cameras[first].world_from_camera.double()
    here = scene.path.cameras[0].camera_from_world.double()
    world_from_scene = there @ here
    similarity = Similarity(
        rotation=quaternion.from_matrix(world_from_scene[:3, :3]),
        translation=world_from_scene[:3, 3],
    )
    state = scene.state_at(sum(scene.motion.time_range_s) / 2)
    rows = raw_gaussians(transform_gaussians(state, similarity), settings.harmonics)
    nobody = torch.zeros(len(state), dtype=torch.bool)
    return SceneModel(rows, Still(capture.time_range_s), nobody, optics)
