"""Seeds lie on their objects, and objects are different ones as far as there are enough."""

import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from diff4splat.training.batches.requests.instance_seeds import (
    AREA_SHARES,
    SEEDS,
    draw_seeds,
    stack_seeds,
)


def numbers(count: int) -> Tensor:
    """``count`` squares of 6 pixels in a row, on no object."""
    image = torch.zeros(16, 8 * max(count, 1), dtype=torch.uint8)
    for index in range(count):
        image[4:10, 8 * index + 1 : 8 * index + 7] = index + 1
    return image


@given(st.integers(1, 9), st.integers(0, 2**31))
def test_seeds_lie_on_their_objects(count: int, seed: int) -> None:
    image = numbers(count)
    seeds = draw_seeds(image, torch.Generator().manual_seed(seed))
    assert bool(seeds.valid.all())
    torch.testing.assert_close(seeds.weights.sum(-1), torch.ones(SEEDS))
    assert not seeds.weights[~seeds.masks.flatten(1)].any()
    found = {int(image[mask].unique()) for mask in seeds.masks}
    assert len(found) == min(count, SEEDS) and 0 not in found


def test_seeds_are_one_pixel_or_several() -> None:
    generator = torch.Generator().manual_seed(0)
    image = torch.zeros(64, 64, dtype=torch.uint8)
    image[:32] = 1
    counts = [
        int((row > 0).sum()) for _ in range(8) for row in draw_seeds(image, generator).weights
    ]
    assert 8 < counts.count(1) < 40 and max(counts) > 20


def test_without_objects_or_with_specks_none_is_valid() -> None:
    generator = torch.Generator().manual_seed(0)
    speck = torch.zeros(64, 64, dtype=torch.uint8)
    speck[0, : int(AREA_SHARES[0] * 64 * 64)] = 3
    most = torch.full((64, 64), 2, dtype=torch.uint8)
    for image in (numbers(0), speck, most):
        seeds = draw_seeds(image, generator)
        assert not seeds.valid.any() and not seeds.weights.any()


def test_stacked() -> None:
    generator = torch.Generator().manual_seed(0)
    both = stack_seeds([draw_seeds(numbers(2), generator), draw_seeds(numbers(2), generator)])
    assert both.weights.shape == (2, SEEDS, 256) and both.masks.shape == (2, SEEDS, 16, 16)
