"""Depth of what moves: bounded by the size of the object, the rest as it was."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from diff4splat.generation.layered_image.pixel_maps.image_maps import ImageMaps
from diff4splat.generation.layered_image.rigid_components import connected_components
from diff4splat.generation.motion.object_relief import RELIEF_SHARE, bounded_relief, with_relief

SIDE, FOCAL_PX = 16, 16.0


def box(rows: slice, columns: slice) -> Tensor:
    mask = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    mask[rows, columns] = True
    return mask


def test_background_in_an_objects_edge_comes_to_the_object() -> None:
    moving, depth = box(slice(4, 12), slice(4, 10)), torch.full((SIDE, SIDE), 9.0)
    depth[4:12, 4:9] = 3.0
    found = bounded_relief(depth, moving, FOCAL_PX)
    assert torch.equal(found[~moving], depth[~moving])
    torch.testing.assert_close(found[4:12, 4:9], depth[4:12, 4:9])
    farthest = 3.0 * math.exp(RELIEF_SHARE * 8 / FOCAL_PX)
    torch.testing.assert_close(found[4:12, 9], torch.full((8,), farthest))


def test_the_visible_half_of_a_ball_keeps_its_depth() -> None:
    at = (torch.arange(SIDE) + 0.5 - SIDE / 2) / FOCAL_PX
    distance, radius = 10.0, 2.0
    square = distance**2 * (at.square()[:, None] + at.square())
    moving = square < 0.8 * radius**2
    depth = distance - (radius**2 - square).clamp_min(0).sqrt()
    found = bounded_relief(depth, moving, FOCAL_PX)
    assert float((found / depth).log().abs()[moving].max()) < 0.03


def test_every_component_has_its_own_median() -> None:
    left, right = box(slice(2, 6), slice(1, 4)), box(slice(9, 14), slice(10, 15))
    depth = torch.where(left, 2.0, 8.0)
    assert torch.equal(bounded_relief(depth, left | right, FOCAL_PX), depth)


@pytest.mark.parametrize(("pixels", "changes"), [(1, False), (2, True), (4, True)])
def test_a_cell_takes_the_mean_change_of_what_moves_in_it(pixels: int, changes: bool) -> None:
    moving, change = torch.zeros(4, 4, dtype=torch.bool), torch.zeros(4, 4)
    for pixel in range(pixels):
        moving[pixel // 2, pixel % 2] = True
    change[moving] = math.log(2.0)
    maps = ImageMaps(depth=torch.full((2, 2), 3.0), displacement=None)
    found = with_relief(maps, change, moving).depth
    assert found.flatten().tolist() == pytest.approx([6.0 if changes else 3.0, 3.0, 3.0, 3.0])


def test_nothing_changes_where_nothing_moves() -> None:
    depth, nothing = torch.rand(SIDE, SIDE) + 1, torch.zeros(SIDE, SIDE, dtype=torch.bool)
    assert torch.equal(bounded_relief(depth, nothing, FOCAL_PX), depth)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 1000), spread=st.floats(0, 20), focal_px=st.floats(1e-3, 1e6))
def test_relief_is_bounded_and_finite(seed: int, spread: float, focal_px: float) -> None:
    generator = torch.Generator().manual_seed(seed)
    depth = (spread * torch.randn(SIDE, SIDE, generator=generator)).exp()
    moving = torch.rand(SIDE, SIDE, generator=generator) < 0.7
    found = bounded_relief(depth, moving, focal_px)
    assert bool(found.isfinite().all()) and bool((found > 0).all())
    component = connected_components(moving)
    for number in range(1, int(component.max()) + 1):
        lowest, highest = found[component == number].double().log().aminmax()
        assert float(highest - lowest) <= 2 * RELIEF_SHARE * SIDE / focal_px + 1e-4
