"""Behind what moves: the surface around it goes on, with its texture."""

from dataclasses import replace

import pytest
import torch
from image_layers import box_mask, layer
from torch import Tensor

from diff4splat.generation.layered_image.background_layer import BEHIND
from diff4splat.generation.layered_image.disoccluded.layer import disoccluded_layer
from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.gaussians import layer_gaussians
from diff4splat.generation.layered_image.types import NO_PIXEL, ImageLayer
from diff4splat.models.ldrm.plane_prior import OPAQUE
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import concatenate

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


def test_no_cell_beside_a_farther_part_of_the_object_shines_through_it() -> None:
    pixels, inside = replace(_pixels(), opacity=OPAQUE), box_mask()
    middle = int(inside.any(0).nonzero().double().mean())
    pixels.depth[:] = 1.1 * NEAR
    pixels.depth[inside] = NEAR
    pixels.depth[:, middle:][inside[:, middle:]] = 1.5 * NEAR
    found = disoccluded_layer(pixels)
    scene = concatenate([layer_gaussians(pixels), layer_gaussians(found)])
    is_static = torch.cat([torch.zeros(SIDE * SIDE), torch.ones(int(found.mask.sum()))])
    settings = RenderSettings(features=is_static[:, None], dilation_px2=0.0)
    static = render(scene, pixels.camera, outputs=("features",), settings=settings).features[..., 0]
    # What a pixel of the object lets through; neighbours in front of it would add 13 %.
    assert float(static[inside & ~grown(~inside, 1)].max()) < 1 - OPAQUE + 0.01


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
