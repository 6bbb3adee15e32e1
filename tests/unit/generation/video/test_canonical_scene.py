"""LDRM's maps as Gaussians: which cells are kept, and which of them are dropped."""

from dataclasses import replace

import pytest
import torch
from image_layers import FOCAL_PX

from diff4splat.errors import ConfigError
from diff4splat.generation.layered_image.visibility import visible_in_earlier_frame
from diff4splat.generation.video.canonical_scene import (
    CanonicalScene,
    keyframe_plane_prior,
    prune_cells,
    reconstruct,
    reconstruct_refined,
)
from diff4splat.geometry.camera import pinhole, project
from diff4splat.models.config.networks import ActivationConfig
from diff4splat.models.ldrm.plane_prior import OPAQUE, PLANE_DEPTH
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.models.ldrm.refinement.motion_features import key_depth
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.harmonics import color_from_dc

SIDE, MARGIN, KEYS = 16, 2, 2
CELLS, BORDER = KEYS * SIDE * SIDE, (SIDE // 4 + 2 * MARGIN) ** 2
FINE_BORDER = (SIDE + 2 * (SIDE // 8)) ** 2 - SIDE**2
CONFIG = ActivationConfig()


def video() -> PosedVideo:
    torch.manual_seed(0)
    cameras = pinhole(FOCAL_PX, (SIDE, SIDE)).with_pose(torch.eye(4).repeat(1, 5, 1, 1))
    return PosedVideo(rgb=torch.rand(1, 3, 5, SIDE, SIDE), cameras=cameras)


def maps(scale: float = 1.0) -> RawGaussianMaps:
    torch.manual_seed(1)
    around = SIDE // 4 + 2 * MARGIN
    return RawGaussianMaps(
        gaussians=scale * torch.randn(1, 12, KEYS, SIDE, SIDE),
        tokens=torch.zeros(1, 1, KEYS, 1, 1),
        border=scale * torch.randn(1, 12, around, around),
    )


def canonical() -> CanonicalScene:
    return reconstruct_refined(maps(), video(), CONFIG, RunLog())


def test_without_corrections_every_cell_is_its_base() -> None:
    base = keyframe_plane_prior(video().key_rgb[0].movedim(1, -1), video().key_cameras[0])
    scene = reconstruct(maps(0.0), base, CONFIG)
    assert scene.cell_index.tolist() == list(range(CELLS))
    z = project(video().cameras[0][0], scene.gaussians.means)[1]
    torch.testing.assert_close(z, torch.full((CELLS,), PLANE_DEPTH))
    rgb = video().key_rgb[0].movedim(1, -1).reshape(-1, 3)
    torch.testing.assert_close(color_from_dc(scene.gaussians.sh[:, 0]), rgb, atol=1e-5, rtol=0)
    torch.testing.assert_close(scene.gaussians.opacities, torch.full((CELLS,), OPAQUE))


def test_only_kept_cells_become_gaussians() -> None:
    base = keyframe_plane_prior(video().key_rgb[0].movedim(1, -1), video().key_cameras[0])
    kept = torch.rand(KEYS, SIDE, SIDE) < 0.3
    some, everything = (reconstruct(maps(), base, CONFIG, mask) for mask in (kept, None))
    assert torch.equal(some.cell_index, kept.flatten().nonzero()[:, 0])
    assert torch.equal(some.gaussians.means, everything.gaussians.means[some.cell_index])
    nothing = reconstruct(maps(), base, CONFIG, torch.zeros_like(kept))
    assert len(nothing.gaussians) == len(nothing.cell_index) == 0


def test_pixels_that_an_earlier_key_frame_shows_are_left_out() -> None:
    log = RunLog()
    scene = reconstruct_refined(maps(), video(), CONFIG, log)
    depth = key_depth(maps().gaussians[0, -1], CONFIG)
    duplicates = visible_in_earlier_frame(depth, video().key_cameras[0])
    assert bool(duplicates.any())
    assert torch.equal(scene.cell_index, (~duplicates).flatten().nonzero()[:, 0])
    # Both key frames have one camera, so one border.
    assert len(scene.gaussians) == len(scene.cell_index) + BORDER + FINE_BORDER
    (omission,) = log.skipped
    assert omission.saved == f"{int(duplicates.sum()):,} Gaussians"


def test_a_video_without_a_border_layer_has_its_cells_alone() -> None:
    scene = reconstruct_refined(replace(maps(), border=None), video(), CONFIG, RunLog())
    assert len(scene.gaussians) == len(scene.cell_index)


def test_depth_receives_gradients() -> None:
    raw = replace(maps(), gaussians=maps().gaussians.requires_grad_())
    scene = reconstruct_refined(raw, video(), CONFIG, RunLog())
    scene.gaussians.means.square().sum().backward()
    assert bool(raw.gaussians.grad[:, -1].any()) and not raw.gaussians.grad[:, :-1].any()


def test_pruning_keeps_cells_and_border_in_step() -> None:
    scene, log = canonical(), RunLog()
    pruned = prune_cells(scene, 0.9, log)
    kept = scene.gaussians.opacities >= 0.9
    assert 0 < int(kept.sum()) < len(kept)
    assert torch.equal(pruned.gaussians.means, scene.gaussians.means[kept])
    assert torch.equal(pruned.cell_index, scene.cell_index[kept[: len(scene.cell_index)]])
    (omission,) = log.skipped
    assert omission.error == float(scene.gaussians.opacities[~kept].max())


def test_dropping_what_no_renderer_draws_costs_nothing() -> None:
    scene, log = canonical(), RunLog()
    faint = torch.full_like(scene.gaussians.opacities, 1 / 300)
    faint[0] = 0.5
    scene = replace(scene, gaussians=replace(scene.gaussians, opacities=faint))
    prune_cells(scene, 1 / 255, log)
    assert [omission.error for omission in log.skipped] == [0.0]
    silent = RunLog()
    assert len(prune_cells(scene, 0.0, silent).gaussians) == len(faint)
    assert len(silent.skipped) == 0


def test_a_scene_must_keep_a_gaussian_but_a_fill_need_not() -> None:
    with pytest.raises(ConfigError, match="--min-opacity"):
        prune_cells(canonical(), 1.0, RunLog())
    assert len(prune_cells(canonical(), 1.0, RunLog(), may_be_empty=True).gaussians) == 0
