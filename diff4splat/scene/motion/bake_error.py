"""What is lost when a motion is replaced by key frames, as cameras see it.

Axes: ``m`` moving Gaussians, ``c`` cameras, ``v`` pairs of a camera and a Gaussian that it sees.
The error of one Gaussian is how far its centre lies from where it should, plus how far the ends of
its one-sigma axes do (as the projection linearised at the centre shows them); both in pixels.
"""

from collections.abc import Iterable
from dataclasses import dataclass, fields

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import Camera
from diff4splat.scene.gaussians import Gaussians

FAINTEST = 1 / 255
"""Opacity below which nothing is drawn."""
NEAREST = 0.01
"""Depth in scene units below which nothing is drawn."""
_QUANTILE = 0.999


@dataclass(frozen=True, slots=True, kw_only=True)
class BakeError:
    """The largest errors over the times that were looked at; all 0 where nothing was seen."""

    largest_px: float = 0.0
    """Of any Gaussian in any camera at any time."""
    quantile_px: float = 0.0
    """What 99.9 % of the Gaussians that cameras see stay below, at the worst time."""
    opacity_lost: float = 0.0
    """The largest change of an opacity, which key frames do not hold."""
    color_lost: float = 0.0
    """The largest change of a harmonic coefficient, which key frames do not hold."""


def largest(errors: Iterable[BakeError]) -> BakeError:
    """The largest of each number."""
    listed = [BakeError(), *errors]
    return BakeError(
        **{f.name: max(getattr(error, f.name) for error in listed) for f in fields(BakeError)}
    )


def compare(canonical: Gaussians, exact: Gaussians, baked: Gaussians, cameras: Camera) -> BakeError:
    """The error of ``baked`` against ``exact`` at one time, in a batch of cameras."""
    if len(exact) == 0:
        return BakeError()
    errors = pixel_errors(exact, baked, cameras)
    return BakeError(
        largest_px=float(errors.max()) if len(errors) else 0.0,
        quantile_px=_quantile(errors),
        opacity_lost=float((exact.opacities - canonical.opacities).abs().max()),
        color_lost=float((exact.sh - canonical.sh).abs().max()),
    )


def pixel_errors(exact: Gaussians, baked: Gaussians, cameras: Camera) -> Float[Tensor, " v"]:
    """One number for each camera and each Gaussian that it sees at its exact place."""
    found = []
    offset, axes = baked.means - exact.means, _axes(baked) - _axes(exact)
    cameras = cameras.to(exact.means.dtype)
    for camera in (cameras[k] for k in range(len(cameras))):
        turn = camera.world_from_camera[:3, :3]
        local = (exact.means - camera.position) @ turn
        seen = _sees(camera, local) & (exact.opacities >= FAINTEST)
        place, moved = local[seen], (local + offset @ turn)[seen]
        center = _pixels(camera, moved) - _pixels(camera, place)
        ends = _linear_pixels(camera, place, axes[seen] @ turn)
        found.append(center.norm(dim=-1) + ends.norm(dim=-1).amax(-1))
    return torch.cat(found)


def _axes(gaussians: Gaussians) -> Float[Tensor, "m 3 3"]:
    """The three one-sigma axes, one per row."""
    return quaternion.to_matrix(gaussians.quats).mT * gaussians.scales[..., None]


def _sees(camera: Camera, local: Float[Tensor, "m 3"]) -> Bool[Tensor, " m"]:
    height, width = camera.size_px
    pixels = _pixels(camera, local)
    inside = (pixels >= 0) & (pixels <= pixels.new_tensor([width, height]))
    return inside.all(-1) & (local[:, 2] > NEAREST)


def _pixels(camera: Camera, local: Float[Tensor, "v 3"]) -> Float[Tensor, "v 2"]:
    # A key frame may put a Gaussian behind the camera; that is far off, not infinitely far.
    return camera.focal_px * local[:, :2] / local[:, 2:].clamp_min(NEAREST) + camera.center_px


def _linear_pixels(
    camera: Camera, local: Float[Tensor, "v 3"], steps: Float[Tensor, "v 3 3"]
) -> Float[Tensor, "v 3 2"]:
    """How steps from ``local`` show, to first order."""
    depth = local[:, None, 2:]
    slope = local[:, None, :2] / depth
    return camera.focal_px * (steps[..., :2] - slope * steps[..., 2:]) / depth


def _quantile(errors: Float[Tensor, " v"]) -> float:
    if len(errors) == 0:
        return 0.0
    rank = max(int(_QUANTILE * len(errors) + 0.5), 1)
    return float(errors.kthvalue(rank).values)
