"""Coarse cells that lie as far as the ground have its colours."""

from dataclasses import replace

import pytest
import torch
from image_layers import layer

from diff4splat.generation.layered_image.ground_colors import INPAINTED_SHARE, with_ground_colors
from diff4splat.generation.layered_image.types import ImageLayer

SIDE, CELLS = 32, 8
NEAR, MIDDLE, FAR = 2.0, 4.0, 8.0
RED, BLUE = torch.tensor([0.9, 0.1, 0.1]), torch.tensor([0.1, 0.2, 0.8])


def _flat(side: int, depth: float, rgb: torch.Tensor) -> ImageLayer:
    return layer(torch.full((side, side), depth), rgb=rgb.expand(side, side, 3).clone())


def _coarse(depth: float, margin: int = 0) -> ImageLayer:
    cells = _flat(CELLS + 2 * margin, depth, RED)
    grid = _flat(SIDE, NEAR, RED).camera.resized((CELLS, CELLS))
    size = (CELLS + 2 * margin, CELLS + 2 * margin)
    return replace(cells, camera=grid.cropped((-margin, -margin), size))


def _with_ground(coarse: ImageLayer) -> ImageLayer:
    return with_ground_colors(coarse, _flat(SIDE, NEAR, RED), _flat(SIDE, FAR, BLUE))


def test_far_cells_have_the_colours_of_the_ground() -> None:
    found = _with_ground(_coarse(0.9 * FAR))
    torch.testing.assert_close(found.rgb, BLUE.expand(CELLS, CELLS, 3))


@pytest.mark.parametrize(("depth", "expected"), [(1.1 * MIDDLE, BLUE), (0.9 * MIDDLE, RED)])
def test_inpainted_ground_gives_colours_to_cells_that_are_nearer_to_it(
    depth: float, expected: torch.Tensor
) -> None:
    pixels, ground = _flat(SIDE, NEAR, RED), _flat(SIDE, FAR, BLUE)
    found = with_ground_colors(_coarse(depth), pixels, ground, INPAINTED_SHARE)
    torch.testing.assert_close(found.rgb, expected.expand(CELLS, CELLS, 3))


@pytest.mark.parametrize("depth", [1.1 * NEAR, 1.1 * MIDDLE])
def test_cells_between_object_and_ground_keep_its_colours(depth: float) -> None:
    coarse = _coarse(depth)
    assert torch.equal(_with_ground(coarse).rgb, coarse.rgb)


def test_cells_outside_of_the_image_keep_theirs() -> None:
    found = _with_ground(_coarse(0.9 * FAR, margin=2))
    assert torch.equal(found.rgb[0, 0], RED) and torch.equal(found.rgb[5, 11], RED)
    torch.testing.assert_close(found.rgb[2:10, 2:10], BLUE.expand(CELLS, CELLS, 3))


def test_a_surface_just_before_the_ground_keeps_its_colours() -> None:
    """A floor that ends at the sky lets no sky through."""
    coarse = _coarse(1.2 * NEAR)
    found = with_ground_colors(coarse, _flat(SIDE, NEAR, RED), _flat(SIDE, 1.2 * NEAR, BLUE))
    assert torch.equal(found.rgb, coarse.rgb)


def test_what_moves_keeps_its_colours() -> None:
    displacement = torch.zeros(2, CELLS, CELLS, 3)
    displacement[1, 0, 0] = 0.5
    found = _with_ground(replace(_coarse(0.9 * FAR), displacement=displacement))
    assert torch.equal(found.rgb[0, 0], RED)
    torch.testing.assert_close(found.rgb[1:], BLUE.expand(CELLS - 1, CELLS, 3))


def test_a_cell_has_the_mean_colour_of_its_pixels() -> None:
    ground = _flat(SIDE, FAR, BLUE)
    ground.rgb[:, ::2] = RED
    found = with_ground_colors(_coarse(0.9 * FAR), _flat(SIDE, NEAR, RED), ground)
    torch.testing.assert_close(found.rgb, ((RED + BLUE) / 2).expand(CELLS, CELLS, 3))
