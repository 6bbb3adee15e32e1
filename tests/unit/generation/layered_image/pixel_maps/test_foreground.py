"""The foreground grows by a pixel at depth edges, and nowhere else."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from diff4splat.generation.layered_image.pixel_maps.foreground import grow_foreground
from diff4splat.generation.layered_image.types import DEPTH_STEP

NEAR, FAR = 2.0, 6.0


def _depth(side: int = 9) -> Tensor:
    """A near pixel in the middle of a far plane."""
    depth = torch.full((side, side), FAR)
    depth[side // 2, side // 2] = NEAR
    return depth


def _loop(depth: Tensor) -> Tensor:
    """Pixel by pixel, from the definition."""
    result = depth.clone()
    height, width = depth.shape
    for y in range(height):
        for x in range(width):
            around = [(y, x), (y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)]
            inside = [depth[j, i] for j, i in around if 0 <= j < height and 0 <= i < width]
            if math.log(depth[y, x] / min(inside)) > DEPTH_STEP:
                result[y, x] = min(inside)
    return result


@pytest.mark.parametrize("cell_px", [1, 2, 3])
def test_it_grows_by_a_pixel(cell_px: int) -> None:
    grown, _ = grow_foreground(_depth(), None, cell_px)
    rows, columns = torch.meshgrid(torch.arange(9), torch.arange(9), indexing="ij")
    near = (rows - 4).abs() + (columns - 4).abs() <= 1
    assert torch.equal(grown, torch.where(near, NEAR, FAR))


def test_static_pixels_do_not_join_what_moves() -> None:
    displacement = torch.zeros(3, 9, 9, 3)
    displacement[1:, 4, 4] = torch.tensor([0.5, -0.25, 1.0])
    depth, moved = grow_foreground(_depth(), displacement, 1)
    assert torch.equal(depth, _depth()) and torch.equal(moved, displacement)


def test_moving_pixels_do_not_join_what_is_static() -> None:
    displacement = torch.full((2, 9, 9, 3), 0.5)
    displacement[:, 4, 4] = 0
    depth, moved = grow_foreground(_depth(), displacement, 1)
    assert torch.equal(depth, _depth()) and torch.equal(moved, displacement)


def test_within_what_moves_pixels_move_along() -> None:
    displacement = torch.zeros(3, 9, 9, 3)
    displacement[1:, 3:6, 3:6] = 0.25
    displacement[1:, 4, 4] = torch.tensor([0.5, -0.25, 1.0])
    depth, moved = grow_foreground(_depth(), displacement, 1)
    for row, column in ((4, 4), (3, 4), (5, 4), (4, 3), (4, 5)):
        assert float(depth[row, column]) == NEAR
        assert torch.equal(moved[:, row, column], displacement[:, 4, 4])
    assert torch.equal(moved.any(-1).any(0), displacement.any(-1).any(0))


@pytest.mark.parametrize("cell_px", [1, 2, 3])
def test_within_what_moves_it_grows_by_a_cell(cell_px: int) -> None:
    moves = torch.full((2, 9, 9, 3), 0.25)
    grown, _ = grow_foreground(_depth(), moves, cell_px)
    rows, columns = torch.meshgrid(torch.arange(9), torch.arange(9), indexing="ij")
    near = (rows - 4).abs() + (columns - 4).abs() <= cell_px
    assert torch.equal(grown, torch.where(near, NEAR, FAR))


def test_slopes_below_the_step_stay() -> None:
    depth = torch.exp(0.9 * DEPTH_STEP * torch.arange(12.0)).expand(5, 12)
    assert torch.equal(grow_foreground(depth, None, 1)[0], depth)


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (7, 1)])
def test_images_of_one_row_or_column(size: tuple[int, int]) -> None:
    depth = torch.full(size, FAR)
    depth[0, 0] = NEAR
    assert torch.equal(grow_foreground(depth, None, 1)[0], _loop(depth))


@given(seed=st.integers(0, 10**6), spread=st.sampled_from([0.01, 0.1, 1.0, 30.0]))
def test_it_is_the_definition(seed: int, spread: float) -> None:
    generator = torch.Generator().manual_seed(seed)
    depth = torch.exp(spread * torch.randn(6, 7, generator=generator, dtype=torch.float64))
    assert torch.equal(grow_foreground(depth, None, 1)[0], _loop(depth))


@pytest.mark.parametrize("scale", [1e-37, 1e37])
def test_any_unit_will_do(scale: float) -> None:
    grown, _ = grow_foreground(scale * _depth(), None, 1)
    assert torch.equal(grown, scale * grow_foreground(_depth(), None, 1)[0])
