"""What touches goes together, by one way and at one depth; everything else stays where it is."""

import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from diff4splat.generation.layered_image.rigid_components import (
    MIN_RELATIVE_DISPLACEMENT,
    connected_components,
    rigid_component_offsets,
)
from diff4splat.models.motion_unet.motion_field import UNIT, upsample_to_pixels

SIDE = 16


def field(frames: int = 3) -> Tensor:
    """Every cell goes a little its own way, and all far to the right."""
    torch.manual_seed(0)
    ways = torch.randn(3, frames, SIDE // 4, SIDE // 4)
    ways[0] += 4
    return ways


def rightwards(way: float) -> Tensor:
    """By so much of the depth, at the middle one of three frames alone."""
    ways = torch.zeros(3, 3, SIDE // 4, SIDE // 4)
    ways[0, 1] = way / UNIT
    return ways


def depth() -> Tensor:
    torch.manual_seed(1)
    return 1 + 4 * torch.rand(SIDE, SIDE)


def two_things() -> Tensor:
    moving = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    moving[2:6, 3:9] = True
    moving[10:13, 1:4] = True
    return moving


def test_each_thing_goes_by_its_own_mean_at_its_own_median() -> None:
    found, ways = (
        rigid_component_offsets(field(), two_things(), depth()),
        upsample_to_pixels(field()),
    )
    assert found.shape == (3, SIDE, SIDE, 3)
    for rows, columns in ((slice(2, 6), slice(3, 9)), (slice(10, 13), slice(1, 4))):
        way = ways[:, :, rows, columns].flatten(2).mean(-1) * UNIT
        wanted = way * depth()[rows, columns].flatten().median()
        offsets = found[:, rows, columns].flatten(1, 2)
        torch.testing.assert_close(offsets, wanted[:, None].expand_as(offsets))
    assert not found[:, ~two_things()].any()


def test_what_hardly_goes_stands_and_takes_no_other_with_it() -> None:
    for way, goes in (
        (0.99 * MIN_RELATIVE_DISPLACEMENT, False),
        (1.01 * MIN_RELATIVE_DISPLACEMENT, True),
    ):
        assert bool(rigid_component_offsets(rightwards(way), two_things(), depth()).any()) is goes
    ways = rightwards(2 * MIN_RELATIVE_DISPLACEMENT)
    ways[:, :, :2] = 0
    found = rigid_component_offsets(ways, two_things(), depth())
    assert not found[:, :8].any() and bool(found[1, 10:13, 1:4, 0].all())


def test_ways_that_cancel_are_no_way() -> None:
    ways = rightwards(4 * MIN_RELATIVE_DISPLACEMENT)
    ways[:, :, :, 2:] *= -1
    moving = torch.ones(SIDE, SIDE, dtype=torch.bool)
    assert not rigid_component_offsets(ways, moving, depth()).any()


def test_things_that_touch_at_a_corner_are_one() -> None:
    moving = torch.zeros(4, 4, dtype=torch.bool)
    moving[0, 0] = moving[1, 1] = moving[3, 3] = True
    number = connected_components(moving)
    assert int(number.max()) == 2
    assert number[0, 0] == number[1, 1] != number[3, 3]
    assert torch.equal(number > 0, moving)


def test_where_nothing_moves_nothing_goes() -> None:
    still = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    assert not rigid_component_offsets(field(), still, depth()).any()


def test_arguments_stay_as_they_are() -> None:
    told, place, moving = field(), depth(), two_things()
    rigid_component_offsets(told, moving, place)
    assert torch.equal(told, field()) and torch.equal(place, depth())
    assert torch.equal(moving, two_things())


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**16 - 1), st.floats(1e-6, 1e6))
def test_any_mask_at_any_depth_is_finite_and_moves_no_other_pixel(bits: int, far: float) -> None:
    torch.manual_seed(bits)
    moving = torch.rand(SIDE, SIDE) < 0.3
    found = rigid_component_offsets(field(), moving, far * depth())
    assert bool(found.isfinite().all()) and not found[:, ~moving].any()
    assert bool(found[:, moving].any(-1).all())
