"""Errors of shifts against their definition; every pixel's shift ends where colours are known."""

import pytest
import torch
from torch import Tensor

from diff4splat.generation.layered_image.disoccluded.shift_map import (
    candidate_shifts,
    shift_errors,
    shift_map,
)


def _rgb(height: int, width: int) -> Tensor:
    return torch.rand(height, width, 3, generator=torch.Generator().manual_seed(0))


def _hole(height: int, width: int) -> Tensor:
    hole = torch.zeros(height, width, dtype=torch.bool)
    hole[height // 3 : 2 * height // 3, width // 3 : 2 * width // 3] = True
    return hole


def test_errors_are_those_of_the_definition() -> None:
    """Each shift by a loop over the pixels, in float64."""
    height, width = 6, 7
    rgb, hole = _rgb(height, width).double(), _hole(height, width)
    ring = ~hole & (torch.arange(width) < 5)
    wrong, overlap, coverage = shift_errors(rgb, ~hole, ring)
    for row in range(1 - height, height):
        for column in range(1 - width, width):
            squares, filled = [], 0
            for y, x in ((y, x) for y in range(height) for x in range(width)):
                end = (y + row, x + column)
                if not (0 <= end[0] < height and 0 <= end[1] < width) or bool(hole[end]):
                    continue
                filled += int(hole[y, x])
                if bool(ring[y, x]):
                    squares.append(float((rgb[y, x] - rgb[end]).square().sum()))
            at = (row + height - 1, column + width - 1)
            mean = sum(squares) / max(len(squares), 1)
            assert float(wrong[at]) == pytest.approx(mean, abs=1e-9)
            assert float(overlap[at]) == pytest.approx(len(squares) / int(ring.sum()), abs=1e-9)
            assert float(coverage[at]) == pytest.approx(filled / int(hole.sum()), abs=1e-9)


def test_the_period_of_a_pattern_is_the_first_candidate() -> None:
    tile = _rgb(8, 8)
    rgb, hole = tile.repeat(4, 4, 1), _hole(32, 32)
    for shift in candidate_shifts(rgb, ~hole)[:4]:
        assert not bool((shift % 8).any())


def test_shifts_point_to_where_the_hole_is_shown_again() -> None:
    left = _rgb(20, 20)
    rgb, known = torch.cat([left, left], 1), torch.ones(20, 40, dtype=torch.bool)
    known[6:14, 6:14] = False
    assert candidate_shifts(rgb, known)[0].tolist() == [0, 20]
    shifts = shift_map(rgb, rgb, rgb, known)[~known]
    assert torch.equal(shifts, torch.tensor([0, 20]).expand_as(shifts))


def test_last_bits_do_not_change_the_order_of_shifts() -> None:
    """Transforms may round otherwise from run to run."""
    rgb, hole = _rgb(8, 8).double().repeat(4, 4, 1), _hole(32, 32)
    noise = 1e-13 * torch.rand(rgb.shape, dtype=rgb.dtype)
    assert torch.equal(candidate_shifts(rgb, ~hole), candidate_shifts(rgb + noise, ~hole))


@pytest.mark.parametrize("size", [(1, 1), (1, 5), (5, 1), (9, 12), (40, 33)])
def test_every_shift_ends_at_a_known_pixel(size: tuple[int, int]) -> None:
    generator = torch.Generator().manual_seed(1)
    for share in (0.0, 0.3, 0.9, 1.0):
        known = torch.rand(size, generator=generator) >= share
        image = _rgb(*size)
        shifts = shift_map(image, image, image, known)
        assert shifts.shape == (*size, 2)
        assert not bool(shifts[known].any())
        ends = torch.stack(known.logical_not().nonzero(as_tuple=True), -1) + shifts[~known]
        stays = ~shifts[~known].any(-1)
        assert bool((ends >= 0).all()) and bool((ends < torch.tensor(size)).all())
        assert bool((known[ends[:, 0], ends[:, 1]] | stays).all())


def test_colours_of_any_size_are_compared() -> None:
    """Also where all of them are equal, or far beyond one."""
    hole = _hole(24, 24)
    for scale in (0.0, 1e-20, 1e6):
        image = scale * _rgb(24, 24)
        shifts = shift_map(image, image, image, ~hole)
        assert bool(shifts[hole].any(-1).any())
