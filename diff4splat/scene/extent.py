"""How far away a scene is, so that camera moves can be sized to it.

Axes: ``n`` Gaussians in front of the camera. Depths are z in the first camera of the scene's path.
"""

from dataclasses import dataclass

import torch

from diff4splat.geometry.camera import project
from diff4splat.scene.scene import Scene

NEAR_QUANTILE, FOCUS_QUANTILE, FAR_QUANTILE = 0.05, 0.5, 0.95
DEFAULT_DEPTH = 1.0
"""For a scene with nothing in front of its first camera."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthRange:
    """Depths that camera presets are measured in, in scene units."""

    near: float
    focus: float
    far: float


def depth_range(scene: Scene) -> DepthRange:
    """Near (5 %), median and far (95 %) depth of the Gaussians in the view of the first camera."""
    means = scene.gaussians.means
    camera = scene.path.cameras[0].to(means.dtype).to(means.device)
    pixels, z = project(camera, scene.state_at(float(scene.path.times_s[0])).means)
    height, width = camera.size_px
    inside = (pixels >= 0).all(-1) & (pixels[:, 0] < width) & (pixels[:, 1] < height) & (z > 0)
    seen = z[inside & z.isfinite()]
    if len(seen) == 0:
        return DepthRange(near=DEFAULT_DEPTH, focus=DEFAULT_DEPTH, far=DEFAULT_DEPTH)
    ordered = seen.sort().values
    at = [int(q * (len(ordered) - 1)) for q in (NEAR_QUANTILE, FOCUS_QUANTILE, FAR_QUANTILE)]
    near, focus, far = ordered[torch.tensor(at, device=ordered.device)].tolist()
    return DepthRange(near=near, focus=focus, far=far)
