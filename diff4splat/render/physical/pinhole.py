"""The image of a camera without effects: rasterised, and returned as a photograph."""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.geometry.depth import distance_from_depth
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.render.api import render
from diff4splat.render.physical.effects import Effects
from diff4splat.render.physical.ray_batches import middle_s
from diff4splat.render.physical.settings import Photograph, PhotoSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import Scene

_SAME = frozenset({"rgb", "alpha", "depth", "median_depth"})


def rasterize_pinhole(
    subject: Scene | Gaussians,
    camera: PhysicalCamera,
    time_s: float,
    outputs: frozenset[str],
    settings: PhotoSettings,
    effects: Effects,
    backend: str,
) -> Photograph:
    """The image of ``camera``, a static pinhole."""
    posed, middle = _posed(camera, time_s), middle_s(camera.optics, time_s)
    requested = (outputs & _SAME) | ({"depth"} if "distance" in outputs else set()) or {"alpha"}
    rendered = render(
        subject, posed, middle, outputs=requested, settings=settings.raster, backend=backend
    )
    images: dict[str, Float[Tensor, "h w ..."]] = {
        name: getattr(rendered, name) for name in outputs & _SAME
    }
    if "distance" in outputs:
        images["distance"] = distance_from_depth(posed, rendered.depth)
    if "time_s" in outputs:
        images["time_s"] = posed.focal_px.new_full(posed.size_px, middle - time_s)
    return Photograph(
        **images,
        valid=torch.ones(posed.size_px, dtype=torch.bool, device=posed.focal_px.device),
        backend="raster",
        skipped_effects=(
            "rays: no effect of the camera shows, the rasteriser draws",
            *effects.skipped_effects,
        ),
        dropped_nonfinite=rendered.dropped_nonfinite,
    )


def _posed(camera: PhysicalCamera, time_s: float) -> Camera:
    if camera.track is None:
        return camera.camera
    at = torch.tensor([middle_s(camera.optics, time_s)], dtype=torch.float64)
    return camera.camera.with_pose(camera.track.at(at)[0].to(camera.camera.world_from_camera))
