"""Sides that networks take: multiples, never 0."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from diff4splat.models.blocks.resize import enlarged, nearest_multiple


@given(length=st.floats(0, 1e6), multiple=st.integers(1, 64))
def test_the_nearest_multiple_is_near_and_never_zero(length: float, multiple: int) -> None:
    found = nearest_multiple(length, multiple)
    assert found >= multiple and found % multiple == 0
    assert abs(found - length) <= multiple / 2 or found == multiple


@pytest.mark.parametrize(("side", "wanted"), [(8, 32), (64, 96), (80, 128)])
def test_an_enlarged_image_has_sides_of_multiples(side: int, wanted: int) -> None:
    image = torch.rand(1, 3, side, 64).round()
    found = enlarged(image, 1.5, 32)
    assert found.shape == (1, 3, wanted, 96)
    assert found.min() >= 0 and found.max() <= 1
