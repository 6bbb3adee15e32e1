"""Corners followed between two frames, to test cameras without depth. Axes: ``n`` corners."""

from dataclasses import dataclass

import cv2
import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.clip import View
from diff4splat.geometry.camera import Camera

_MOST, _FEWEST = 600, 12
_ROUND_TRIP_PX = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Matches:
    """The same corners in two frames, pixel centres at +0.5."""

    frames: tuple[int, int]
    first_px: Float[Tensor, "n 2"]
    second_px: Float[Tensor, "n 2"]


def find_matches(view: View, frames: tuple[int, int]) -> Matches | None:
    """Corners that lead back to where they began; None when there are too few."""
    grey = [cv2.cvtColor(view.rgb[frame].numpy(), cv2.COLOR_RGB2GRAY) for frame in frames]
    corners = cv2.goodFeaturesToTrack(grey[0], _MOST, 0.01, 3)
    if corners is None:
        return None
    there, found, _ = cv2.calcOpticalFlowPyrLK(*grey, corners, None)
    back, returned, _ = cv2.calcOpticalFlowPyrLK(*grey[::-1], there, None)
    missed = np.linalg.norm((corners - back)[:, 0], axis=-1)
    good = (found & returned)[:, 0].astype(bool) & (missed < _ROUND_TRIP_PX)
    if good.sum() < _FEWEST:
        return None
    first, second = (
        torch.from_numpy(pixels[good, 0].astype(np.float64)) + 0.5 for pixels in (corners, there)
    )
    return Matches(frames=frames, first_px=first, second_px=second)


def epipolar_distance_px(cameras: Camera, matches: Matches) -> float | None:
    """Median distance of the second corners to the lines that the cameras give for the first.

    None where the camera turns in place: then there are no lines.
    """
    first, second = (cameras[frame].to(torch.float64) for frame in matches.frames)
    pose = second.camera_from_world @ first.world_from_camera
    shift = pose[:3, 3]
    if float(shift.norm()) < 1e-9:
        return None
    rays = (matches.first_px - first.center_px) / first.focal_px
    rays = torch.cat([rays, torch.ones(len(rays), 1, dtype=rays.dtype)], -1)
    normal = torch.linalg.cross(shift.expand_as(rays), rays @ pose[:3, :3].mT)
    lines = normal[:, :2] / second.focal_px
    offset = normal[:, 2] - (lines * second.center_px).sum(-1)
    away = ((lines * matches.second_px).sum(-1) + offset).abs()
    return float((away / lines.norm(dim=-1).clamp_min(1e-12)).median())
