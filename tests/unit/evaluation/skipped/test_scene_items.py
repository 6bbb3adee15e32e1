"""What a render leaves out, on a small scene."""

from dataclasses import replace

import pytest
import torch

from diff4splat.evaluation.skipped.measurement import Bench, Item, Measured
from diff4splat.evaluation.skipped.scene_items import in_view, scene_items
from diff4splat.evaluation.skipped.skipped_report import to_markdown
from diff4splat.geometry.camera import pinhole, stack_cameras
from diff4splat.paths.camera_path import CameraPath
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Provenance, Scene


@pytest.fixture
def scene() -> Scene:
    count, generator = 200, torch.Generator().manual_seed(0)
    means = torch.rand(count, 3, generator=generator) * torch.tensor([2.0, 2.0, 1.0])
    gaussians = Gaussians(
        means=means + torch.tensor([-1.0, -1.0, 2.0]),
        quats=torch.tensor([1.0, 0.0, 0.0, 0.0]).expand(count, 4).clone(),
        scales=torch.full((count, 3), 0.03),
        opacities=torch.linspace(0, 1, count),
        sh=torch.rand(count, 1, 3, generator=generator),
    )
    cameras = stack_cameras([pinhole(32.0, (32, 32))] * 3)
    return Scene(
        gaussians=gaussians,
        motion=StaticMotion(time_range_s=(0.0, 1.0)),
        path=CameraPath(cameras=cameras, times_s=torch.tensor([0.0, 0.5, 1.0])),
        provenance=Provenance(generator="test"),
    )


def test_everything_left_out_of_a_static_scene_changes_nothing(scene: Scene) -> None:
    rows = [Bench("cloud", repeats=1).measure(item) for item in scene_items(scene)]
    assert {row.item for row in rows} >= {"harmonics", "depth", "transparent Gaussians"}
    assert max(row.error for row in rows) < 2e-6
    assert all(f"| {row.item} |" in to_markdown(rows) for row in rows)


def test_gaussians_behind_and_beside_the_camera_are_not_seen(scene: Scene) -> None:
    away = torch.tensor([[0.0, 0.0, -5.0], [99.0, 0.0, 2.0]])
    means = scene.gaussians.means.clone()
    means[:2] = away
    moved = replace(scene, gaussians=replace(scene.gaussians, means=means))
    assert not in_view(moved)[:2].any()


def test_a_wrong_result_is_reported_as_one() -> None:
    one, other = [torch.zeros(4, 4, 3)], [torch.full((4, 4, 3), 0.1)]
    item = Item(name="x", full=lambda: one, lean=lambda: other, saved_bytes=0.0)
    row = Bench("x", repeats=1).measure(item)
    assert isinstance(row, Measured)
    assert row.error == pytest.approx(0.1)
    assert row.psnr_db == pytest.approx(20)
