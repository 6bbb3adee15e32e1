"""Blocks matched forward and backward."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from diff4splat.models.ldrm.optical_flow.block_matching import (
    BLOCK_PX,
    LARGEST_DIFFERENCE,
    LENGTH_COST,
    OUTSIDE_COST,
    REACH_PX,
    _column_costs,
    matched_displacement,
)

SIDE_PX = 32
INSIDE = (..., slice(9, -9), slice(9, -9))


def texture(count: int = 1, seed: int = 0) -> Tensor:
    coarse = torch.rand(count, 3, 16, 16, generator=torch.Generator().manual_seed(seed))
    return torch.nn.functional.interpolate(coarse, scale_factor=2, mode="bilinear")


@pytest.mark.parametrize(("right", "down"), [(5, 0), (0, -6), (-7, 4), (8, 8)])
def test_far_shifts_are_found_to_the_pixel(right: int, down: int) -> None:
    own = texture()
    displacement, found = matched_displacement(own, own.roll((down, right), (-2, -1)))
    assert float(found[INSIDE].float().mean()) > 0.95
    assert bool((displacement.movedim(1, -1)[found][:, 0] == right).float().mean() > 0.95)
    assert bool((displacement.movedim(1, -1)[found][:, 1] == down).float().mean() > 0.95)


def test_costs_are_those_of_the_formula() -> None:
    own, other = (texture(seed=seed)[..., :10, :12].double() for seed in (1, 2))
    span = range(-REACH_PX, REACH_PX + 1)
    costs = torch.cat([_column_costs(own, other, right) for right in span], 1)
    displacements = [(right, down) for right in span for down in span]
    for y, x, index in [(0, 0, 40), (5, 6, 144), (9, 11, 200), (4, 2, 180)]:
        right, down = displacements[index]
        cells = [
            (row, column)
            for row in range(max(0, y - BLOCK_PX // 2), min(10, y + BLOCK_PX // 2 + 1))
            for column in range(max(0, x - BLOCK_PX // 2), min(12, x + BLOCK_PX // 2 + 1))
        ]
        total = 0.0
        for row, column in cells:
            inside = 0 <= row + down < 10 and 0 <= column + right < 12
            there = other[0, :, row + down, column + right] if inside else torch.zeros(3)
            difference = float((there - own[0, :, row, column]).abs().mean())
            total += min(difference, LARGEST_DIFFERENCE)
        ends_inside = 0 <= y + down < 10 and 0 <= x + right < 12
        want = total / len(cells) + LENGTH_COST * (right**2 + down**2) ** 0.5
        want += 0.0 if ends_inside else OUTSIDE_COST
        assert float(costs[0, index, y, x]) == pytest.approx(want, abs=1e-6)


def test_only_what_moves_is_matched_and_what_it_occludes_is_not() -> None:
    background, item = texture(seed=3), texture(seed=4)
    source, target = background.clone(), background.clone()
    source[..., 8:18, 4:14] = item[..., 8:18, 4:14]
    target[..., 8:18, 11:21] = item[..., 8:18, 4:14]
    displacement, found = matched_displacement(source, target)
    assert float(found[0, 10:16, 6:12].float().mean()) > 0.9
    moved = displacement[0].movedim(0, -1)[found[0]]
    assert float((moved == torch.tensor([7.0, 0.0])).all(-1).float().mean()) > 0.9
    assert not found[0, 10:16, 17:20].any()
    assert not found[0, 24:].any()


@pytest.mark.parametrize("image", [texture(), torch.full((1, 3, SIDE_PX, SIDE_PX), 0.5)])
def test_a_static_image_has_no_match(image: Tensor) -> None:
    displacement, found = matched_displacement(image, image)
    assert not found.any() and not displacement.any()


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 1000), height=st.integers(1, 20), width=st.integers(1, 20))
def test_images_of_any_size_and_colour_are_finite(seed: int, height: int, width: int) -> None:
    generator = torch.Generator().manual_seed(seed)
    pair = torch.rand(2, 2, 3, height, width, generator=generator).round()
    displacement, found = matched_displacement(pair[0], pair[1])
    assert bool(displacement.isfinite().all())
    assert displacement.shape == (2, 2, height, width) and found.shape == (2, height, width)
