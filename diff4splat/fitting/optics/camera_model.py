"""Camera parameters that all frames of a capture share: optics and a factor of focal lengths."""

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
    """Shared camera parameters; tensors with gradients are optimised."""

    optics: Optics = field(default_factory=Optics)
    focal_factor: Float[Tensor, ""] = field(default_factory=_one)
    """Multiplies the focal lengths of the capture."""

    def camera(self, capture: Capture, index: int) -> PhysicalCamera:
        """The camera of one frame."""
        given = capture.physical_camera(index)
        focal_px = given.camera.focal_px * self.focal_factor
        return replace(given, camera=replace(given.camera, focal_px=focal_px), optics=self.optics)


def camera_model_of(capture: Capture) -> CameraModel:
    """The camera parameters of the capture."""
    return CameraModel() if capture.optics is None else CameraModel(optics=capture.optics)


def differs_from_pinhole(optics: Optics | None) -> bool:
    """Whether images through ``optics`` differ from pinhole images, at least of moving content."""
    if optics is None:
        return False
    has_aperture = optics.aperture is not None and counts(optics.aperture.radius)
    has_readout = optics.shutter is not None and counts(optics.shutter.readout_s)
    has_exposure = counts(optics.exposure_s)
    return not is_pinhole(optics.lens) or has_aperture or has_readout or has_exposure
