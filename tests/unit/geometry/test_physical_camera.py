"""One camera with its optics and its track."""

from dataclasses import replace

import pytest
import torch

from diff4splat.errors import ShapeError
from diff4splat.geometry.camera import pinhole
from diff4splat.geometry.optics import Aperture, Optics
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.geometry.pose_track import PoseTrack


def test_a_batch_of_cameras_is_refused() -> None:
    batch = pinhole(10.0, (4, 4)).with_pose(torch.eye(4).repeat(2, 1, 1))
    with pytest.raises(
        ShapeError, match=r"PhysicalCamera\.camera: expected one camera, got \(2,\)"
    ):
        PhysicalCamera(camera=batch)


def test_without_a_track_it_stands_still() -> None:
    own = PhysicalCamera(camera=pinhole(10.0, (4, 4)))
    assert not own.is_moving_between(-1e9, 1e9)


def test_with_a_track_it_moves_while_the_track_does() -> None:
    poses = torch.eye(4).repeat(3, 1, 1)
    poses[2, 0, 3] = 1.0
    track = PoseTrack(times_s=torch.tensor([0.0, 1.0, 2.0]), world_from_camera=poses)
    own = PhysicalCamera(camera=pinhole(10.0, (4, 4)), track=track)
    assert not own.is_moving_between(0.2, 0.9)
    assert own.is_moving_between(0.9, 1.1)


def test_a_dtype_reaches_camera_and_optics_but_not_the_track() -> None:
    optics = Optics(aperture=Aperture(radius=torch.tensor(0.1), focus_distance=1.0))
    track = PoseTrack(times_s=torch.zeros(1), world_from_camera=torch.eye(4)[None])
    own = PhysicalCamera(camera=pinhole(10.0, (4, 4)), optics=optics, track=track)
    cast = own.to(torch.float64)
    assert cast.camera.focal_px.dtype == cast.optics.aperture.radius.dtype == torch.float64
    assert cast.track is track
    assert replace(cast, track=None).track is None
