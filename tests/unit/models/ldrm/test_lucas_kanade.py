"""Optical flow, rates per slot, and the weights of slots at a time."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.models.ldrm.refinement.lucas_kanade import track_flow, warp
from diff4splat.models.ldrm.refinement.motion_features import (
    DIFFERENCE_UNIT,
    DISTANCES,
    MOTION_CHANNELS,
    RATE_UNIT,
    SLOT_CUES,
    SLOTS,
    input_motion,
    slot_weights,
    warped_flow,
)
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo

INSIDE = (..., slice(12, -12), slice(12, -12))


def texture(count: int = 1, side: int = 64) -> Tensor:
    """Smooth enough to have slopes."""
    coarse = torch.rand(count, 3, side // 8, side // 8, generator=torch.Generator().manual_seed(0))
    return torch.nn.functional.interpolate(coarse, scale_factor=8, mode="bicubic").clamp(0, 1)


def cameras(count: int, turn: float = 0.0) -> Camera:
    """All at one place; each is turned around z once more than the one before it."""
    poses = torch.eye(4).repeat(1, count, 1, 1)
    for index in range(count):
        sine, cosine = math.sin(turn * index), math.cos(turn * index)
        poses[0, index, :2, :2] = torch.tensor([[cosine, -sine], [sine, cosine]])
    one = pinhole(64.0, (64, 64))
    return Camera(
        focal_px=one.focal_px.expand(1, count, 2),
        center_px=one.center_px.expand(1, count, 2),
        world_from_camera=poses,
        size_px=(64, 64),
    )


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


def test_rates_are_depths_per_clip_and_ends_take_the_other_side() -> None:
    own, count = texture()[0], 9
    video = torch.stack([own.roll(index, -1) for index in range(count)], 1)[None]
    sight = PosedVideo(rgb=video, cameras=cameras(count))
    found = warped_flow(torch.full((1, 3, 64, 64), 5.0), sight)
    assert found.shape == (1, 3, SLOTS, 4, 64, 64)
    # One pixel per frame, eight of them per clip, at a focal length of 64.
    rate, difference = found[:, :, :, :3] * RATE_UNIT, found[:, :, :, 3] * DIFFERENCE_UNIT
    medians = rate[INSIDE].flatten(-2).median(-1).values
    want = torch.full((1, 3, SLOTS), 8 / 64)
    torch.testing.assert_close(medians[..., 0], want, atol=5e-3, rtol=0)
    assert float(medians[..., 1:].abs().max()) < 5e-3
    assert float(difference[INSIDE].median()) < 0.02
    half = len(DISTANCES)
    torch.testing.assert_close(found[:, 0, half:], found[:, 0, :half])
    torch.testing.assert_close(found[:, -1, half:], found[:, -1, :half])
    assert not torch.equal(found[:, 1, half:], found[:, 1, :half])


def test_rates_are_along_the_axes_of_the_first_camera() -> None:
    own, count, quarter = texture()[0], 5, math.pi / 2
    # Each camera is turned by a right angle, so the fifth looks like the first again.
    video = torch.stack([own.rot90(index, (-2, -1)) for index in range(count)], 1)[None]
    still = warped_flow(
        torch.full((1, 2, 64, 64), 5.0), PosedVideo(rgb=video, cameras=cameras(5, quarter))
    )
    assert float(still[:, :, :, :3][INSIDE].abs().median()) < 0.02
    shifted = torch.stack([own.roll(i, -1).rot90(i, (-2, -1)) for i in range(count)], 1)[None]
    sight = PosedVideo(rgb=shifted, cameras=cameras(5, quarter))
    rates = (
        warped_flow(torch.full((1, 2, 64, 64), 5.0), sight)[INSIDE].flatten(-2).median(-1).values
    )
    want = torch.tensor([4 / 64, 0.0, 0.0]) / RATE_UNIT
    torch.testing.assert_close(rates[0, :, 0, :3], want.expand(2, 3), atol=0.02, rtol=0)


def test_one_frame_moves_nowhere() -> None:
    sight = PosedVideo(rgb=texture()[:, :, None], cameras=cameras(1))
    found = warped_flow(torch.full((1, 1, 64, 64), 5.0), sight)
    assert not found.any()


def test_slots_speak_for_the_times_they_are_at_and_share_those_between() -> None:
    half = len(DISTANCES)
    for slot, distance in enumerate(DISTANCES):
        for sign, place in ((1, slot), (-1, half + slot)):
            want = torch.eye(SLOTS)[place]
            torch.testing.assert_close(slot_weights(torch.tensor(float(sign * distance))), want)
    shares = slot_weights(torch.linspace(-20, 20, 81))
    torch.testing.assert_close(shares.sum(-1), torch.ones(81))
    assert bool((shares >= 0).all())
    torch.testing.assert_close(slot_weights(torch.tensor(0.0)), torch.eye(SLOTS)[0])
    middle = slot_weights(torch.tensor(2.5))
    torch.testing.assert_close(middle[1:3], torch.full((2,), 0.5))


def test_the_network_sees_doubled_distances_of_both_directions_and_the_depth() -> None:
    motion = torch.arange(1.0 * MOTION_CHANNELS)[None, :, None, None]
    slots = [distance - 1 + side for side in (0, len(DISTANCES)) for distance in (1, 2, 4, 8)]
    want = [SLOT_CUES * slot + cue for slot in slots for cue in range(SLOT_CUES)]
    assert input_motion(motion).flatten().tolist() == [*want, MOTION_CHANNELS - 1]
