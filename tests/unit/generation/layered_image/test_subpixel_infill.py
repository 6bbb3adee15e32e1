"""Between the pixels of an image: place, size, colour and displacement."""

import math
from dataclasses import replace

import pytest
import torch
from image_layers import FAR_RANGES, FOCAL_PX, is_finite, layer, layered, random_depth
from torch import Tensor

from diff4splat.generation.layered_image.gaussians import image_gaussians, layer_gaussians
from diff4splat.generation.layered_image.pixel_maps.pixel_layer import PIXEL_FOOTPRINT_PX
from diff4splat.generation.layered_image.subpixel_infill import lattice_camera, subpixel_infill
from diff4splat.generation.layered_image.types import DEPTH_STEP, ImageLayer
from diff4splat.geometry.camera import pinhole, project
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings

SIZE_PX = (5, 6)
LATTICE = (9, 11)
BETWEEN = 9 * 11 - 5 * 6


def pixels(depth: Tensor, **changes: object) -> ImageLayer:
    return layer(depth, footprint_px=PIXEL_FOOTPRINT_PX, opacity=0.999, in_image=True, **changes)


def plane() -> Tensor:
    """z of a plane that comes nearer to the right: its inverse is linear in pixels."""
    return (1 / (0.25 + 0.02 * torch.arange(SIZE_PX[1]))).expand(SIZE_PX)


def lattice() -> tuple[Tensor, Tensor]:
    """Row and column in pixels of every lattice point: halves."""
    return torch.meshgrid(*(torch.arange(size) / 2 for size in LATTICE), indexing="ij")


def test_it_has_all_points_of_the_lattice_that_are_not_pixels() -> None:
    infill = subpixel_infill(pixels(plane()))
    assert infill.camera.size_px == LATTICE and int(infill.mask.sum()) == BETWEEN
    rows, columns = lattice()
    assert torch.equal(infill.mask, (rows % 1 != 0) | (columns % 1 != 0))
    assert infill.in_image and infill.pixel_index is None
    actual = project(pinhole(FOCAL_PX, SIZE_PX), layer_gaussians(infill).means)[0]
    wanted = torch.stack([columns, rows], -1)[infill.mask] + 0.5
    torch.testing.assert_close(actual, wanted, atol=1e-4, rtol=0)


def test_every_other_pixel_of_the_lattice_camera_is_a_pixel() -> None:
    camera = pinhole(FOCAL_PX, SIZE_PX)
    points = torch.randn(20, 3) + torch.tensor([0.0, 0.0, 5.0])
    coarse, fine = project(camera, points)[0], project(lattice_camera(camera), points)[0]
    torch.testing.assert_close(fine, 2 * (coarse - 0.5) + 0.5, atol=1e-4, rtol=1e-5)


def test_planes_stay_planes() -> None:
    infill = subpixel_infill(pixels(plane()))
    wanted = 1 / (0.25 + 0.02 * lattice()[1])
    torch.testing.assert_close(infill.depth, wanted, atol=1e-5, rtol=0)


def test_gaussians_are_as_large_as_those_of_pixels() -> None:
    image = pixels(torch.full(SIZE_PX, 4.0))
    own, between = layer_gaussians(image), layer_gaussians(subpixel_infill(image))
    torch.testing.assert_close(between.scales, own.scales[:1].expand(BETWEEN, 3))
    torch.testing.assert_close(between.opacities, own.opacities[:1].expand(BETWEEN))


def cubic(before: float, left: float, right: float, after: float) -> float:
    """Half way between ``left`` and ``right`` (Keys, a = -0.75, as torch has it)."""
    outer, inner = -0.09375, 0.59375
    return outer * (before + after) + inner * (left + right)


def test_colours_are_cubic() -> None:
    rgb = 0.3 + 0.4 * torch.rand(1, 8, 3)
    infill = subpixel_infill(pixels(torch.full((1, 8), 4.0), rgb=rgb))
    for column in range(1, 6):
        for channel in range(3):
            four = rgb[0, column - 1 : column + 3, channel].tolist()
            assert float(infill.rgb[0, 2 * column + 1, channel]) == pytest.approx(cubic(*four))


def test_colours_stay_in_range_beside_hard_edges() -> None:
    rgb = torch.zeros(*SIZE_PX, 3)
    rgb[:, 3:] = 1.0
    infill = subpixel_infill(pixels(plane(), rgb=rgb))
    assert float(infill.rgb.min()) >= 0 and float(infill.rgb.max()) <= 1


def test_points_move_as_the_nearest_pixel_in_proportion_to_depth() -> None:
    depth, displacement = random_depth(*SIZE_PX, (1.0, 9.0)), torch.randn(3, *SIZE_PX, 3)
    infill = subpixel_infill(pixels(depth, displacement=displacement))
    for row in range(LATTICE[0]):
        for column in range(LATTICE[1]):
            # Half way between two pixels the one below or to the right counts.
            pixel = ((row + 1) // 2, (column + 1) // 2)
            ratio = infill.depth[row, column] / depth[pixel]
            wanted = displacement[:, pixel[0], pixel[1]] * ratio
            torch.testing.assert_close(infill.displacement[:, row, column], wanted)


def test_a_static_image_has_a_static_infill() -> None:
    assert subpixel_infill(pixels(plane())).displacement is None


@pytest.mark.parametrize("far", [2.2, 1e4, 1e8])
def test_across_a_depth_edge_points_belong_to_the_far_side(far: float) -> None:
    depth = torch.full(SIZE_PX, 2.0)
    depth[2:, 3:] = far
    infill = subpixel_infill(pixels(depth))
    rows, columns = lattice()
    near = (rows < 1.5) & (columns >= 0) | (columns < 2.5)
    torch.testing.assert_close(infill.depth, torch.where(near, 2.0, far), rtol=1e-6, atol=0)


def test_a_step_below_the_threshold_is_bridged() -> None:
    depth = torch.full(SIZE_PX, 2.0)
    depth[:, 3:] = 2.0 * math.exp(0.9 * DEPTH_STEP)
    between = subpixel_infill(pixels(depth)).depth[:, 5]
    assert float(between.min()) > 2.0 and float(between.max()) < float(depth.max())


def test_across_an_edge_within_what_moves_points_are_in_between() -> None:
    depth, displacement = torch.full(SIZE_PX, 2.0), torch.full((2, *SIZE_PX, 3), 0.5)
    depth[:, 3:] = 6.0
    between = subpixel_infill(pixels(depth, displacement=displacement)).depth[:, 5]
    torch.testing.assert_close(between, torch.full_like(between, 3.0))


@pytest.mark.parametrize("moves", [(slice(None), slice(0, 3)), (slice(2, 4), slice(1, 2))])
def test_the_outline_of_what_moves_has_no_points(moves: tuple[slice, slice]) -> None:
    displacement = torch.zeros(2, *SIZE_PX, 3)
    displacement[1][moves] = 0.5
    moving = displacement[1, ..., 0] != 0
    infill = subpixel_infill(pixels(torch.full(SIZE_PX, 2.0), displacement=displacement))
    for row in range(LATTICE[0]):
        for column in range(LATTICE[1]):
            around = moving[row // 2 : (row + 1) // 2 + 1, column // 2 : (column + 1) // 2 + 1]
            is_pixel = row % 2 == 0 and column % 2 == 0
            one_side = bool(around.all()) or not bool(around.any())
            assert bool(infill.mask[row, column]) is (one_side and not is_pixel)


@pytest.mark.parametrize("limits", FAR_RANGES)
@pytest.mark.parametrize("size", [SIZE_PX, (1, 6), (6, 1), (1, 1)])
def test_any_depth_and_size_is_finite(limits: tuple[float, float], size: tuple[int, int]) -> None:
    depth = random_depth(*size, limits)
    infill = subpixel_infill(pixels(depth, displacement=torch.randn(2, *size, 3)))
    assert is_finite(infill)
    assert float(infill.depth.min()) >= 0.999 * float(depth.min())
    assert float(infill.depth.max()) <= 1.001 * float(depth.max())


def test_from_half_the_distance_it_closes_most_gaps() -> None:
    image = pixels(torch.full(SIZE_PX, 4.0))
    both = layered(image, subpixel_infill(image))
    pose = torch.eye(4)
    pose[2, 3] = 2.0
    near, settings = pinhole(FOCAL_PX, SIZE_PX).with_pose(pose), RenderSettings(dilation_px2=0.0)

    def alpha(count: int) -> Tensor:
        gaussians = image_gaussians(both, torch.zeros(1)).gaussians.select(slice(count))
        shown = render(gaussians, near, outputs=("alpha",), settings=settings).alpha
        return shown[1:-1, 1:-1]

    assert float(alpha(both.visible_count).min()) > 0.75
    assert float(alpha(30).min()) < 0.5


def test_across_a_depth_edge_colours_are_those_of_the_far_side() -> None:
    depth, rgb = torch.full(SIZE_PX, 2.0), torch.full((*SIZE_PX, 3), 0.1)
    depth[:, 3:], rgb[:, 3:] = 6.0, 0.8
    infill = subpixel_infill(pixels(depth, rgb=rgb))
    assert bool((infill.rgb[:, 5] == 0.8).all())
    # No overshoot of the cubic kernel on either side: it would be an outline.
    assert bool(((infill.rgb >= 0.1) & (infill.rgb <= 0.8)).all())


def test_a_layer_that_is_not_everywhere_is_filled_where_all_neighbours_are() -> None:
    mask = torch.ones(SIZE_PX, dtype=torch.bool)
    mask[:, 2] = False
    occluded = replace(pixels(plane()), mask=mask, in_image=False)
    infill = subpixel_infill(occluded)
    _, columns = lattice()
    assert not bool(infill.mask[(columns > 1) & (columns < 3)].any())
    assert int(infill.mask.sum()) == int(subpixel_infill(pixels(plane())).mask[:, :3].sum()) + int(
        subpixel_infill(pixels(plane())).mask[:, 6:].sum()
    )
    assert not infill.in_image
