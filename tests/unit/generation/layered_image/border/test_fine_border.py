"""Beside the border lie fine static cells: the border's colours and depth, none of what moves."""

import math
from dataclasses import replace

import pytest
import torch
from image_layers import FAR_RANGES, input_image, is_finite, layer, random_depth
from torch import Tensor

from diff4splat.generation.layered_image.background_layer import BEHIND
from diff4splat.generation.layered_image.border.fine_border import (
    NEAR,
    PHOTOGRAPH,
    fine_border,
)
from diff4splat.generation.layered_image.disoccluded.layer import disoccluded_layer
from diff4splat.generation.layered_image.types import ImageLayer
from diff4splat.geometry.camera import Camera

SIZE_PX = (32, 48)
MARGIN = 6


def _pixels(depth: Tensor, **changes: object) -> ImageLayer:
    camera = input_image(torch.zeros(*depth.shape, 3), focal_px=float(max(depth.shape))).camera
    index = torch.arange(depth.numel()).view_as(depth)
    return layer(depth, camera=camera, pixel_index=index, **changes)


def _inner(size_px: tuple[int, int] = SIZE_PX) -> tuple[slice, slice]:
    return tuple(slice(MARGIN, MARGIN + side) for side in size_px)


def test_it_lies_around_the_image_and_not_on_it() -> None:
    found = fine_border(_pixels(torch.full(SIZE_PX, 4.0)), None)
    assert found.mask.shape == (32 + 2 * MARGIN, 48 + 2 * MARGIN)
    assert not bool(found.mask[_inner()].any())
    assert int(found.mask.sum()) == found.mask.numel() - 32 * 48
    assert found.displacement is None and not found.in_image
    torch.testing.assert_close(found.depth, torch.full_like(found.depth, BEHIND * 4.0))


def test_its_cells_lie_on_the_rays_of_the_pixels() -> None:
    pixels = _pixels(torch.full(SIZE_PX, 4.0))
    found: Camera = fine_border(pixels, None).camera
    torch.testing.assert_close(found.focal_px, pixels.camera.focal_px)
    torch.testing.assert_close(found.center_px, pixels.camera.center_px + MARGIN)


def test_beside_the_border_is_its_colour() -> None:
    rgb = torch.zeros(*SIZE_PX, 3)
    rgb[:, -1] = torch.tensor([0.2, 0.6, 0.9])
    found = fine_border(_pixels(torch.full(SIZE_PX, 4.0), rgb=rgb), None)
    beside = found.rgb[MARGIN + 16, MARGIN + 48]
    torch.testing.assert_close(beside, rgb[16, -1], atol=0.05, rtol=0)


def test_what_moves_at_the_border_is_not_continued() -> None:
    rgb, moving = torch.full((*SIZE_PX, 3), 0.5), torch.zeros(SIZE_PX, dtype=torch.bool)
    moving[10:20, :8] = True
    rgb[moving] = torch.tensor([1.0, 0.0, 0.0])
    displacement = torch.zeros(3, *SIZE_PX, 3)
    displacement[1:, moving] = torch.tensor([0.5, 0.0, 0.0])
    depth = torch.where(moving, 2.0, 4.0)
    pixels = _pixels(depth, rgb=rgb, displacement=displacement)
    found = fine_border(pixels, disoccluded_layer(pixels))
    outside = found.rgb[found.mask]
    torch.testing.assert_close(outside, torch.full_like(outside, 0.5))
    assert float(found.depth.min()) > 3.9


@pytest.mark.parametrize(
    ("size_px", "cells"),
    [((64, 64), (64, 64)), ((512, 384), (256, 192)), ((258, 2), (129, 1)), ((1, 1), (1, 1))],
)
def test_large_images_have_larger_cells(size_px: tuple[int, int], cells: tuple[int, int]) -> None:
    found = fine_border(_pixels(torch.ones(size_px)), None)
    margin = math.ceil(max(cells) / 8)
    assert max(cells) <= NEAR.max_side
    assert found.mask.shape == tuple(side + 2 * margin for side in cells)


def test_a_photograph_is_reflected_and_nothing_else_changes() -> None:
    pixels = _pixels(torch.full(SIZE_PX, 4.0))
    plain, reflected = (fine_border(pixels, None, ring) for ring in (NEAR, PHOTOGRAPH[0]))
    assert torch.equal(reflected.rgb[MARGIN + 5, :MARGIN], pixels.rgb[5, :MARGIN].flip(0))
    assert torch.equal(reflected.rgb[_inner()], plain.rgb[_inner()])
    assert torch.equal(reflected.depth, plain.depth) and torch.equal(reflected.mask, plain.mask)


@pytest.mark.parametrize("size_px", [(256, 256), (192, 320), (200, 248), (64, 64)])
def test_rings_of_a_photograph_meet(size_px: tuple[int, int]) -> None:
    """Every pixel out to half of the longer side has a cell, and no farther one nor one inside."""
    pixels, reach = _pixels(torch.ones(size_px)), max(size_px) // 2
    y, x = (torch.arange(-reach, side + reach) + 0.5 for side in size_px)
    covered = torch.zeros(len(y), len(x), dtype=torch.bool)
    for ring in PHOTOGRAPH:
        found = fine_border(pixels, None, ring)
        step = pixels.camera.focal_px / found.camera.focal_px
        column, row = (found.camera.center_px - pixels.camera.center_px / step).unbind()
        cells = ((y / step[1] + row).floor().long(), (x / step[0] + column).floor().long())
        inside = [(at >= 0) & (at < side) for at, side in zip(cells, found.mask.shape, strict=True)]
        rows, columns = (
            at.clamp(0, side - 1) for at, side in zip(cells, found.mask.shape, strict=True)
        )
        covered |= found.mask[rows][:, columns] & inside[0][:, None] & inside[1]
        far = (found.camera.size_px[0] * float(step[1]) - size_px[0]) / 2
    outside = torch.ones_like(covered)
    outside[reach:-reach, reach:-reach] = False
    assert torch.equal(covered, outside)
    assert reach <= far < reach + 8


@pytest.mark.parametrize("limits", FAR_RANGES)
def test_it_never_holds_nan(limits: tuple[float, float]) -> None:
    pixels = _pixels(random_depth(*SIZE_PX, limits))
    everything = replace(pixels, displacement=torch.ones(3, *SIZE_PX, 3))
    for each in (pixels, everything):
        for ring in (NEAR, *PHOTOGRAPH):
            assert is_finite(fine_border(each, disoccluded_layer(each), ring))
