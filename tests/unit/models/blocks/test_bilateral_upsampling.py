"""Weights of the cells around a pixel: near cells of its colour count most."""

import torch

from diff4splat.models.blocks.bilateral_upsampling import log_weights, neighbourhood

RED, BLUE = torch.tensor([0.9, 0.1, 0.1]), torch.tensor([0.1, 0.1, 0.9])


def upsampled(maps: torch.Tensor, weight: torch.Tensor) -> torch.Tensor:
    """Weighted means of the cells around every pixel."""
    side = weight.shape[-1] // maps.shape[-1]
    return (weight.softmax(0) * neighbourhood(maps, side)).sum(1)


def halves(height: int, width: int) -> torch.Tensor:
    """Red to the left, blue to the right."""
    image = BLUE.expand(height, width, 3).clone()
    image[:, : width // 2] = RED
    return image


def test_every_pixel_has_nine_cells_around_it() -> None:
    maps = torch.arange(12.0).view(1, 3, 4)
    found = neighbourhood(maps, 2)
    assert found.shape == (1, 9, 6, 8)
    torch.testing.assert_close(found[0, 4], maps[0].repeat_interleave(2, 0).repeat_interleave(2, 1))
    torch.testing.assert_close(found[0, :, 2, 2], torch.tensor([0.0, 1, 2, 4, 5, 6, 8, 9, 10]))
    # Beyond the border it continues.
    torch.testing.assert_close(found[0, :, 0, 0], torch.tensor([0.0, 0, 1, 0, 0, 1, 4, 4, 5]))


def test_what_is_everywhere_the_same_stays_so() -> None:
    weight = log_weights(torch.rand(3, 4, 3), torch.rand(12, 16, 3))
    found = upsampled(torch.full((2, 3, 4), 1.5), weight)
    torch.testing.assert_close(found, torch.full((2, 12, 16), 1.5))


def test_edges_follow_edges_of_colour() -> None:
    # Cells of mixed colour lie between; pixels are pure.
    cells = halves(4, 8)
    cells[:, 3] = 0.6 * RED + 0.4 * BLUE
    maps = torch.zeros(1, 4, 8)
    maps[..., :4] = 1.0
    found = upsampled(maps, log_weights(cells, halves(16, 32)))[0]
    assert bool((found[:, :16] > 0.95).all())
    assert bool((found[:, 16:] < 0.05).all())


def test_in_one_colour_it_is_a_smooth_blend() -> None:
    flat = RED.expand(4, 4, 3)
    ramp = torch.arange(4.0).expand(1, 4, 4)
    found = upsampled(ramp, log_weights(flat, RED.expand(16, 16, 3)))[0, 8]
    assert bool((found.diff() >= -1e-6).all()) and 0 <= float(found[0]) < float(found[-1]) <= 3
