"""Depth of what moves: bounded by the size of the object, the rest as it was."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from image_layers import random_depth
from torch import Tensor

from diff4splat.generation.layered_image.pixel_maps.image_maps import FineMaps, ImageMaps
from diff4splat.generation.layered_image.rigid_components import connected_components
from diff4splat.generation.motion.object_relief import (
    RELIEF_SHARE,
    as_far_in_image,
    bounded_relief,
    with_bounded_relief,
)
from diff4splat.geometry.camera import pinhole, project
from diff4splat.geometry.depth import unproject

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


@pytest.mark.parametrize("offset", [(1.0, 0.0, 0.0), (0.0, -0.5, 0.0), (0.3, 0.2, 1.5)])
def test_neighbours_stay_neighbours_in_the_image(offset: tuple[float, float, float]) -> None:
    """What is displaced is an enlarged and shifted image of itself, whatever its relief."""
    moving = box(slice(4, 12), slice(4, 10))
    camera = pinhole(FOCAL_PX, (SIDE, SIDE))
    depth = random_depth(SIDE, SIDE, (3.0, 6.0))
    points = unproject(camera, depth)
    displacement = torch.tensor(offset).expand(1, SIDE, SIDE, 3) * moving[None, ..., None]
    found = as_far_in_image(displacement, depth, moving)
    before, after = (project(camera, each[moving])[0] for each in (points, points + found[0]))
    scale = 1 / (1 + offset[2] / float(depth[moving].median()))
    center = camera.center_px
    moved = after - (center + scale * (before - center))
    torch.testing.assert_close(moved, moved[:1].expand_as(moved), atol=1e-4, rtol=0)
    assert torch.equal(found[:, ~moving], displacement[:, ~moving])
    plain = project(camera, (points + displacement[0])[moving])[0]
    assert float((plain - (center + scale * (before - center))).std(0).max()) > 0.1


def test_every_component_moves_as_its_median_does() -> None:
    left, right = box(slice(2, 6), slice(1, 4)), box(slice(9, 14), slice(10, 15))
    depth = torch.where(left, 2.0, 8.0)
    displacement = torch.ones(2, SIDE, SIDE, 3)
    assert torch.equal(as_far_in_image(displacement, depth, left | right), displacement)


@pytest.mark.parametrize(("pixels", "changes"), [(3, False), (8, True), (16, True)])
def test_cells_of_which_most_moves_change_as_the_copy_does(pixels: int, changes: bool) -> None:
    moving, depth = box(slice(0, 4), slice(0, 4)), torch.full((SIDE, SIDE), 3.0)
    # All that moves in the second cell of four pixels is at the depth of the background.
    moving[4:8, 0:4] = torch.arange(16).view(4, 4) < pixels
    depth[4:8, 0:4] = 9.0
    maps = ImageMaps(depth=torch.full((4, 4), 5.0), displacement=None)
    found, bounded = with_bounded_relief(maps, depth, moving, FOCAL_PX)
    assert torch.equal(bounded, bounded_relief(depth, moving, FOCAL_PX))
    change = float((bounded / depth)[4, 0])
    assert change < 0.5
    assert float(found.depth[1, 0]) == pytest.approx(5.0 * change if changes else 5.0)
    assert bool((found.depth.flatten()[[0, 1, 2, 3, 5]] == 5.0).all())


def test_given_depth_is_not_changed() -> None:
    depth, moving = torch.rand(SIDE, SIDE) + 1, box(slice(2, 9), slice(2, 9))
    fine = FineMaps(rgb=torch.rand(SIDE, SIDE, 3), depth=depth, smooth=False)
    maps = ImageMaps(depth=depth[::2, ::2], displacement=None, fine=fine)
    found, same = with_bounded_relief(maps, depth, moving, FOCAL_PX)
    assert found is maps and same is depth


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
