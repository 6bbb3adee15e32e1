"""Between the pixels of one picture: where, how large, of what colour, and with whom it moves."""

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from diff4splat.generation.input_image import InputImage
from diff4splat.generation.keyframe_gaussians import PIXEL_FOOTPRINT_PX
from diff4splat.generation.layered_image.guided_upsampling import UpsampledScene
from diff4splat.generation.layered_image.subpixel_infill import (
    add_subpixel_gaussians,
    lattice_camera,
)
from diff4splat.geometry.camera import pinhole, project
from diff4splat.geometry.depth import distance_from_depth
from diff4splat.geometry.rays import pixel_centers, world_rays
from diff4splat.models.ldrm.plane_prior import OPAQUE
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians, concatenate
from diff4splat.scene.harmonics import color_from_dc
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.static import StaticMotion

SIZE_PX, FOCAL_PX = (5, 6), 9.0
PIXELS, OTHERS = 30, 4
BETWEEN = 9 * 11 - PIXELS
STILL = StaticMotion(time_range_s=(0.0, 2.0))
POSE = torch.tensor(
    [[0.8, 0.0, 0.6, 1.0], [0.0, 1.0, 0.0, -2.0], [-0.6, 0.0, 0.8, 0.5], [0.0, 0.0, 0.0, 1.0]]
)


def picture(rgb: Tensor | None = None) -> InputImage:
    torch.manual_seed(0)
    rgb = torch.rand(*SIZE_PX, 3) if rgb is None else rgb
    camera = pinhole(FOCAL_PX, SIZE_PX).with_pose(POSE)
    return InputImage(rgb=rgb, camera=camera, focal_source="test")


def plane(inverse_at_left: float = 0.25, per_pixel: float = 0.02) -> Tensor:
    """z of a plane that comes nearer to the right: its inverse is linear in pixels."""
    return (1 / (inverse_at_left + per_pixel * torch.arange(SIZE_PX[1]))).expand(SIZE_PX)


def plain(means: Tensor) -> Gaussians:
    count = len(means)
    return Gaussians(
        means=means,
        quats=torch.tensor([[1.0, 0.0, 0.0, 0.0]]).expand(count, 4),
        scales=torch.full((count, 3), 0.1),
        opacities=torch.full((count,), 0.5),
        sh=torch.zeros(count, 1, 3),
    )


def scene(depth: Tensor, motion: Motion = STILL, kept: Tensor | None = None) -> UpsampledScene:
    """Gaussians of pixels at their depth, and a few that are not of the picture."""
    origins, directions = world_rays(picture().camera)
    own = origins + distance_from_depth(picture().camera, depth)[..., None] * directions
    kept = torch.arange(PIXELS) if kept is None else kept
    own = plain(own.flatten(0, 1)[kept])
    return UpsampledScene(
        gaussians=concatenate([own, plain(torch.randn(OTHERS, 3))]),
        motion=motion,
        cells=torch.cat([kept, torch.tensor([0, 1, PIXELS, PIXELS])]),
        pixels=len(kept),
    )


def filled(
    depth: Tensor, motion: Motion = STILL, shown: InputImage | None = None
) -> UpsampledScene:
    return add_subpixel_gaussians(scene(depth, motion), shown or picture())


def added(found: UpsampledScene) -> Gaussians:
    return found.gaussians.select(slice(PIXELS + OTHERS, None))


def test_all_pixels_of_the_lattice_that_are_not_pixels_are_filled() -> None:
    found = filled(plane())
    assert len(found.gaussians) == PIXELS + OTHERS + BETWEEN
    assert torch.equal(found.gaussians.means[:PIXELS], scene(plane()).gaussians.means[:PIXELS])
    twice = (2 * (project(picture().camera, added(found).means)[0] - 0.5)).round(decimals=3)
    assert bool((twice == twice.round()).all()), "half pixels only"
    assert bool((twice % 2 == 1).any(-1).all()), "none on a pixel"
    assert len(twice.unique(dim=0)) == BETWEEN
    assert bool((twice >= 0).all()) and twice.amax(0).tolist() == [10, 8]


def test_the_lattice_camera_sees_pixels_at_every_other_place() -> None:
    camera = picture().camera
    fine = lattice_camera(camera)
    assert fine.size_px == (9, 11)
    points = torch.randn(20, 3, dtype=torch.float64) + POSE[:3, 3] + 4 * POSE[:3, 2]
    points = points.float()
    coarse, dense = project(camera, points)[0], project(fine, points)[0]
    torch.testing.assert_close(dense, 2 * (coarse - 0.5) + 0.5, atol=1e-4, rtol=1e-5)


def test_a_plane_stays_a_plane() -> None:
    found = added(filled(plane()))
    pixels, z = project(picture().camera, found.means)
    torch.testing.assert_close(1 / z, 0.25 + 0.02 * (pixels[:, 0] - 0.5), atol=1e-5, rtol=0)


def test_they_are_opaque_and_as_small_as_their_neighbours() -> None:
    found = added(filled(plane()))
    z = project(picture().camera, found.means)[1]
    torch.testing.assert_close(found.opacities, torch.full_like(z, OPAQUE))
    footprint = PIXEL_FOOTPRINT_PX * z / FOCAL_PX
    torch.testing.assert_close(found.scales, footprint[:, None].expand(-1, 3))


def test_colours_go_on_between_pixels() -> None:
    across = pixel_centers(SIZE_PX, torch.zeros(1))[..., :1].expand(-1, -1, 3)
    found = added(filled(plane(), shown=picture(0.2 + 0.1 * across)))
    column = project(picture().camera, found.means)[0][:, :1]
    inside = ((column > 2) & (column < 4))[:, 0]
    colors = color_from_dc(found.sh[:, 0])[inside]
    wanted = (0.2 + 0.1 * column[inside]).expand(-1, 3)
    torch.testing.assert_close(colors, wanted, atol=1e-5, rtol=0)


def test_colours_stay_colours_beside_hard_edges() -> None:
    rgb = torch.zeros(*SIZE_PX, 3)
    rgb[:, 3:] = 1.0
    colors = color_from_dc(added(filled(plane(), shown=picture(rgb))).sh[:, 0])
    assert float(colors.min()) >= -1e-6 and float(colors.max()) <= 1 + 1e-6


def test_beside_pruned_pixels_there_is_nothing() -> None:
    kept = torch.arange(PIXELS)[torch.arange(PIXELS) != 14]
    found = add_subpixel_gaussians(scene(plane(), kept=kept), picture())
    assert len(found.gaussians) == PIXELS - 1 + OTHERS + BETWEEN - 8
    assert bool(found.gaussians.means.isfinite().all())
    pixels = project(picture().camera, found.gaussians.means[PIXELS - 1 + OTHERS :])[0]
    hole = torch.tensor([14 % 6 + 0.5, 14 // 6 + 0.5])
    assert float((pixels - hole).abs().amax(-1).min()) > 0.9


def test_they_move_with_the_nearest_pixel_and_by_as_much_more() -> None:
    depth = plane()
    motion = KeyframeMotion(
        key_times_s=torch.tensor([0.0, 2.0]),
        moving_index=torch.arange(PIXELS),
        offsets=torch.randn(2, PIXELS, 3),
        rotations=torch.tensor([1.0, 0.0, 0.0, 0.0]).expand(2, PIXELS, 4),
        log_scale_offsets=torch.zeros(2, PIXELS, 3),
    )
    found = filled(depth, motion)
    assert isinstance(found.motion, KeyframeMotion)
    index = found.motion.moving_index
    assert torch.equal(index[:PIXELS], torch.arange(PIXELS))
    assert torch.equal(index[PIXELS:], torch.arange(BETWEEN) + PIXELS + OTHERS)
    torch.testing.assert_close(found.motion.offsets[:, :PIXELS], motion.offsets)
    pixels, z = project(picture().camera, added(found).means)
    # Half way between two, the one to the right and below; rounding must not decide.
    column, row = (pixels + 1e-3).floor().long().unbind(-1)
    own = row * SIZE_PX[1] + column
    wanted = motion.offsets[:, own] * (z / depth.flatten()[own])[:, None]
    torch.testing.assert_close(found.motion.offsets[:, PIXELS:], wanted, atol=1e-5, rtol=1e-4)


def test_only_pixels_have_a_place_in_the_picture() -> None:
    cells = filled(plane()).cells
    assert cells.tolist() == [*range(PIXELS), 0, 1, PIXELS, PIXELS, *[PIXELS] * BETWEEN]


@pytest.mark.parametrize("far", [1e4, 1e8])
def test_an_edge_of_depth_is_spanned(far: float) -> None:
    depth = torch.full(SIZE_PX, 2.0)
    depth[:, 3:] = far
    found = added(filled(depth))
    assert bool(found.means.isfinite().all()) and bool(found.scales.isfinite().all())
    z = project(picture().camera, found.means)[1]
    pixels = project(picture().camera, found.means)[0]
    edge = (pixels[:, 0] - 3.0).abs() < 0.1
    wanted = torch.full((int(edge.sum()),), 2 / (1 / 2.0 + 1 / far))
    torch.testing.assert_close(z[edge], wanted, rtol=1e-3, atol=0)


def test_from_half_as_far_they_close_most_of_the_gaps() -> None:
    found = filled(torch.full(SIZE_PX, 4.0))
    behind = replace(found.gaussians, opacities=found.gaussians.opacities.clone())
    behind.opacities[PIXELS : PIXELS + OTHERS] = 0.0
    camera = picture().camera
    pose = POSE.clone()
    pose[:3, 3] += 2.0 * POSE[:3, 2]
    near = camera.with_pose(pose)
    settings = RenderSettings(dilation_px2=0.0)
    with_them = render(behind, near, outputs=("alpha",), settings=settings).alpha
    alone = render(behind.select(slice(PIXELS)), near, outputs=("alpha",), settings=settings).alpha
    assert float(with_them[1:-1, 1:-1].min()) > 0.75
    assert float(alone[1:-1, 1:-1].min()) < 0.5
