"""Windows around every pixel against the formula; beyond the border lie its pixels."""

import pytest
import torch

from diff4splat.generation.layered_image.windows import largest_around, mean_around, smallest_around


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
