"""Displacement of a larger copy of a photograph on the grids of all layers."""

from dataclasses import replace

import pytest
import torch
from image_layers import input_image, random_rgb

from diff4splat.generation.inputs.input_image import downsample
from diff4splat.generation.layered_image.pixel_maps.image_maps import FineMaps, ImageMaps
from diff4splat.generation.layered_image.pixel_maps.pixel_layer import pixel_layer
from diff4splat.generation.motion.displacement_maps import (
    depth_at,
    reduced_displacement,
    with_displacement,
    with_majority_displacement,
)

SIDE_PX = 16
PHOTO = input_image(random_rgb(4 * SIDE_PX, 4 * SIDE_PX))
LARGER, SMALL = downsample(PHOTO, 2), downsample(PHOTO, 4)


def plane_maps(depth: float = 4.0) -> ImageMaps:
    return ImageMaps(depth=torch.full((SIDE_PX, SIDE_PX), depth), displacement=None)


def one_pixel(depth: float = 4.0) -> tuple[torch.Tensor, torch.Tensor]:
    """Depth of the larger copy, and a displacement of its pixel (2, 4)."""
    displacement = torch.zeros(2, 2 * SIDE_PX, 2 * SIDE_PX, 3)
    displacement[1, 2, 4] = torch.tensor([0.5, 0.0, -0.25])
    return torch.full(displacement.shape[1:3], depth), displacement


def test_a_cell_moves_as_far_as_those_of_its_pixels_that_move() -> None:
    depth, displacement = one_pixel()
    small = reduced_displacement(displacement, depth, torch.full((SIDE_PX, SIDE_PX), 8.0))
    assert int(small.any(-1).any(0).sum()) == 1
    torch.testing.assert_close(small[1, 1, 2], torch.tensor([1.0, 0.0, -0.5]))


@pytest.mark.parametrize(("moving", "moves"), [(1, False), (2, True), (4, True)])
def test_the_majority_of_an_enlarged_copy_decides(moving: int, moves: bool) -> None:
    depth, displacement = one_pixel()
    for pixel in range(moving):
        displacement[1, 2 + pixel // 2, 4 + pixel % 2] = torch.tensor([0.5, 0.0, -0.25])
    maps = with_majority_displacement(plane_maps(8.0), depth, displacement)
    if not moves:
        assert maps.displacement is None
        return
    assert int(maps.displacement.any(-1).any(0).sum()) == 1
    torch.testing.assert_close(maps.displacement[1, 1, 2], torch.tensor([1.0, 0.0, -0.5]))


def test_pixels_move_as_the_larger_copy_does() -> None:
    depth, displacement = one_pixel()
    maps = with_displacement(plane_maps(), LARGER, depth, displacement)
    assert torch.equal(maps.fine.displacement, displacement)
    pixels = pixel_layer(SMALL, PHOTO, maps)
    moving = pixels.displacement.any(-1).any(0)
    assert 1 <= int(moving.sum()) <= 8 * 8, "one pixel of the larger copy, and its rim"


def test_the_small_copy_needs_no_larger_one() -> None:
    displacement = torch.ones(2, SIDE_PX, SIDE_PX, 3)
    maps = with_displacement(plane_maps(), SMALL, plane_maps().depth, displacement)
    assert maps.fine is None and maps.displacement is displacement


def test_a_still_larger_copy_with_depth_keeps_it() -> None:
    depth, displacement = one_pixel()
    fine = FineMaps(rgb=PHOTO.rgb, depth=torch.full((4 * SIDE_PX,) * 2, 6.0))
    maps = with_displacement(replace(plane_maps(), fine=fine), LARGER, depth, displacement)
    assert torch.equal(maps.fine.depth, fine.depth)
    moved = maps.fine.displacement[1].norm(dim=-1)
    assert float(moved.max()) == pytest.approx(1.5 * 0.3125**0.5, rel=1e-5), "as far in the image"


def test_a_copy_of_one_size_takes_the_depth_that_displacement_belongs_to() -> None:
    depth, displacement = one_pixel()
    fine = FineMaps(rgb=LARGER.rgb, depth=torch.full_like(depth, 6.0))
    maps = with_displacement(replace(plane_maps(), fine=fine), LARGER, depth, displacement)
    assert torch.equal(maps.fine.depth, depth)
    torch.testing.assert_close(maps.fine.displacement, displacement)


def test_depth_comes_from_the_copy_that_has_it() -> None:
    assert torch.equal(depth_at(plane_maps(), SMALL, SMALL), plane_maps().depth)
    larger = depth_at(plane_maps(3.0), SMALL, LARGER)
    torch.testing.assert_close(larger, torch.full((32, 32), 3.0))
    fine = FineMaps(rgb=LARGER.rgb, depth=torch.full((32, 32), 7.0))
    assert depth_at(replace(plane_maps(), fine=fine), SMALL, LARGER) is fine.depth
