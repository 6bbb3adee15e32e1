"""How far away a scene is, so that camera moves can be sized to it.

Axes: ``n`` Gaussians or pixels in front of the camera. Depths are z in the first camera of the
scene's path.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry.camera import Camera, project
from diff4splat.paths.settings import PathFrame
from diff4splat.scene.scene import Scene

NEAR_QUANTILE, FOCUS_QUANTILE, FAR_QUANTILE = 0.05, 0.25, 0.95
"""The focus is nearer than the median: what an image is of lies before its background."""
DEFAULT_DEPTH = 1.0
"""For a scene with nothing in front of its first camera."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthRange:
    """Depths that camera presets are measured in, in scene units."""

    near: float
    focus: float
    far: float


def depth_range(scene: Scene) -> DepthRange:
    """Of the Gaussians in the view of the first camera."""
    means = scene.gaussians.means
    camera = scene.path.cameras[0].to(means.dtype).to(means.device)
    pixels, z = project(camera, scene.state_at(float(scene.path.times_s[0])).means)
    height, width = camera.size_px
    inside = (pixels >= 0).all(-1) & (pixels[:, 0] < width) & (pixels[:, 1] < height) & (z > 0)
    return depth_quantiles(z[inside & z.isfinite()])


def scene_frame(scene: Scene, camera: Camera) -> PathFrame:
    """What presets are sized to in ``scene``, at the size and with the lens of ``camera``."""
    depths = depth_range(scene)
    return PathFrame(camera=camera, near_depth=depths.near, focus_depth=depths.focus)


def depth_quantiles(depths: Float[Tensor, " n"]) -> DepthRange:
    """Near (5 %), focus (25 %) and far (95 %) of positive depths."""
    if len(depths) == 0:
        return DepthRange(near=DEFAULT_DEPTH, focus=DEFAULT_DEPTH, far=DEFAULT_DEPTH)
    ordered = depths.sort().values
    at = [int(q * (len(ordered) - 1)) for q in (NEAR_QUANTILE, FOCUS_QUANTILE, FAR_QUANTILE)]
    near, focus, far = ordered[torch.tensor(at, device=ordered.device)].tolist()
    return DepthRange(near=near, focus=focus, far=far)
