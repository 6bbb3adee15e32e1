"""Where a network makes rows of a texture, patches of the texture itself; its structures stay."""

import pytest
import torch
from torch import Tensor

from diff4splat.generation.layered_image.disoccluded import patch_texture
from diff4splat.generation.layered_image.disoccluded.patch_texture import (
    textured_by_patches,
    with_patch_texture,
)

SIDE = 48
HOLE = torch.zeros(SIDE, SIDE, dtype=torch.bool)
HOLE[12:36, 12:36] = True


def _meadow(strength: float = 0.3) -> Tensor:
    """Noise on one even surface."""
    noise = torch.rand(SIDE, SIDE, 1, generator=torch.Generator().manual_seed(0)) - 0.5
    return (torch.tensor([0.3, 0.5, 0.2]) + strength * noise).clamp(0, 1)


def _rows(image: Tensor, strength: float = 0.15) -> Tensor:
    """The hole in rows of the same colour, as a network repeats a texture."""
    rows = strength * (torch.arange(SIDE) // 2 % 2 * 2 - 1).float()
    even = torch.tensor([0.3, 0.5, 0.2]) + rows[:, None, None] / 2
    return torch.where(HOLE[..., None], even.expand(SIDE, SIDE, 3), image)


def test_rows_in_a_meadow_become_meadow() -> None:
    meadow = _meadow()
    before, after = _rows(meadow), textured_by_patches(_rows(meadow), ~HOLE)
    rows = [image[14:34, 14:34, 0].mean(1).std() for image in (before, after)]
    assert float(rows[1]) < 0.7 * float(rows[0])
    across = [image[14:34, 14:34].diff(dim=1).abs().mean() for image in (before, after, meadow)]
    assert float(across[0]) == 0 and float(across[1]) > 0.4 * float(across[2])


def test_what_is_known_stays_and_colours_are_colours() -> None:
    image = _rows(_meadow(1.0), 0.6)
    found = textured_by_patches(image, ~HOLE)
    assert torch.equal(found[~HOLE], image[~HOLE])
    assert float(found.min()) >= 0 and float(found.max()) <= 1


def _smooth(image: Tensor) -> Tensor:
    """The hole without any detail."""
    return torch.where(HOLE[..., None], torch.tensor([0.3, 0.5, 0.2]), image)


def _detail(image: Tensor) -> float:
    return float(image[16:32, 16:32].diff(dim=1).abs().mean())


def test_a_smooth_guess_amid_one_texture_gets_it() -> None:
    meadow = _meadow(0.5)
    found = textured_by_patches(_smooth(meadow), ~HOLE)
    assert _detail(found) > 0.4 * _detail(meadow)  # 0 by the network's strength alone


def test_a_smooth_guess_stays_where_the_texture_is_not_the_same_all_around() -> None:
    """A pole on a wall of one colour: patches of it would put another one into the hole."""
    image = torch.tensor([0.3, 0.5, 0.2]).expand(SIDE, SIDE, 3).clone()
    image[:, 38:42] = _meadow(0.5)[:, 38:42]
    found = textured_by_patches(_smooth(image), ~HOLE)
    assert _detail(found) < 0.01


def test_around_one_texture_is_the_same_and_around_several_is_not() -> None:
    known = ~HOLE[..., None]
    one = torch.full((SIDE, SIDE, 1), 0.02)
    typical, sameness = patch_texture._around(one, known)
    torch.testing.assert_close(typical, one)
    assert float(sameness.min()) > 0.999
    stroke, halves = one.clone(), one.clone()
    stroke[:, 40:42], halves[:, : SIDE // 2] = 2.0, 1e-5
    assert float(patch_texture._around(stroke, known)[0][HOLE].max()) < 0.1  # its mean: 0.6
    assert float(patch_texture._around(halves, known)[1][24, 24]) < 0.4
    assert float(patch_texture._around(one, torch.zeros_like(known))[1].max()) == 0


def test_where_two_surfaces_meet_the_network_decides() -> None:
    image = _rows(_meadow())
    image[:, SIDE // 2 :] += torch.tensor([0.4, 0.1, 0.4])
    image = image.clamp(0, 1)
    change = (textured_by_patches(image, ~HOLE) - image).abs()[14:34]
    assert float(change[:, 23:25].max()) < 0.01  # 0.3 without evenness
    assert float(change[:, 14:19].mean()) > 0.02


def test_equal_images_get_equal_textures() -> None:
    image = _rows(_meadow())
    assert torch.equal(textured_by_patches(image, ~HOLE), textured_by_patches(image, ~HOLE))


@pytest.mark.parametrize("size", [(1, 2), (2, 2), (3, 7), (30, 4), (130, 20)])
def test_holes_of_any_size_are_filled(size: tuple[int, int]) -> None:
    image = torch.rand(*size, 3, generator=torch.Generator().manual_seed(0))
    for number in {1, size[0] * size[1] // 2, size[0] * size[1] - 1}:
        known = torch.arange(size[0] * size[1]).view(size) >= number
        found = textured_by_patches(image, known)
        assert bool(found.isfinite().all()) and torch.equal(found[known], image[known])


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_black_and_white_stay(value: float) -> None:
    image = torch.full((SIDE, SIDE, 3), value)
    torch.testing.assert_close(textured_by_patches(image, ~HOLE), image, atol=1e-6, rtol=0)


def test_where_everything_is_known_nothing_is_done() -> None:
    rgb, calls = _meadow(), []

    def inpaint(image: Tensor, known: Tensor) -> Tensor:
        calls.append(known)
        return image

    assert with_patch_texture(inpaint)(rgb, torch.ones_like(HOLE)) is rgb
    assert len(calls) == 1
