"""Colours beyond the border: each against the formula, and what stays as it is."""

import pytest
import torch

from diff4splat.generation.layered_image.border.mixed_colors import DECAY, continue_colors


def test_each_cell_against_the_formula() -> None:
    rgb = torch.rand(3, 4, 3, dtype=torch.float64)
    found = continue_colors(rgb, 2)
    edge = [(y, x) for y in range(3) for x in range(4) if y in (0, 2) or x in (0, 3)]
    for row in range(7):
        for column in range(8):
            y, x = row - 2, column - 2
            if 0 <= y < 3 and 0 <= x < 4:
                assert torch.equal(found[row, column], rgb[y, x])
                continue
            weights = [((y - i) ** 2 + (x - j) ** 2) ** (-DECAY / 2) for i, j in edge]
            mixed = sum(w * rgb[at] for w, at in zip(weights, edge, strict=True)) / sum(weights)
            torch.testing.assert_close(found[row, column], mixed)


def test_one_colour_stays_that_colour() -> None:
    rgb = torch.tensor([0.2, 0.5, 0.9]).expand(5, 6, 3)
    torch.testing.assert_close(continue_colors(rgb, 3), rgb[0, 0].expand(11, 12, 3))


def test_colours_stay_between_those_of_the_border() -> None:
    rgb = torch.rand(8, 8, 3)
    found = continue_colors(rgb, 40)
    assert bool(found.isfinite().all())
    assert found.min() >= rgb.min() and found.max() <= rgb.max() + 1e-6


def test_the_nearest_colour_counts_most_beside_the_border_and_less_farther_out() -> None:
    rgb = torch.zeros(6, 6, 3)
    rgb[0, 3] = 1
    column = continue_colors(rgb, 6)[:6, 9, 0].flip(0)
    assert column[0] > 0.6
    assert bool((column.diff() < 0).all())


@pytest.mark.parametrize("size", [(1, 1), (1, 5), (2, 2)])
def test_images_that_are_all_border(size: tuple[int, int]) -> None:
    rgb = torch.rand(*size, 3)
    found = continue_colors(rgb, 1)
    assert found.shape == (size[0] + 2, size[1] + 2, 3) and bool(found.isfinite().all())


def test_without_a_margin_nothing_changes() -> None:
    rgb = torch.rand(3, 3, 3)
    assert torch.equal(continue_colors(rgb, 0), rgb)
