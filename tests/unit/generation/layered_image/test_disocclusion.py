"""Hidden layers behind what moves take the colours of static pixels around it."""

from dataclasses import fields, replace

import pytest
import torch
from image_layers import input_image, layer
from torch import Tensor

from diff4splat.generation.layered_image.border.extension import border_extension
from diff4splat.generation.layered_image.disocclusion import (
    GROWN_PX,
    fill_from_neighbours,
    grown,
    inpaint_background,
    inpaint_border,
    without_disoccluded,
)
from diff4splat.generation.layered_image.types import NO_PIXEL, ImageLayer
from diff4splat.models.blocks.conv_block import CELL_PX

SIDE, MARGIN = 24, 2
RED, GREEN, BLUE = torch.eye(3)


def box() -> Tensor:
    mask = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    mask[8:16, 8:16] = True
    return mask


def image() -> Tensor:
    """A blue box in front of green."""
    rgb = GREEN.expand(SIDE, SIDE, 3).clone()
    rgb[box()] = BLUE
    return rgb


def background(moving_with_pixel: Tensor | None = None) -> ImageLayer:
    """Red; of the far side, but for cells that move with their pixel."""
    pixels = torch.arange(SIDE * SIDE).view(SIDE, SIDE)
    far = torch.full_like(pixels, NO_PIXEL)
    index = far if moving_with_pixel is None else torch.where(moving_with_pixel, pixels, far)
    rgb = RED.expand(SIDE, SIDE, 3)
    return layer(torch.full((SIDE, SIDE), 5.0), rgb=rgb, pixel_index=index)


def border() -> ImageLayer:
    camera = input_image(image()).camera
    cells = border_extension(image(), torch.full((SIDE, SIDE), 4.0), camera, MARGIN)
    return replace(cells, rgb=RED.expand(*cells.depth.shape, 3))


def only_colours_differ(after: ImageLayer, before: ImageLayer) -> bool:
    rest = [field.name for field in fields(ImageLayer) if field.name != "rgb"]
    return all(getattr(after, name) is getattr(before, name) for name in rest)


def test_behind_a_moving_box_the_far_side_has_the_colours_around_it() -> None:
    before = background()
    after = inpaint_background(before, image(), box())
    area = grown(box())
    torch.testing.assert_close(after.rgb[area], GREEN.expand(int(area.sum()), 3))
    assert torch.equal(after.rgb[~area], before.rgb[~area])
    assert only_colours_differ(after, before)


def test_cells_that_move_with_their_pixel_keep_their_colour() -> None:
    after = inpaint_background(background(box()), image(), box())
    assert torch.equal(after.rgb[box()], RED.expand(64, 3))
    rim = grown(box()) & ~box()
    torch.testing.assert_close(after.rgb[rim], GREEN.expand(int(rim.sum()), 3))


def test_mixed_pixels_at_the_rim_give_no_colour() -> None:
    mixed = image()
    mixed[6:18, 6:18] = 0.5 * (GREEN + BLUE)
    mixed[box()] = BLUE
    after = inpaint_background(background(), mixed, box())
    area = grown(box())
    torch.testing.assert_close(after.rgb[area], GREEN.expand(int(area.sum()), 3))


def test_border_cells_whose_middle_is_behind_the_box_change() -> None:
    before = border()
    after = inpaint_border(before, image(), box())
    area = torch.zeros(before.depth.shape, dtype=torch.bool)
    middle = slice(CELL_PX // 2, None, CELL_PX)
    area[MARGIN:-MARGIN, MARGIN:-MARGIN] = grown(box())[middle, middle]
    assert int(area.sum()) == 9
    torch.testing.assert_close(after.rgb[area], GREEN.expand(9, 3))
    assert torch.equal(after.rgb[~area], before.rgb[~area])
    assert only_colours_differ(after, before)


@pytest.mark.parametrize("moving", [torch.zeros, torch.ones])
def test_where_nothing_or_everything_moves_nothing_changes(moving: object) -> None:
    mask = moving(SIDE, SIDE, dtype=torch.bool)
    for before, inpaint in ((background(), inpaint_background), (border(), inpaint_border)):
        assert inpaint(before, image(), mask) is before


def test_a_mask_grows_by_a_few_pixels_on_every_side() -> None:
    one = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    one[10, 4] = one[0, 0] = True
    wanted = torch.zeros_like(one)
    wanted[10 - GROWN_PX : 11 + GROWN_PX, 4 - GROWN_PX : 5 + GROWN_PX] = True
    wanted[: 1 + GROWN_PX, : 1 + GROWN_PX] = True
    assert torch.equal(grown(one), wanted)
    assert not grown(torch.zeros_like(one)).any()


def oracle(rgb: Tensor, known: Tensor) -> Tensor:
    """The mean of known pixels in the smallest window of 3, 7, 15, … that has any."""
    filled = rgb.clone()
    for row, column in (~known).nonzero().tolist():
        reach = 1
        while True:
            window = (
                slice(max(row - reach, 0), row + reach + 1),
                slice(max(column - reach, 0), column + reach + 1),
            )
            if bool(known[window].any()):
                filled[row, column] = rgb[window][known[window]].mean(0)
                break
            reach = 2 * reach + 1
    return filled


@pytest.mark.parametrize("share", [0.01, 0.1, 0.7, 1.0])
@pytest.mark.parametrize("size", [(13, 17), (1, 20), (20, 1)])
def test_unknown_colours_come_from_the_smallest_window(share: float, size: tuple[int, int]) -> None:
    rgb, known = torch.rand(*size, 3, dtype=torch.float64), torch.rand(size) < share
    known[0, 0] = True
    torch.testing.assert_close(fill_from_neighbours(rgb, known), oracle(rgb, known))


def test_static_cells_behind_what_moves_are_left_out() -> None:
    static = without_disoccluded(background(), box())
    assert torch.equal(static.mask, background().mask & ~box())
    cells = border()
    inner = slice(MARGIN, -MARGIN)
    kept = without_disoccluded(cells, box()).mask
    half = slice(CELL_PX // 2, None, CELL_PX)
    assert torch.equal(kept[inner, inner], cells.mask[inner, inner] & ~box()[half, half])
    outside = torch.ones_like(kept)
    outside[inner, inner] = False
    assert torch.equal(kept[outside], cells.mask[outside])


def test_cells_that_move_with_their_pixel_are_kept() -> None:
    displacement = torch.zeros(2, SIDE, SIDE, 3)
    displacement[1, box()] = 1.0
    moving = replace(background(), displacement=displacement)
    assert torch.equal(without_disoccluded(moving, box()).mask, moving.mask)
