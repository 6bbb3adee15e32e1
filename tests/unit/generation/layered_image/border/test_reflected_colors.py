"""Colours beyond the border of a photograph: its reflection, which fades to the mean."""

import numpy as np
import pytest
import torch
from image_layers import random_rgb

from diff4splat.generation.layered_image.border.mixed_colors import continue_colors
from diff4splat.generation.layered_image.border.reflected_colors import FADE, reflect_colors


def test_beside_the_border_it_is_the_reflection() -> None:
    rgb = random_rgb(12, 16)
    wanted = np.pad(rgb.numpy(), ((2, 2), (2, 2), (0, 0)), mode="symmetric")
    assert torch.equal(reflect_colors(rgb, 2), torch.from_numpy(wanted))


def test_far_out_it_is_the_mean() -> None:
    rgb = random_rgb(12, 16)
    found, mixed = reflect_colors(rgb, 12), continue_colors(rgb, 12)
    assert FADE[1] * 16 <= 8
    torch.testing.assert_close(found[:5], mixed[:5])
    torch.testing.assert_close(found[:, -5:], mixed[:, -5:])


def test_between_them_it_fades_evenly() -> None:
    """Reflected black, mixed white: what is left of the reflection falls with distance."""
    rgb = torch.zeros(32, 32, 3)
    rgb[[0, -1]] = rgb[:, [0, -1]] = 1.0
    row = reflect_colors(rgb, 20)[36, :20, 0].flip(0)
    assert float(row[0]) == 1 and bool((row[1:8] == 0).all()) and bool((row[15:] > 0.999).all())
    assert bool((row[7:16].diff() > 0).all()) and 0.4 < float(row[11]) < 0.6


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (2, 2), (5, 1), (9, 4)])
@pytest.mark.parametrize("margin", [0, 1, 3, 20])
def test_margins_wider_than_the_image_reflect_it_to_and_fro(
    size: tuple[int, int], margin: int
) -> None:
    rgb = random_rgb(*size).double()
    found = reflect_colors(rgb, margin)
    assert found.shape == (size[0] + 2 * margin, size[1] + 2 * margin, 3)
    inside = (slice(margin, margin + size[0]), slice(margin, margin + size[1]))
    assert torch.equal(found[inside], rgb)
    assert bool(found.isfinite().all())
    assert float(found.min()) >= float(rgb.min()) - 1e-12
    assert float(found.max()) <= float(rgb.max()) + 1e-12
