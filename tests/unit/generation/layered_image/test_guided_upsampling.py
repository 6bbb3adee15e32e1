"""A grid of cells with a photograph of sixteen pixels per cell."""

import math
from dataclasses import fields, replace

import pytest
import torch
from torch import Tensor

from diff4splat.generation.input_image import InputImage, downsample
from diff4splat.generation.layered_image.guided_upsampling import (
    ONE_SURFACE,
    OPAQUE,
    WIDEST_PX,
    UpsampledScene,
    upsample_to_photo,
)
from diff4splat.generation.layered_image.occlusion_order import push_behind_surface
from diff4splat.generation.reconstruction import Canonical
from diff4splat.geometry.camera import pinhole, project
from diff4splat.geometry.depth import distance_from_depth
from diff4splat.geometry.rays import pixel_centers, world_rays
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.scene.gaussians import Gaussians, concatenate
from diff4splat.scene.harmonics import color_from_dc
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.static import StaticMotion

GRID, SIDE = (4, 6), 4
CELLS, PIXELS = 24, 24 * SIDE**2
SIZE_PX = (GRID[0] * SIDE, GRID[1] * SIDE)
AROUND = 3
"""Gaussians behind those of the cells."""
STILL = StaticMotion(time_range_s=(0.0, 2.0))
POSE = torch.tensor(
    [[0.8, 0.0, 0.6, 1.0], [0.0, 1.0, 0.0, -2.0], [-0.6, 0.0, 0.8, 0.5], [0.0, 0.0, 0.0, 1.0]]
)
MAPS = RawGaussianMaps(gaussians=torch.zeros(1, 12, 2, *GRID), tokens=torch.zeros(1, 1, 1, 1, 1))


def photograph(rgb: Tensor | None = None) -> InputImage:
    rgb = torch.rand(*SIZE_PX, 3) if rgb is None else rgb
    camera = pinhole(20.0, SIZE_PX).with_pose(POSE)
    return InputImage(rgb=rgb, camera=camera, focal_source="test")


def some_gaussians(means: Tensor) -> Gaussians:
    count = len(means)
    return Gaussians(
        means=means,
        quats=torch.nn.functional.normalize(torch.randn(count, 4), dim=-1),
        scales=0.1 + torch.rand(count, 3),
        opacities=torch.rand(count),
        sh=torch.randn(count, 1, 3),
    )


def scene(photo: InputImage, depth: Tensor | None = None, cells: Tensor | None = None) -> Canonical:
    """One Gaussian per cell at the cell's depth, 4 if left out, and a few behind them."""
    depth = torch.full(GRID, 4.0) if depth is None else depth
    cells = torch.arange(CELLS) if cells is None else cells
    camera = photo.camera.resized(GRID)
    origins, directions = world_rays(camera)
    means = origins + distance_from_depth(camera, depth)[..., None] * directions
    own = some_gaussians(means.flatten(0, 1)[cells])
    return Canonical(
        gaussians=concatenate([own, some_gaussians(torch.randn(AROUND, 3))]),
        cells=cells,
        maps=MAPS,
    )


def refined(canonical: Canonical, photo: InputImage, motion: Motion = STILL) -> UpsampledScene:
    return upsample_to_photo(canonical, motion, downsample(photo, SIDE), photo)


def own_cells() -> Tensor:
    """The cell in which each pixel lies."""
    cells = torch.arange(CELLS).view(GRID)
    return cells.repeat_interleave(SIDE, 0).repeat_interleave(SIDE, 1).flatten()


def as_cells(rgb: Tensor) -> Tensor:
    return rgb.repeat_interleave(SIDE, 0).repeat_interleave(SIDE, 1)


def moving(index: list[int]) -> KeyframeMotion:
    count = len(index)
    return KeyframeMotion(
        key_times_s=torch.tensor([0.0, 2.0]),
        moving_index=torch.tensor(index, dtype=torch.long),
        offsets=torch.randn(2, count, 3),
        rotations=torch.nn.functional.normalize(torch.randn(2, count, 4), dim=-1),
        log_scale_offsets=torch.randn(2, count, 3),
    )


def test_on_a_plane_every_pixel_gets_a_gaussian_of_its_own_place_and_colour() -> None:
    photo = photograph()
    found = refined(scene(photo), photo)
    assert len(found.gaussians) == PIXELS + AROUND and found.pixels == PIXELS
    pixels, depth = project(photo.camera, found.gaussians.means[:PIXELS])
    wanted = pixel_centers(SIZE_PX, pixels).flatten(0, 1)
    torch.testing.assert_close(pixels, wanted, atol=1e-4, rtol=0)
    torch.testing.assert_close(depth, torch.full((PIXELS,), 4.0), atol=1e-5, rtol=0)
    colors = color_from_dc(found.gaussians.sh[:PIXELS, 0])
    torch.testing.assert_close(colors, photo.rgb.flatten(0, 1))


def test_where_cells_look_like_their_pixels_each_takes_after_its_own_cell() -> None:
    photo = photograph(as_cells(torch.rand(*GRID, 3)))
    canonical = scene(photo)
    found, parents = refined(canonical, photo), canonical.gaussians.select(own_cells())
    wanted = (parents.scales / SIDE).clamp_max(WIDEST_PX * 4.0 / 20.0)
    assert bool((wanted < parents.scales / SIDE).any())
    torch.testing.assert_close(found.gaussians.scales[:PIXELS], wanted)
    assert torch.equal(found.gaussians.quats[:PIXELS], parents.quats)
    assert torch.equal(found.gaussians.opacities[:PIXELS], parents.opacities.clamp_min(OPAQUE))


def test_pixels_are_numbered_and_all_others_get_the_number_after_the_last() -> None:
    photo = photograph()
    cells = refined(scene(photo), photo).cells
    assert cells.tolist() == [*range(PIXELS), *[PIXELS] * AROUND]


@pytest.mark.parametrize("blurred_depth", [2.0, 4.0, 8.0])
def test_a_depth_edge_at_a_colour_edge_is_as_sharp_as_the_photograph(blurred_depth: float) -> None:
    rgb = torch.zeros(*SIZE_PX, 3)
    rgb[:, 10:] = 1.0
    photo = photograph(rgb)
    depth = torch.full(GRID, 2.0)
    depth[:, 3:] = 8.0
    depth[:, 2] = blurred_depth
    found = refined(scene(photo, depth), photo)
    z = project(photo.camera, found.gaussians.means[:PIXELS])[1].view(SIZE_PX)
    torch.testing.assert_close(z, 2.0 + 6.0 * rgb[..., 0], atol=1e-4, rtol=0)


def test_one_surface_is_continued_between_the_cells() -> None:
    photo = photograph(torch.full((*SIZE_PX, 3), 0.5))
    depth = (4.0 * torch.exp(0.5 * ONE_SURFACE * torch.arange(GRID[1]))).expand(GRID).contiguous()
    found = refined(scene(photo, depth), photo)
    z = project(photo.camera, found.gaussians.means[:PIXELS])[1].view(SIZE_PX)
    torch.testing.assert_close(z, z[:1].expand(SIZE_PX), atol=1e-4, rtol=0)
    steps = z[0, SIDE:-SIDE].log().diff()
    assert float(steps.min()) > 0, "depth rises with every pixel, not with every cell"
    assert float(steps.max()) < 0.5 * 0.5 * ONE_SURFACE


def test_pixels_of_a_missing_cell_take_after_its_neighbours() -> None:
    photo = photograph()
    kept = torch.arange(CELLS)[torch.arange(CELLS) != 8]
    found = refined(scene(photo, cells=kept), photo)
    assert found.cells.tolist() == [*range(PIXELS), *[PIXELS] * AROUND]
    depth = project(photo.camera, found.gaussians.means[:PIXELS])[1]
    torch.testing.assert_close(depth, torch.full((PIXELS,), 4.0), atol=1e-5, rtol=0)


def test_pixels_without_any_cell_near_are_left_out() -> None:
    photo = photograph()
    missing = torch.zeros(GRID, dtype=torch.bool)
    missing[:3, :3] = True
    kept = (~missing).flatten().nonzero()[:, 0]
    found = refined(scene(photo, cells=kept), photo)
    alone = torch.zeros(SIZE_PX, dtype=torch.bool)
    alone[: 2 * SIDE, : 2 * SIDE] = True
    wanted = (~alone).flatten().nonzero()[:, 0]
    assert torch.equal(found.cells[:-AROUND], wanted)
    means = found.gaussians.means[:-AROUND]
    assert bool(means.isfinite().all()) and len(means) == len(wanted)
    pixels = project(photo.camera, means)[0]
    centers = pixel_centers(SIZE_PX, pixels).flatten(0, 1)[wanted]
    torch.testing.assert_close(pixels, centers, atol=1e-4, rtol=0)


def test_children_move_as_their_parents() -> None:
    photo = photograph(as_cells(torch.rand(*GRID, 3)))
    motion, parents = moving([3, 4, 10, 23]), own_cells()
    found = refined(scene(photo), photo, motion).motion
    assert isinstance(found, KeyframeMotion)
    index = found.moving_index
    assert bool((index.diff() > 0).all())
    assert torch.equal(index, torch.isin(parents, motion.moving_index).nonzero()[:, 0])
    row = torch.searchsorted(motion.moving_index, parents[index])
    for name in ("offsets", "rotations", "log_scale_offsets"):
        torch.testing.assert_close(getattr(found, name), getattr(motion, name)[:, row])
    assert torch.equal(found.key_times_s, motion.key_times_s)


def test_what_is_farther_than_its_parent_is_larger_and_moves_as_much_more() -> None:
    photo = photograph(torch.full((*SIZE_PX, 3), 0.5))
    depth = (4.0 * torch.exp(0.5 * ONE_SURFACE * torch.arange(GRID[1]))).expand(GRID).contiguous()
    canonical, motion = scene(photo, depth), moving(list(range(CELLS)))
    found, parents = refined(canonical, photo, motion), own_cells()
    z = project(photo.camera, found.gaussians.means[:PIXELS])[1]
    farther = z / depth.flatten()[parents]
    assert float(farther.max()) > 1.005 and float(farther.min()) < 0.995
    torch.testing.assert_close(found.motion.offsets, motion.offsets[:, parents] * farther[:, None])
    torch.testing.assert_close(found.motion.rotations, motion.rotations[:, parents])
    wanted = canonical.gaussians.scales[parents] * farther[:, None] / SIDE
    wanted = torch.minimum(wanted, (WIDEST_PX * z / 20.0)[:, None])
    torch.testing.assert_close(found.gaussians.scales[:PIXELS], wanted)


def test_what_lies_behind_the_cells_goes_behind_the_picture_and_never_moves() -> None:
    photo = photograph()
    canonical = scene(photo)
    found = refined(canonical, photo, moving(list(range(CELLS))))
    around = canonical.gaussians.select(slice(CELLS, None))
    around = push_behind_surface(around, torch.full(GRID, 4.0), photo.camera.resized(GRID))
    for field in fields(Gaussians):
        before = getattr(around, field.name)
        after = getattr(found.gaussians, field.name)[PIXELS:]
        torch.testing.assert_close(after, before, msg=field.name)
    assert torch.equal(found.motion.moving_index, torch.arange(PIXELS))


def test_cells_of_later_frames_keep_their_gaussians_and_their_motion() -> None:
    photo = photograph()
    canonical = scene(photo)
    canonical = replace(canonical, cells=torch.cat([canonical.cells, torch.tensor([CELLS + 5])]))
    motion = moving([0, CELLS])
    found = refined(canonical, photo, motion)
    assert torch.equal(found.gaussians.means[PIXELS], canonical.gaussians.means[CELLS])
    assert found.cells[PIXELS:].tolist() == [PIXELS] * AROUND
    assert int(found.motion.moving_index[-1]) == PIXELS
    torch.testing.assert_close(found.motion.offsets[:, -1], motion.offsets[:, 1])


def test_what_backs_the_cells_stays_where_it_is() -> None:
    photo = photograph()
    canonical = replace(scene(photo), backing=torch.tensor([2, CELLS]))
    found = refined(canonical, photo).gaussians
    backs = slice(PIXELS, PIXELS + 2)
    assert torch.equal(found.means[backs], canonical.gaussians.means[CELLS : CELLS + 2])
    assert torch.equal(found.scales[backs], canonical.gaussians.scales[CELLS : CELLS + 2])


def test_what_stands_still_goes_on_standing() -> None:
    photo = photograph()
    found = refined(scene(photo), photo).motion
    assert isinstance(found, StaticMotion)
    assert found.time_range_s == STILL.time_range_s


def test_a_motion_of_nothing_moves_nothing() -> None:
    photo = photograph()
    found = refined(scene(photo), photo, moving([]))
    assert len(found.motion.moving_index) == 0


def test_cells_of_another_surface_do_not_count_whatever_their_colour() -> None:
    photo = photograph(torch.full((*SIZE_PX, 3), 0.5))
    depth = 2.0 * torch.exp(torch.arange(CELLS) * math.log(1.2)).view(GRID)
    found = refined(scene(photo, depth), photo)
    z = project(photo.camera, found.gaussians.means[:PIXELS])[1]
    torch.testing.assert_close(z, depth.flatten()[own_cells()], rtol=1e-4, atol=0)
