"""What an image loses where it becomes smaller."""

import pytest
import torch

from diff4splat.generation.inputs.image_detail import LEAST, image_detail, lost_at


def checkerboard(side: int, square: int) -> torch.Tensor:
    index = torch.arange(side) // square
    return ((index[:, None] + index) % 2).float()[..., None].expand(-1, -1, 3)


def test_half_of_its_size_is_the_detail() -> None:
    image = torch.rand(20, 30, 3, generator=torch.Generator().manual_seed(0))
    assert image_detail(image) == lost_at(image, (10, 15))


def test_finer_images_lose_more_and_smaller_copies_more_of_them() -> None:
    fine, coarse = checkerboard(48, 1), checkerboard(48, 8)
    assert image_detail(fine) == pytest.approx(0.25, rel=0.02), "all becomes grey"
    assert image_detail(coarse) < 0.2 * image_detail(fine)
    assert lost_at(coarse, (40, 40)) < lost_at(coarse, (20, 20)) < lost_at(coarse, (10, 10))


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (16, 16)])
def test_flat_and_tiny_images_lose_next_to_nothing(shape: tuple[int, int]) -> None:
    assert image_detail(torch.full((*shape, 3), 0.4)) == LEAST
