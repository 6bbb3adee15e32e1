"""Behind what moves: the surface around it goes on, with its texture."""

import cv2
import pytest
import torch
from image_layers import layer
from torch import Tensor

from diff4splat.generation.layered_image.background_layer import BEHIND
from diff4splat.generation.layered_image.disoccluded_layer import (
    disoccluded_layer,
    extended_evenly,
    filled_with_patches,
    textured,
)
from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.types import NO_PIXEL, ImageLayer

SIDE = 48
NEAR, FAR = 2.0, 6.0


def _box() -> Tensor:
    mask = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    mask[18:30, 14:30] = True
    return mask


def _checkers() -> Tensor:
    rows, columns = torch.meshgrid(torch.arange(SIDE), torch.arange(SIDE), indexing="ij")
    dark = ((rows // 3 + columns // 3) % 2).float()
    return (0.2 + 0.6 * dark)[..., None].expand(SIDE, SIDE, 3).clone()


def _pixels(moving: Tensor | None = None) -> ImageLayer:
    """A red box before checkers."""
    moving = _box() if moving is None else moving
    rgb = torch.where(moving[..., None], torch.tensor([0.9, 0.1, 0.1]), _checkers())
    displacement = torch.zeros(3, SIDE, SIDE, 3)
    displacement[1:, moving] = torch.tensor([0.5, 0.0, 0.0])
    index = torch.arange(SIDE * SIDE).view(SIDE, SIDE)
    depth = torch.where(moving, NEAR, FAR)
    return layer(depth, rgb=rgb, displacement=displacement, pixel_index=index)


def test_the_layer_is_static_and_covers_what_moves() -> None:
    found = disoccluded_layer(_pixels())
    assert found.displacement is None and not found.in_image
    assert torch.equal(found.mask, grown(_box(), 1))
    assert bool((found.pixel_index == NO_PIXEL).all())


def test_it_lies_on_the_surface_around_the_object() -> None:
    depth = disoccluded_layer(_pixels()).depth
    torch.testing.assert_close(depth[_box()], torch.full_like(depth[_box()], FAR))


def test_it_is_never_before_the_image() -> None:
    pixels = _pixels()
    pixels.depth[_box()] = 3 * FAR
    found = disoccluded_layer(pixels)
    assert bool((found.depth >= BEHIND * pixels.depth).all())


def test_texture_goes_on_in_place_of_a_blur() -> None:
    rgb = disoccluded_layer(_pixels()).rgb[_box()]
    around = _checkers()[_box()]
    assert float(rgb.std(0).mean()) > 0.5 * float(around.std(0).mean())
    # Nothing of the object is copied, and nothing is left empty.
    assert float((rgb[:, 0] - rgb[:, 1]).abs().max()) < 0.02
    assert float(rgb.min()) > 0.05


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_there_is_none_where_nothing_or_everything_moves(share: float) -> None:
    assert disoccluded_layer(_pixels(torch.full((SIDE, SIDE), bool(share)))) is None


def test_static_images_have_none() -> None:
    assert disoccluded_layer(layer(torch.ones(8, 8))) is None


def test_a_plane_goes_on_through_a_hole() -> None:
    rows = torch.arange(SIDE, dtype=torch.float64)
    plane = (0.1 + 0.01 * rows)[:, None] + 0.002 * rows
    found = extended_evenly(torch.where(_box(), 9.0, plane), ~_box())
    assert torch.equal(found[~_box()], plane[~_box()])
    assert float((found - plane)[_box()].abs().max()) < 0.015


def test_extension_stays_within_the_known_values() -> None:
    generator = torch.Generator().manual_seed(0)
    for height, width in ((1, 1), (1, 9), (7, 1), (5, 13), (33, 20)):
        values = torch.rand(height, width, generator=generator)
        known = torch.rand(height, width, generator=generator) > 0.8
        known[0, 0] = True
        found = extended_evenly(torch.where(known, values, torch.nan), known)
        least, most = values[known].min(), values[known].max()
        assert bool(((found >= least - 1e-6) & (found <= most + 1e-6)).all())


@pytest.mark.parametrize("size", [(1, 2), (2, 2), (3, 7), (30, 4), (16, 16)])
def test_holes_of_any_size_are_filled(size: tuple[int, int]) -> None:
    rgb = torch.rand(*size, 3, generator=torch.Generator().manual_seed(0))
    for number in (1, rgb[..., 0].numel() // 2, rgb[..., 0].numel() - 1):
        known = torch.arange(rgb[..., 0].numel()).view(size) >= number
        found = filled_with_patches(rgb, known)
        assert torch.equal(found[known], rgb[known])
        assert bool(((found >= 0) & (found <= 1)).all())


def test_equal_images_give_equal_layers() -> None:
    rgb = torch.rand(96, 96, 3, generator=torch.Generator().manual_seed(0))
    known = torch.ones(96, 96, dtype=torch.bool)
    known[30:60, 30:60] = False
    found = []
    for seed in (1, 2):
        cv2.setRNGSeed(seed)
        found.append(filled_with_patches(rgb, known))
    assert torch.equal(*found)


def test_another_object_beside_the_hole_is_not_copied_into_it() -> None:
    image = torch.full((SIDE, SIDE, 3), 0.5)
    image[16:32, 36:46] = torch.tensor([0.1, 0.1, 0.9])
    filled, patched = (fill(image, ~_box())[_box()] for fill in (textured, filled_with_patches))
    assert float((patched - 0.5).abs().mean()) > 0.2, "which patches alone would do"
    assert float((filled - 0.5).abs().mean()) < 0.1
