"""Connected pixels are translated as one, at one depth; all others stay static."""

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
    """Cells differ a little, and all move far to the right."""
    torch.manual_seed(0)
    cells = torch.randn(3, frames, SIDE // 4, SIDE // 4)
    cells[0] += 4
    return cells


def rightwards(share: float) -> Tensor:
    """By a share of depth, in the middle one of three frames alone."""
    cells = torch.zeros(3, 3, SIDE // 4, SIDE // 4)
    cells[0, 1] = share / UNIT
    return cells


def depth() -> Tensor:
    torch.manual_seed(1)
    return 1 + 4 * torch.rand(SIDE, SIDE)


def two_components() -> Tensor:
    moving = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    moving[2:6, 3:9] = True
    moving[10:13, 1:4] = True
    return moving


def test_each_component_moves_by_its_mean_at_its_median_depth() -> None:
    result, relative = (
        rigid_component_offsets(field(), two_components(), depth()),
        upsample_to_pixels(field()),
    )
    assert result.shape == (3, SIDE, SIDE, 3)
    for rows, columns in ((slice(2, 6), slice(3, 9)), (slice(10, 13), slice(1, 4))):
        mean = relative[:, :, rows, columns].flatten(2).mean(-1) * UNIT
        wanted = mean * depth()[rows, columns].flatten().median()
        offsets = result[:, rows, columns].flatten(1, 2)
        torch.testing.assert_close(offsets, wanted[:, None].expand_as(offsets))
    assert not result[:, ~two_components()].any()


def test_a_component_that_hardly_moves_is_static_and_affects_no_other() -> None:
    for share, moves in (
        (0.99 * MIN_RELATIVE_DISPLACEMENT, False),
        (1.01 * MIN_RELATIVE_DISPLACEMENT, True),
    ):
        assert (
            bool(rigid_component_offsets(rightwards(share), two_components(), depth()).any())
            is moves
        )
    relative = rightwards(2 * MIN_RELATIVE_DISPLACEMENT)
    relative[:, :, :2] = 0
    result = rigid_component_offsets(relative, two_components(), depth())
    assert not result[:, :8].any() and bool(result[1, 10:13, 1:4, 0].all())


def test_displacements_that_cancel_are_static() -> None:
    relative = rightwards(4 * MIN_RELATIVE_DISPLACEMENT)
    relative[:, :, :, 2:] *= -1
    moving = torch.ones(SIDE, SIDE, dtype=torch.bool)
    assert not rigid_component_offsets(relative, moving, depth()).any()


def test_corners_connect() -> None:
    moving = torch.zeros(4, 4, dtype=torch.bool)
    moving[0, 0] = moving[1, 1] = moving[3, 3] = True
    number = connected_components(moving)
    assert int(number.max()) == 2
    assert number[0, 0] == number[1, 1] != number[3, 3]
    assert torch.equal(number > 0, moving)


def test_an_empty_mask_moves_nothing() -> None:
    empty = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    assert not rigid_component_offsets(field(), empty, depth()).any()


def test_arguments_are_not_changed() -> None:
    given_field, given_depth, moving = field(), depth(), two_components()
    rigid_component_offsets(given_field, moving, given_depth)
    assert torch.equal(given_field, field()) and torch.equal(given_depth, depth())
    assert torch.equal(moving, two_components())


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**16 - 1), st.floats(1e-6, 1e6))
def test_any_mask_at_any_depth_is_finite_and_moves_no_other_pixel(bits: int, unit: float) -> None:
    torch.manual_seed(bits)
    moving = torch.rand(SIDE, SIDE) < 0.3
    result = rigid_component_offsets(field(), moving, unit * depth())
    assert bool(result.isfinite().all()) and not result[:, ~moving].any()
    assert bool(result[:, moving].any(-1).all())


def test_the_mean_over_samples_decides_what_moves_and_the_sample_how_far() -> None:
    little, much = (rightwards(share * MIN_RELATIVE_DISPLACEMENT) for share in (0.5, 2.0))
    moving = two_components()
    alone = rigid_component_offsets(little, moving, depth())
    assert not alone.any(), "a sample alone may be too short to count as motion"
    offsets = rigid_component_offsets(little, moving, depth(), much)
    assert bool((offsets[1][moving][:, 0] > 0).all())
    assert not offsets[:, ~moving].any()
    torch.testing.assert_close(
        offsets, rigid_component_offsets(much, moving, depth()) / 4, rtol=1e-4, atol=1e-6
    )
    assert not rigid_component_offsets(much, moving, depth(), little).any()
