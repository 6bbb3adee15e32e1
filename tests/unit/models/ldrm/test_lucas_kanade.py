"""Optical flow from gradients."""

import pytest
import torch
from flow_images import INSIDE, texture
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.models.ldrm.optical_flow.lucas_kanade import track_flow, warp


@pytest.mark.parametrize(("right", "down"), [(0, 0), (1, 0), (2, -1), (-2, 3)])
def test_a_shift_is_found(right: int, down: int) -> None:
    own = texture()
    flow = track_flow(own, own.roll((down, right), (-2, -1)), torch.zeros(1, 2, 64, 64))
    error = (flow - torch.tensor([right, down])[:, None, None]).norm(dim=1)[INSIDE]
    assert float(error.median()) < 0.1
    assert float((error < 0.5).float().mean()) > 0.9


def test_far_shifts_are_found_from_a_start_nearby() -> None:
    own, far = texture(), torch.tensor([9.0, -7.0])[:, None, None]
    flow = track_flow(own, own.roll((-7, 9), (-2, -1)), (far + 1).expand(1, 2, 64, 64))
    assert float((flow - far).norm(dim=1)[INSIDE].median()) < 0.1


def test_where_nothing_can_be_told_the_start_remains() -> None:
    plain = torch.full((1, 3, 32, 32), 0.5)
    start = torch.full((1, 2, 32, 32), 1.5)
    torch.testing.assert_close(track_flow(plain, plain, start), start)


def test_moved_images_are_sampled_at_the_end_of_the_flow() -> None:
    own = texture(side=16)
    flow = torch.tensor([2.0, -1.0])[None, :, None, None].expand(1, 2, 16, 16)
    want = own.roll((1, -2), (-2, -1))
    torch.testing.assert_close(warp(own, flow)[..., 1:, :-2], want[..., 1:, :-2])


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 1000), size=st.floats(0, 1e4))
def test_flow_is_finite_whatever_the_images_and_the_start(seed: int, size: float) -> None:
    generator = torch.Generator().manual_seed(seed)
    own, other = torch.rand(2, 1, 3, 16, 16, generator=generator).round().unbind()
    start = torch.randn(1, 2, 16, 16, generator=generator) * size
    assert bool(track_flow(own, other, start).isfinite().all())
