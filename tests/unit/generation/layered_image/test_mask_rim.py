"""The rim moves with the object, on its surface, and nothing else does."""

import pytest
import torch
from image_layers import GREEN, RED, RIM_SIZE_PX, square_mask
from torch import Tensor

from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.mask_rim import (
    RIM_PX,
    nearest_inside,
    on_surface,
    with_rim,
)

MASK, OBJECT = square_mask(8, 16), square_mask(7, 17)
"""The mask misses the object's outermost pixels."""


def _image() -> Tensor:
    return torch.where(OBJECT[..., None], RED, GREEN)


def _depth() -> Tensor:
    depth = torch.full(RIM_SIZE_PX, 20.0)
    depth[MASK] = 3.0
    return depth


def test_pixels_of_the_objects_colour_join_it_at_its_depth() -> None:
    mask, depth = with_rim(MASK, _depth(), _image())
    assert torch.equal(mask, OBJECT)
    assert bool((depth[OBJECT] == 3.0).all()) and bool((depth[~OBJECT] == 20.0).all())


def test_a_mask_that_is_right_stays() -> None:
    mask, _ = with_rim(OBJECT, _depth(), _image())
    assert torch.equal(mask, OBJECT)


def test_mixed_pixels_join_if_they_are_more_of_the_object() -> None:
    image, edge = _image(), OBJECT & ~MASK
    for share, joins in ((0.6, True), (0.2, False)):
        image[edge] = share * RED + (1 - share) * GREEN
        mask, _ = with_rim(MASK, _depth(), image)
        assert torch.equal(mask, OBJECT if joins else MASK)


def test_nothing_joins_where_object_and_background_are_alike() -> None:
    image = torch.full((*RIM_SIZE_PX, 3), 0.5)
    image[OBJECT] = 0.52
    mask, depth = with_rim(MASK, _depth(), image)
    assert torch.equal(mask, MASK) and torch.equal(depth, _depth())


def test_the_rim_is_no_wider_than_it_may_be() -> None:
    image = torch.where(square_mask(2, 22)[..., None], RED, GREEN)
    mask, _ = with_rim(MASK, _depth(), image)
    assert not bool((mask & ~grown(MASK, RIM_PX)).any())


@pytest.mark.parametrize("value", [False, True])
def test_an_empty_or_a_full_mask_stays(value: bool) -> None:
    mask = torch.full(RIM_SIZE_PX, value)
    grown, depth = with_rim(mask, _depth(), _image())
    assert torch.equal(grown, mask) and torch.equal(depth, _depth())


@pytest.mark.parametrize("size", [(1, 2), (2, 2), (3, 9)])
def test_small_images(size: tuple[int, int]) -> None:
    mask = torch.zeros(size, dtype=torch.bool)
    mask[0, 0] = True
    grown, depth = with_rim(mask, torch.ones(size), torch.rand(*size, 3))
    assert bool(grown[0, 0]) and bool((depth == 1).all())


def test_background_depth_inside_the_objects_edge_is_pulled_forward() -> None:
    depth = torch.where(square_mask(8, 15), 3.0, 20.0)
    found = on_surface(MASK, depth, MASK)
    assert bool((found[MASK] == 3.0).all()), "row 15 had that of the background"
    assert torch.equal(found[~MASK], depth[~MASK])


def test_a_surface_that_recedes_stays_without_steps() -> None:
    mask, slope = square_mask(4, 20), 0.02
    depth = (3.0 + slope * torch.arange(RIM_SIZE_PX[1])).expand(RIM_SIZE_PX).clone()
    found = on_surface(mask, depth, mask)[4:20, 4:20]
    assert float(found.diff(dim=1).abs().max()) < 1.5 * slope
    assert float((found - depth[4:20, 4:20]).abs().max()) < 2 * slope


def test_a_thin_object_does_not_take_the_depth_of_another() -> None:
    mask, depth = square_mask(2, 20), torch.full(RIM_SIZE_PX, 20.0)
    depth[mask] = 3.0
    mask[:, 25] = True
    depth[:, 25] = 7.0
    assert bool((on_surface(mask, depth, mask)[:, 25] == 7.0).all())


def test_what_is_thinner_than_its_edges_keeps_its_depth() -> None:
    line = torch.zeros(RIM_SIZE_PX, dtype=torch.bool)
    line[10] = True
    depth = torch.rand(RIM_SIZE_PX) + 1
    assert torch.equal(on_surface(line, depth, line), depth)


def test_the_nearest_pixel_is_the_nearest() -> None:
    mask = torch.rand(20, 17, generator=torch.Generator().manual_seed(0)) > 0.9
    nearest = nearest_inside(mask)
    points, every = mask.nonzero().double(), torch.ones_like(mask).nonzero().double()
    truth = torch.cdist(every, points).amin(1)
    chosen = torch.stack([nearest.flatten() // 17, nearest.flatten() % 17], 1).double()
    # OpenCV's distance is exact to a few per cent.
    assert bool(((every - chosen).norm(dim=1) <= 1.05 * truth + 1e-9).all())
    assert bool(mask.flatten()[nearest.flatten()].all())


def test_the_surface_at_the_edge_has_no_steps() -> None:
    mask, depth = square_mask(4, 20), torch.full(RIM_SIZE_PX, 3.0)
    depth[:, ::2] = 3.4
    edge = on_surface(mask, torch.where(mask, depth, 20.0), mask)[4, 6:18]
    assert float(edge.diff().abs().max()) < 0.2
