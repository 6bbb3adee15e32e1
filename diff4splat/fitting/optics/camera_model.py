"""What all cameras of a capture share beside their poses: optics, and a factor of focal lengths."""

from dataclasses import dataclass, field, replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.geometry.optics import Optics
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.render.physical.effects import counts, is_pinhole


def _one() -> Float[Tensor, ""]:
    return torch.ones((), dtype=torch.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraModel:
    """As far as it is known by now; tensors with gradients are being learned."""

    optics: Optics = field(default_factory=Optics)
    focal_factor: Float[Tensor, ""] = field(default_factory=_one)
    """Of the focal lengths that the capture names."""

    def camera(self, capture: Capture, index: int) -> PhysicalCamera:
        """The camera of one frame."""
        given = capture.physical_camera(index)
        focal_px = given.camera.focal_px * self.focal_factor
        return replace(given, camera=replace(given.camera, focal_px=focal_px), optics=self.optics)


def model_of(capture: Capture) -> CameraModel:
    """What the capture says."""
    return CameraModel() if capture.optics is None else CameraModel(optics=capture.optics)


def shows(optics: Optics | None) -> bool:
    """Whether pictures through ``optics`` differ from a pinhole's, at least of what moves."""
    if optics is None:
        return False
    spreads = optics.aperture is not None and counts(optics.aperture.radius)
    rolls = optics.shutter is not None and counts(optics.shutter.readout_s)
    return not is_pinhole(optics.lens) or spreads or rolls or counts(optics.exposure_s)
