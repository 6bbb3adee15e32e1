"""The object mask that the motion network is shown in training."""

from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from stage_fixtures import make_batch, stage_recipe
from torch import Tensor

from diff4splat.training.batches import mask_condition
from diff4splat.training.batches.mask_condition import (
    LARGEST_ERROR_PX,
    LEAST_PX,
    draw_component,
    inexact,
    motion_of_object,
    with_object_masks,
)

SIDE = 32


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def two_objects() -> Tensor:
    moving = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    moving[2:10, 4:12] = moving[18:30, 16:28] = True
    return moving


def field_of(moving: Tensor) -> Tensor:
    """The upper object moves to the right, the lower one down; each cell as the nearest."""
    field = torch.zeros(3, 2, SIDE // 4, SIDE // 4)
    field[0, 1, : SIDE // 8] = 3.0
    field[1, 1, SIDE // 8 :] = 2.0
    assert moving[: SIDE // 2].any() and moving[SIDE // 2 :].any()
    return field


def test_one_component_is_drawn_whatever_its_size() -> None:
    moving = two_objects()
    drawn = [draw_component(moving, generator(seed)) for seed in range(40)]
    sizes = [int(one.sum()) for one in drawn]
    assert set(sizes) == {64, 144} and 8 < sizes.count(64) < 32
    assert all(not bool((one & ~moving).any()) for one in drawn)


def test_fragments_are_not_drawn_alone() -> None:
    moving = two_objects()
    moving[0, 30] = True
    assert all(int(draw_component(moving, generator(seed)).sum()) > 1 for seed in range(20))
    small = torch.zeros_like(moving)
    small.flatten()[: LEAST_PX - 1] = True
    assert torch.equal(draw_component(small, generator()), small)
    assert not draw_component(moving & False, generator()).any()


def test_the_motion_of_an_object_reaches_all_cells() -> None:
    moving = two_objects()
    upper = moving.clone()
    upper[SIDE // 2 :] = False
    alone = motion_of_object(field_of(moving), upper)
    assert bool((alone[0, 1] == 3).all()) and not alone[1:].any()
    assert torch.equal(motion_of_object(alone, upper & False), alone)


def test_masks_are_off_by_a_few_pixels_or_lack_a_side(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mask_condition, "CUT_SHARE", 0.0)
    mask = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    mask[10:22, 8:20] = True
    sizes = {int(inexact(mask, generator(seed)).sum()) for seed in range(60)}
    assert sizes == {
        (12 + 2 * error) ** 2 for error in range(-LARGEST_ERROR_PX, LARGEST_ERROR_PX + 1)
    }
    monkeypatch.setattr(mask_condition, "CUT_SHARE", 1.0)
    monkeypatch.setattr(mask_condition, "LARGEST_ERROR_PX", 0)
    cut = [inexact(mask, generator(seed)) for seed in range(20)]
    assert all(0 < int(one.sum()) <= 144 and not bool((one & ~mask).any()) for one in cut)
    assert min(int(one.sum()) for one in cut) < 100


def test_an_eroded_mask_is_never_empty() -> None:
    dot = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    dot[5, 5] = True
    assert all(bool(inexact(dot, generator(seed)).any()) for seed in range(20))
    assert not inexact(dot & False, generator()).any()


def test_a_sample_whose_mask_is_shown_has_the_motion_of_that_object_alone() -> None:
    batch = make_batch(stage_recipe("video_diffusion"), tuple(range(64)))
    moving = two_objects().expand(64, -1, -1)
    field = field_of(moving[0]).expand(64, -1, -1, -1, -1)
    batch = replace(batch, moving=moving, field=field)
    made, masks = with_object_masks(batch, [generator(seed) for seed in range(64)])
    shown = masks.flatten(1).any(1)
    assert 0.6 < float(shown.float().mean()) < 1
    assert torch.equal(made.moving[~shown], moving[~shown])
    assert torch.equal(made.field[~shown], field[~shown])
    for own, motion in zip(made.moving[shown], made.field[shown], strict=True):
        upper = bool(own[:16].any())
        assert upper is not bool(own[16:].any())
        assert (
            bool((motion[0 if upper else 1, 1] > 0).all()) and not motion[1 if upper else 0].any()
        )


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**16), st.floats(0, 1))
def test_any_mask_stays_near_itself(seed: int, share: float) -> None:
    torch.manual_seed(seed)
    mask = torch.rand(SIDE, SIDE) < share
    found = inexact(mask, generator(seed))
    reach = 2 * LARGEST_ERROR_PX + 1
    near = torch.nn.functional.max_pool2d(mask.float()[None], reach, 1, LARGEST_ERROR_PX)[0] > 0
    assert not bool((found & ~near).any()) and bool(found.any()) is bool(mask.any())
