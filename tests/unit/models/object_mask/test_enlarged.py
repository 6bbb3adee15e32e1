"""The enlarged image that the object mask sees, and its logits at the size of the image."""

import pytest
import torch

from diff4splat.models.image_unet.cells import MULTIPLE_PX
from diff4splat.models.object_mask.enlarged import ENLARGEMENT, enlarged, reduced


@pytest.mark.parametrize("size", [(16, 16), (64, 128), (144, 80)])
def test_sides_are_larger_multiples(size: tuple[int, int]) -> None:
    found = enlarged(torch.rand(2, 3, *size))
    for side, larger in zip(size, found.shape[-2:], strict=True):
        assert larger % MULTIPLE_PX == 0 and larger >= side
        assert abs(larger - ENLARGEMENT * side) <= MULTIPLE_PX / 2


def test_an_even_image_stays_even_and_colours_stay_in_range() -> None:
    torch.testing.assert_close(
        enlarged(torch.full((1, 3, 32, 32), 0.4)).unique().mean().item(), 0.4
    )
    steps = (torch.rand(1, 3, 32, 32) > 0.5).float()
    assert float(enlarged(steps).min()) >= 0 and float(enlarged(steps).max()) <= 1


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_logits_come_back_in_place(dtype: torch.dtype) -> None:
    mask = torch.zeros(1, 1, 32, 48)
    mask[..., 8:20, 16:36] = 1
    found = reduced(enlarged(mask).to(dtype), (32, 48))
    assert found.dtype == torch.float32
    assert torch.equal(found > 0.5, mask > 0.5)


def test_gradients_pass() -> None:
    logits = torch.randn(1, 1, 24, 24, requires_grad=True)
    reduced(logits, (16, 16)).sum().backward()
    assert bool(logits.grad.isfinite().all()) and bool((logits.grad > 0).all())
