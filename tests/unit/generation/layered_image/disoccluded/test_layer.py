"""Behind what moves: the surface around it goes on, with its texture."""

import pytest
import torch
from image_layers import box_mask, layer
from torch import Tensor

from diff4splat.generation.layered_image.background_layer import BEHIND
from diff4splat.generation.layered_image.disoccluded.layer import disoccluded_layer
from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.types import NO_PIXEL, ImageLayer

SIDE = 48
NEAR, FAR = 2.0, 6.0


def _checkers() -> Tensor:
    rows, columns = torch.meshgrid(torch.arange(SIDE), torch.arange(SIDE), indexing="ij")
    dark = ((rows // 3 + columns // 3) % 2).float()
    return (0.2 + 0.6 * dark)[..., None].expand(SIDE, SIDE, 3).clone()


def _pixels(moving: Tensor | None = None) -> ImageLayer:
    """A red box before checkers."""
    moving = box_mask() if moving is None else moving
    rgb = torch.where(moving[..., None], torch.tensor([0.9, 0.1, 0.1]), _checkers())
    displacement = torch.zeros(3, SIDE, SIDE, 3)
    displacement[1:, moving] = torch.tensor([0.5, 0.0, 0.0])
    index = torch.arange(SIDE * SIDE).view(SIDE, SIDE)
    depth = torch.where(moving, NEAR, FAR)
    return layer(depth, rgb=rgb, displacement=displacement, pixel_index=index)


def test_the_layer_is_static_and_covers_what_moves() -> None:
    found = disoccluded_layer(_pixels())
    assert found.displacement is None and not found.in_image
    assert torch.equal(found.mask, grown(box_mask(), 1))
    assert bool((found.pixel_index == NO_PIXEL).all())


def test_it_lies_on_the_surface_around_the_object() -> None:
    depth = disoccluded_layer(_pixels()).depth
    torch.testing.assert_close(depth[box_mask()], torch.full_like(depth[box_mask()], FAR))


def test_it_is_never_before_the_image() -> None:
    pixels = _pixels()
    pixels.depth[box_mask()] = 3 * FAR
    found = disoccluded_layer(pixels)
    assert bool((found.depth >= BEHIND * pixels.depth).all())


def test_texture_goes_on_in_place_of_a_blur() -> None:
    rgb = disoccluded_layer(_pixels()).rgb[box_mask()]
    around = _checkers()[box_mask()]
    assert float(rgb.std(0).mean()) > 0.5 * float(around.std(0).mean())
    # Nothing of the object is copied, and nothing is left empty.
    assert float((rgb[:, 0] - rgb[:, 1]).abs().max()) < 0.02
    assert float(rgb.min()) > 0.05


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_there_is_none_where_nothing_or_everything_moves(share: float) -> None:
    assert disoccluded_layer(_pixels(torch.full((SIDE, SIDE), bool(share)))) is None


def test_static_images_have_none() -> None:
    assert disoccluded_layer(layer(torch.ones(8, 8))) is None
