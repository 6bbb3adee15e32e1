"""Probability shared among the pixels of an object, which then moves whole."""

import pytest
import torch
from torch import Tensor

from diff4splat.generation.motion import object_pooling
from diff4splat.generation.motion.object_pooling import LOW_SHARE, MEAN_WEIGHT, pooled_by_object


def two_objects() -> tuple[Tensor, Tensor]:
    """Numbers of the left and right half of an image, and vectors that tell them apart."""
    numbers = torch.zeros(8, 12)
    numbers[:, 6:] = 1
    return numbers, torch.stack([numbers * 9, torch.zeros(8, 12), torch.zeros(8, 12)])


def test_a_part_of_an_object_speaks_for_all_of_it() -> None:
    numbers, instances = two_objects()
    probability = torch.zeros(8, 12)
    probability[2:4, 0:4] = 0.8
    pooled = pooled_by_object(probability, instances)
    own, other = pooled[numbers == 0], pooled[numbers == 1]
    assert float(own.min()) > 10 * float(other.max())
    assert float(pooled.max()) == pytest.approx(0.8)
    assert float(pooled[7, 5]) == pytest.approx(0.8 * MEAN_WEIGHT, abs=1e-3)
    # So all of it moves, and nothing else.
    assert torch.equal(pooled > LOW_SHARE * pooled.max(), numbers == 0)


def test_the_mean_is_that_over_cells_weighted_by_membership() -> None:
    torch.manual_seed(0)
    probability, instances = torch.rand(4, 6).double(), torch.randn(3, 4, 6).double()
    cells = torch.nn.functional.avg_pool2d(torch.cat([instances, probability[None]])[None], 2)[0]
    row, column, above, below = 3, 1, 0.0, 0.0
    for y in range(2):
        for x in range(3):
            distance = (instances[:2, row, column] - cells[:2, y, x]).square().sum()
            weight = torch.sigmoid(3 - distance * cells[2, y, x].exp()) ** 2
            above, below = above + float(weight * cells[3, y, x]), below + float(weight)
    found = object_pooling._mean_over_object(probability, instances)
    assert float(found[row, column]) == pytest.approx(above / below)


def test_nothing_probable_and_odd_sides() -> None:
    _, instances = two_objects()
    nothing = torch.zeros(8, 12)
    assert torch.equal(pooled_by_object(nothing, instances), nothing)
    odd = pooled_by_object(torch.rand(7, 5), torch.randn(3, 7, 5))
    assert odd.shape == (7, 5) and bool(odd.isfinite().all())


def test_extreme_vectors_are_finite() -> None:
    torch.manual_seed(0)
    probability = torch.rand(4, 4)
    for length in (0.0, 1e4, 1e8):
        for log_scale in (-6.0, 6.0):
            instances = length * torch.randn(3, 4, 4)
            instances[-1] = log_scale
            pooled = pooled_by_object(probability, instances)
            assert bool(pooled.isfinite().all()) and float(pooled.max()) <= 1


def test_chunks_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    torch.manual_seed(0)
    given = torch.rand(8, 12), torch.randn(3, 8, 12)
    whole = pooled_by_object(*given)
    monkeypatch.setattr(object_pooling, "CHUNK", 7)
    torch.testing.assert_close(pooled_by_object(*given), whole)


def test_long_images_have_larger_cells() -> None:
    numbers = torch.zeros(16, 2048)
    numbers[:, 900:] = 1
    instances = torch.stack([numbers * 9, torch.zeros(16, 2048), torch.zeros(16, 2048)])
    probability = torch.zeros(16, 2048)
    probability[:, 1000:1100] = 0.8
    assert torch.equal(pooled_by_object(probability, instances) > 0.28, numbers == 1)
