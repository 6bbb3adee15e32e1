"""The unit of a video's cameras: model units per unit of their lengths.

Structure from motion gives cameras in any unit, networks want a scene of known depth, so one
factor is missing. It is the one with which the depth prior's depth explains the video best
(``ColorAgreement``). Cameras times a factor are depths over it: one map is shifted.

    L = ln z by the prior, of key frames;  distance = that of the farthest camera from the first
    factor · distance = exp(L) / exp(L + shift),  shift in a range of parallax

Axes: ``k`` key frames, ``h w`` pixels.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.inputs.input_video import InputVideo
from diff4splat.geometry.camera import Camera, stack_cameras
from diff4splat.geometry.rays import relative_to_first
from diff4splat.models.hub.model import Model, model_device
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.models.ldrm.refinement.color_agreement import ColorAgreement
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.models.ldrm.refinement.start_distance import prior_log_depth

LEAST_MOVE, MOST_MOVE = 0.004, 2.0
"""Distances of the farthest camera from the first that are tried, over the median depth."""
COARSE, FINE = 0.1, 0.02
"""Steps of the logarithm of the factor."""
LEAST_GAIN = 0.05
"""Share of the error that the best factor takes from that of hardly any parallax; below it the
video does not show the unit."""
ROUNDING = 1e-6
"""Error of images without texture."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraScale:
    """A factor, and whether the video shows it."""

    factor: float
    """Model units per unit of the cameras."""
    observable: bool = True

    @property
    def median_depth(self) -> float:
        """Of the first frame, in the unit of the cameras."""
        return PLANE_DEPTH / self.factor


def scaled(cameras: Camera, factor: float) -> Camera:
    """The cameras seen from the first, distances times ``factor``."""
    relative = relative_to_first(cameras)
    poses = relative.world_from_camera.clone()
    poses[..., :3, 3] *= factor
    return relative.with_pose(poses)


@torch.no_grad()
def find_camera_scale(model: Model, video: InputVideo) -> CameraScale:
    """The factor that explains the video best.

    If no factor does, or there is no depth prior, 1, or less where cameras are farther than the
    median depth from the first.
    """
    cameras, prior = video.path.cameras, model.networks.monocular_depth
    distance = float(relative_to_first(cameras).position.norm(dim=-1).max())
    if prior is not None and distance > 0:
        posed = _unit_video(video, distance, model_device(model))
        log_depth = prior_log_depth(posed, prior, model.config)[0]
        search = _Search(agreement=ColorAgreement.of(posed), log_depth=log_depth)
        log_factor, gain = search.best()
        if gain >= LEAST_GAIN:
            return CameraScale(factor=math.exp(log_factor) / distance)
    return CameraScale(factor=PLANE_DEPTH / max(distance, PLANE_DEPTH), observable=False)


def _unit_video(video: InputVideo, distance: float, device: torch.device) -> PosedVideo:
    """With the farthest camera at a distance of 1 from the first."""
    cameras = scaled(video.path.cameras, 1 / distance).to(torch.float32).to(device)
    rgb = video.rgb.movedim(-1, 0)[None].to(device)
    return PosedVideo(rgb=rgb, cameras=stack_cameras([cameras]))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Search:
    """Over the logarithm of the model units per distance of the farthest camera."""

    agreement: ColorAgreement
    log_depth: Float[Tensor, "k h w"]

    def best(self) -> tuple[float, float]:
        """The best one, and the share of the error that it takes away."""
        low, high = (math.log(PLANE_DEPTH * move) for move in (LEAST_MOVE, MOST_MOVE))
        coarse = torch.arange(low, high, COARSE).tolist()
        first = min(coarse, key=self.error)
        fine = (first + FINE * torch.arange(-4, 5)).tolist()
        best = min(fine, key=self.error)
        without = self.error(coarse[0])
        return best, 1 - (self.error(best) + ROUNDING) / (without + ROUNDING)

    def error(self, log_factor: float) -> float:
        """Mean over the key frames."""
        return float(self.agreement.error(self.log_depth - log_factor).mean())
