"""Holes get the colours around them and the fine detail of patches, and equal images equal ones."""

import pytest
import torch
from image_layers import box_mask
from torch import Tensor

from diff4splat.generation.layered_image.disoccluded.texture import (
    means_within_objects,
    shifted,
    textured,
)

SIDE = 48


def _stripes() -> Tensor:
    """Six pixels wide, upright."""
    dark = (torch.arange(SIDE) // 3 % 2).float()
    return (0.3 + 0.4 * dark)[None, :, None].expand(SIDE, SIDE, 3).clone()


@pytest.mark.parametrize("size", [(1, 1), (1, 2), (2, 2), (3, 7), (30, 4), (16, 16), (130, 20)])
def test_holes_of_any_size_are_filled(size: tuple[int, int]) -> None:
    rgb = torch.rand(*size, 3, generator=torch.Generator().manual_seed(0))
    for number in {0, 1, rgb[..., 0].numel() // 2, rgb[..., 0].numel() - 1}:
        known = torch.arange(rgb[..., 0].numel()).view(size) >= number
        if bool(known.any()):
            found = textured(torch.where(known[..., None], rgb, torch.nan), known)
            assert torch.equal(found[known], rgb[known])
            assert bool(((found >= 0) & (found <= 1)).all())


def test_a_pattern_goes_on_in_phase() -> None:
    stripes = _stripes()
    found = textured(torch.where(box_mask()[..., None], torch.nan, stripes), ~box_mask())
    assert float((found - stripes)[box_mask()].abs().mean()) < 0.1  # 0.2 without it


def test_without_a_pattern_the_hole_is_even() -> None:
    found = textured(
        torch.where(box_mask()[..., None], torch.nan, torch.full((SIDE, SIDE, 3), 0.4)), ~box_mask()
    )
    torch.testing.assert_close(found, torch.full_like(found, 0.4))


def test_nothing_in_the_hole_is_read() -> None:
    rgb = torch.rand(SIDE, SIDE, 3, generator=torch.Generator().manual_seed(0))
    other = torch.where(box_mask()[..., None], 0.9, rgb)
    assert torch.equal(textured(rgb, ~box_mask()), textured(other, ~box_mask()))


def test_another_object_beside_the_hole_is_not_copied_into_it() -> None:
    image = torch.full((SIDE, SIDE, 3), 0.5)
    image[16:32, 36:46] = torch.tensor([0.1, 0.1, 0.9])
    assert float((textured(image, ~box_mask())[box_mask()] - 0.5).abs().mean()) < 0.05


def test_detail_of_another_surface_stays_there() -> None:
    """Beside the hole a bright, rough surface; above and below it a dark, even one."""
    generator = torch.Generator().manual_seed(0)
    image, hole = torch.full((SIDE, SIDE, 3), 0.1), torch.zeros(SIDE, SIDE, dtype=torch.bool)
    image[:, :24] = 0.7 + 0.4 * (torch.rand(SIDE, 24, 1, generator=generator) - 0.5)
    hole[8:40, 26:] = True
    found = textured(torch.where(hole[..., None], torch.nan, image), ~hole)
    assert float(found[12:36, 26:].diff(dim=0).abs().mean()) < 0.01  # 0.06 without likeness


def test_shifts_out_of_the_image_or_into_the_hole_give_nothing() -> None:
    image, known = torch.ones(3, 4, 3), torch.ones(3, 4, dtype=torch.bool)
    known[1, 1:3] = False
    shifts = torch.zeros(3, 4, 2, dtype=torch.long)
    for row, column, expected in ((0, 1, 0), (-2, 0, 0), (0, -1, 1)):
        shifts[1, 1] = torch.tensor([row, column])
        found = shifted(image, known, shifts)
        assert float(found[1, 1, 0]) == expected
        assert float(found[known].abs().sum()) == 0


def test_beside_an_object_the_mean_is_that_of_the_ground() -> None:
    image = torch.full((SIDE, SIDE, 3), 0.7)
    image[:, 24:] = torch.tensor([0.6, 0.2, 0.1])
    means = means_within_objects(image)
    assert float((means - image)[:, :20].abs().max()) < 0.02
    assert float((means - image)[:, 28:].abs().max()) < 0.02


def test_the_mean_of_a_fine_texture_is_even() -> None:
    noise = torch.rand(SIDE, SIDE, 3, generator=torch.Generator().manual_seed(0))
    assert float(means_within_objects(0.4 + 0.2 * noise).std()) < 0.5 * float(0.2 * noise.std())


def test_colours_of_another_object_leave_the_mean() -> None:
    image = torch.full((64, 192, 3), 0.2)
    image[:, :96] = torch.tensor([0.9, 0.1, 0.1])
    beside = means_within_objects(image)[:, 100]
    assert float((beside - 0.2).abs().max()) < 0.005  # 0.02 with a plain mean
