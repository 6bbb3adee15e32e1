"""Windows around every pixel against the formula; beyond the border lie its pixels."""

import math

import pytest
import torch

from diff4splat.generation.layered_image.windows import (
    block_means,
    largest_around,
    mean_around,
    means_around,
    smallest_around,
)


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (5, 4), (9, 3)])
@pytest.mark.parametrize("radius_px", [0, 1, 3, 12])
def test_each_pixel_against_its_window(size: tuple[int, int], radius_px: int) -> None:
    values = torch.rand(*size, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    found = [around(values, radius_px) for around in (mean_around, largest_around, smallest_around)]
    reach = range(-radius_px, radius_px + 1)
    for row in range(size[0]):
        for column in range(size[1]):
            window = torch.stack(
                [
                    values[min(max(row + y, 0), size[0] - 1), min(max(column + x, 0), size[1] - 1)]
                    for y in reach
                    for x in reach
                ]
            )
            wanted = torch.stack([window.mean(), window.max(), window.min()])
            torch.testing.assert_close(torch.stack([each[row, column] for each in found]), wanted)


@pytest.mark.parametrize("size", [(1, 1), (3, 200), (256, 7), (257, 300), (300, 1), (513, 31)])
def test_means_of_wide_windows_keep_shape_range_and_even_images(size: tuple[int, int]) -> None:
    even = torch.full((*size, 2), 0.3)
    torch.testing.assert_close(means_around(even, 1 / 16), even)
    random = torch.rand(*size, 2, generator=torch.Generator().manual_seed(0))
    found = means_around(random, 1 / 16)
    assert found.shape == random.shape
    assert float(found.min()) >= 0 and float(found.max()) <= 1


def test_means_of_large_images_are_close_to_those_of_their_pixels() -> None:
    rows = torch.linspace(0, 1, 600)[:, None, None]
    image = (0.5 + 0.3 * torch.sin(4 * rows)).expand(600, 40, 1)
    exact = mean_around(image[..., 0], math.ceil(600 / 16))
    torch.testing.assert_close(means_around(image, 1 / 16)[..., 0], exact, atol=0.01, rtol=0)


def test_means_of_blocks_count_what_is_there() -> None:
    image = torch.arange(5.0)[:, None, None].expand(5, 3, 1)
    assert block_means(image, 2)[..., 0].tolist() == [[0.5, 0.5], [2.5, 2.5], [4.0, 4.0]]
