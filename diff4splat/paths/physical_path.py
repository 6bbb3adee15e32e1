"""A camera path that is filmed through optics: the camera goes on moving while an image is taken.

Axes: ``t`` frames. Everything is float64, so that what a file holds is exactly what was filmed.
"""

import math
from dataclasses import dataclass, field

import torch

from diff4splat.geometry.optics import Optics
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.geometry.pose_track import PoseTrack
from diff4splat.paths.camera_path import CameraPath


@dataclass(frozen=True, slots=True, kw_only=True)
class PhysicalPath:
    """Frames, the optics that all of them are seen through, and where the camera is in between."""

    path: CameraPath
    """Focal lengths are pixels per unit of the lens's image plane."""
    optics: Optics = field(default_factory=Optics)
    track: PoseTrack | None = None
    """None is a camera that jumps from frame to frame and is static meanwhile."""

    def __len__(self) -> int:
        return len(self.path)

    @property
    def frame_s(self) -> float:
        """The shortest time from frame to frame; infinite for a single frame."""
        steps = self.path.times_s.diff()
        return float(steps.min()) if len(steps) else math.inf

    def camera(self, index: int) -> PhysicalCamera:
        """The camera of one frame."""
        return PhysicalCamera(camera=self.path.cameras[index], optics=self.optics, track=self.track)

    def time_s(self, index: int) -> float:
        """The time of one frame."""
        return float(self.path.times_s[index])


def filmed(path: CameraPath, optics: Optics) -> PhysicalPath:
    """``path`` through ``optics``; from pose to pose the camera goes straight and turns evenly."""
    exact = path.to(torch.float64)
    track = PoseTrack(times_s=exact.times_s, world_from_camera=exact.cameras.world_from_camera)
    return PhysicalPath(path=exact, optics=optics.to(torch.float64), track=track)
