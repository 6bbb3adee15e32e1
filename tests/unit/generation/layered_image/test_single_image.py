"""What one picture becomes: its own pixels, their backing, and the surroundings behind both."""

from dataclasses import replace

import pytest
import torch

from diff4splat.generation.keyframe_gaussians import (
    AROUND_CELLS,
    PIXEL_FOOTPRINT_PX,
    KeyframeGaussians,
    canonical_gaussians,
)
from diff4splat.generation.reconstruction import (
    Canonical,
    motion_from_offsets,
    prune_cells,
    reconstruct_detailed,
)
from diff4splat.geometry.camera import pinhole, project
from diff4splat.models.config.model import ActivationConfig
from diff4splat.models.ldrm.plane_prior import OPAQUE
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.models.ldrm.refinement.motion_features import key_depth
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.harmonics import color_from_dc

SIDE, MARGIN = 16, 2
PIXELS, AROUND = SIDE * SIDE, (SIDE // 4 + 2 * MARGIN) ** 2
CONFIG = ActivationConfig()


def sight(frames: int = 1) -> PosedVideo:
    torch.manual_seed(0)
    poses = torch.eye(4).repeat(1, frames, 1, 1)
    cameras = pinhole(20.0, (SIDE, SIDE)).with_pose(poses)
    return PosedVideo(rgb=torch.rand(1, 3, frames, SIDE, SIDE), cameras=cameras)


def maps(keys: int = 1) -> RawGaussianMaps:
    torch.manual_seed(1)
    around = SIDE // 4 + 2 * MARGIN
    return RawGaussianMaps(
        gaussians=torch.randn(1, 12, keys, SIDE, SIDE),
        tokens=torch.zeros(1, 1, keys, 1, 1),
        surroundings=torch.randn(1, 12, around, around),
    )


def one() -> KeyframeGaussians:
    return canonical_gaussians(maps(), sight(), CONFIG)


def test_pixels_are_small_opaque_and_of_their_own_colour() -> None:
    found, depth = one(), key_depth(maps().gaussians[0, -1], CONFIG)[0].flatten()
    own = found.gaussians.select(slice(PIXELS))
    assert len(found.gaussians) == 2 * PIXELS + AROUND and found.doubled == 0
    assert found.cells.tolist() == list(range(PIXELS)) and len(found.backing) == PIXELS
    wanted = sight().rgb[0, :, 0].movedim(0, -1).flatten(0, 1)
    torch.testing.assert_close(color_from_dc(own.sh[:, 0]), wanted, atol=1e-6, rtol=0)
    torch.testing.assert_close(own.opacities, torch.full_like(own.opacities, OPAQUE))
    footprint = PIXEL_FOOTPRINT_PX * depth / 20.0
    torch.testing.assert_close(own.scales, footprint[:, None].expand(-1, 3))
    torch.testing.assert_close(project(sight().cameras[0][0], own.means)[1], depth)


def test_looks_that_networks_tell_are_not_asked() -> None:
    raw = maps()
    other = raw.gaussians.clone()
    other[:, :-1] += 1
    raw = replace(raw, gaussians=other, surroundings=raw.surroundings + 1)
    changed = canonical_gaussians(raw, sight(), CONFIG)
    for name in ("means", "scales", "quats", "opacities", "sh"):
        assert torch.equal(getattr(changed.gaussians, name), getattr(one().gaussians, name)), name


def test_surroundings_stand_behind_what_the_picture_shows() -> None:
    around = one().gaussians.select(slice(2 * PIXELS, None))
    pixels, z = project(sight().cameras[0][0], around.means)
    depth = key_depth(maps().gaussians[0, -1], CONFIG)[0]
    seen = ((pixels >= 0) & (pixels < SIDE)).all(-1)
    assert bool(seen.any()) and not bool(seen.all())
    column, row = pixels[seen].long().unbind(-1)
    assert bool((z[seen] > depth[row, column]).all())


def test_surroundings_are_opaque_and_just_meet() -> None:
    around = one().gaussians.select(slice(2 * PIXELS, None))
    assert float(around.opacities.min()) > 0.98
    z = project(sight().cameras[0][0], around.means)[1]
    # A cell of theirs is four pixels wide.
    footprint = AROUND_CELLS * 4 * z / 20.0
    torch.testing.assert_close(around.scales, footprint[:, None].expand(-1, 3))


def test_depth_learns_and_the_backing_does_not() -> None:
    raw = maps()
    raw = replace(raw, gaussians=raw.gaussians.requires_grad_())
    found = canonical_gaussians(raw, sight(), CONFIG).gaussians
    behind = found.select(slice(PIXELS, 2 * PIXELS))
    (behind.means.sum() * 1.0 + found.means.sum() * 0 + found.sh.sum() * 0).backward()
    assert not raw.gaussians.grad.any()
    found = canonical_gaussians(raw, sight(), CONFIG).gaussians
    (found.means.square().sum() + found.scales.sum()).backward()
    assert bool(raw.gaussians.grad[:, -1].any()) and not raw.gaussians.grad[:, :-1].any()


def test_whole_videos_have_no_backing_and_keep_their_looks() -> None:
    found = canonical_gaussians(maps(2), sight(5), CONFIG)
    assert len(found.backing) == 0
    assert len(found.gaussians) == len(found.cells) + AROUND
    assert float(found.gaussians.opacities.min()) < OPAQUE


def canonical() -> Canonical:
    return reconstruct_detailed(maps(), sight(), CONFIG, RunLog())


def test_a_backing_goes_with_its_pixel_or_stands() -> None:
    scene = canonical()
    told = torch.zeros(2, SIDE, SIDE, 3)
    told[1, :, : SIDE // 2, 0] = 1.0
    motion = motion_from_offsets(scene, torch.tensor([0.0, 1.0]), told)
    offsets = torch.zeros(len(scene.gaussians), 3)
    offsets[motion.moving_index] = motion.offsets[-1]
    goes = told[1].flatten(0, 1)
    torch.testing.assert_close(offsets[:PIXELS], goes)
    own = scene.backing < PIXELS
    assert bool(own.any()) and not bool(own.all())
    wanted = torch.where(own[:, None], goes, torch.zeros(3))
    torch.testing.assert_close(offsets[PIXELS : 2 * PIXELS], wanted)
    assert not offsets[2 * PIXELS :].any()


@pytest.mark.parametrize("least", [0.0, 0.5])
def test_pruning_keeps_the_backing_in_step(least: float) -> None:
    scene = canonical()
    opacities = scene.gaussians.opacities.clone()
    opacities[PIXELS + 3], opacities[5] = 0.1, 0.2
    scene = replace(scene, gaussians=replace(scene.gaussians, opacities=opacities))
    kept = prune_cells(scene, least, RunLog())
    if least == 0:
        assert torch.equal(kept.backing, scene.backing) and torch.equal(kept.cells, scene.cells)
        return
    assert kept.cells.tolist() == [cell for cell in range(PIXELS) if cell != 5]
    wanted = torch.cat([scene.backing[:3], scene.backing[4:]])
    assert torch.equal(kept.backing, wanted)
    means = kept.gaussians.means[len(kept.cells) : len(kept.cells) + len(kept.backing)]
    own = scene.gaussians.means[PIXELS : 2 * PIXELS]
    assert torch.equal(means, torch.cat([own[:3], own[4:]]))


def test_colours_are_matched_on_pixels_and_their_own_backing() -> None:
    scene = canonical()
    every = scene.every_cell
    assert torch.equal(every[:PIXELS], scene.cells)
    assert torch.equal(every[PIXELS : 2 * PIXELS], scene.backing)
    assert bool((every[2 * PIXELS :] == PIXELS).all())
