"""A posed video to a scene in the world of its cameras."""

from dataclasses import replace

import pytest
import torch

from diff4splat.errors import InputError
from diff4splat.generation.inputs.input_video import InputVideo
from diff4splat.generation.reconstruction import reconstruct, to_world
from diff4splat.generation.settings import GenerationSettings
from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import pinhole
from diff4splat.models.config.sizes import size_by_name
from diff4splat.models.hub.model import Model
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.api import render
from diff4splat.scene.edit import transform

SIDE_PX, FRAMES, FOCAL_PX = 32, 5, 30.0
AS_PREDICTED = GenerationSettings(min_opacity=0.0, photometric_steps=0)


def video(unit: float = 1.0, turn: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)) -> InputVideo:
    """Cameras that move sideways, in a world that is turned, moved and of another unit."""
    poses = torch.eye(4, dtype=torch.float64).repeat(FRAMES, 1, 1)
    poses[:, 0, 3] = 0.1 * torch.arange(FRAMES)
    world = torch.eye(4, dtype=torch.float64)
    world[:3, :3] = quaternion.to_matrix(quaternion.normalize(torch.tensor(turn).double()))
    world[:3, 3] = torch.tensor([2.0, -1.0, 0.5])
    poses = world @ poses
    poses[:, :3, 3] *= unit
    cameras = pinhole(FOCAL_PX, (SIDE_PX, SIDE_PX)).to(torch.float64)
    times_s = 0.5 * torch.arange(FRAMES).double()
    path = CameraPath(cameras=cameras.with_pose(poses), times_s=times_s)
    rgb = torch.rand(FRAMES, SIDE_PX, SIDE_PX, 3, generator=torch.Generator().manual_seed(0))
    everything = torch.arange(FRAMES)
    return InputVideo(
        rgb=rgb, path=path, index=everything, other_index=everything[:0], full_path=path
    )


def model() -> Model:
    return Model(config=size_by_name("test"))


@pytest.mark.parametrize("unit", [0.1, 40.0])
def test_the_scene_does_not_depend_on_the_world_of_the_cameras(unit: float) -> None:
    plain = reconstruct(model(), video(), PLANE_DEPTH, AS_PREDICTED).scene
    turned = video(unit, (0.8, 0.1, -0.4, 0.3))
    placed = reconstruct(model(), turned, PLANE_DEPTH * unit, AS_PREDICTED).scene
    back = transform(placed, to_world(turned.path.cameras[0], unit).inverse()).gaussians
    first = transform(plain, to_world(video().path.cameras[0], 1.0).inverse()).gaussians
    torch.testing.assert_close(back.means, first.means, atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(back.scales, first.scales, atol=0, rtol=1e-4)
    torch.testing.assert_close(back.sh, first.sh, atol=1e-4, rtol=0)


def test_the_first_frame_is_seen_from_the_first_camera() -> None:
    """All frames alike, so that their planes do not hide each other."""
    shown = video(40.0, (0.8, 0.1, -0.4, 0.3))
    shown = replace(shown, rgb=shown.rgb[:1].expand(FRAMES, -1, -1, -1) * 0 + 0.3)
    scene = reconstruct(model(), shown, 4.0 * 40, AS_PREDICTED).scene
    view = render(scene, scene.path.cameras[0], 0.0, outputs=("rgb", "alpha"))
    assert float((view.rgb - 0.3 * view.alpha[..., None])[4:-4, 4:-4].abs().max()) < 0.02
    assert float(view.alpha[4:-4, 4:-4].min()) > 0.9


def test_a_unit_in_which_renderers_would_see_nothing_is_refused() -> None:
    with pytest.raises(InputError, match=r"at least 0.1, got 0.004; multiply"):
        reconstruct(model(), video(1e-3), 4e-3, AS_PREDICTED)


def test_the_given_depth_is_that_of_the_plane_without_training() -> None:
    """A fresh model shows every frame on a plane at the median depth."""
    scene = reconstruct(model(), video(), 7.0, AS_PREDICTED).scene
    camera = scene.path.cameras[0]
    depth = (
        camera.camera_from_world[2]
        @ torch.nn.functional.pad(scene.gaussians.means, (0, 1), value=1.0).mT
    )
    torch.testing.assert_close(depth, torch.full_like(depth, 7.0), atol=1e-4, rtol=0)


def test_the_scene_has_the_times_and_all_cameras_of_the_video() -> None:
    shown = video()
    longer = replace(shown, full_path=CameraPath(
        cameras=shown.path.cameras[torch.tensor([0, 0, 1, 2])],
        times_s=torch.tensor([0.0, 0.25, 0.5, 1.0]).double(),
    ))  # fmt: skip
    found = reconstruct(model(), longer, 4.0, AS_PREDICTED)
    assert found.scene.path.times_s.tolist() == [0.0, 0.25, 0.5, 1.0]
    assert found.scene.motion.time_range_s == (0.0, 2.0)
    assert found.scale.observable and found.scale.factor == 1.0


def test_without_a_depth_prior_the_unit_is_not_shown() -> None:
    found = reconstruct(model(), video(), settings=AS_PREDICTED)
    assert not found.scale.observable and found.scale.factor == 1.0


def test_the_world_similarity_carries_the_first_camera() -> None:
    first = video(3.0, (0.8, 0.1, -0.4, 0.3)).path.cameras[0]
    similarity = to_world(first, 3.0)
    origin, ahead = torch.zeros(3).double(), torch.tensor([0.0, 0.0, 1.0]).double()
    torch.testing.assert_close(similarity.points(origin), first.position)
    expected = first.position + 3 * first.world_from_camera[:3, 2]
    torch.testing.assert_close(similarity.points(ahead), expected)
