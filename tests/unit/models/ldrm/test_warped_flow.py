"""Rates and differences per slot, and the weights of slots at a time."""

import math

import torch
from flow_images import INSIDE, cameras, texture
from torch import Tensor

from diff4splat.models.ldrm.optical_flow.optical_flow import optical_flow
from diff4splat.models.ldrm.refinement.motion_features import (
    MOTION_CHANNELS,
    input_motion,
    slot_weights,
)
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.models.ldrm.refinement.warped_flow import (
    DIFFERENCE_UNIT,
    DISTANCES,
    RATE_UNIT,
    SLOT_CUES,
    SLOTS,
    warped_flow,
)


def test_rates_are_depths_per_clip_and_ends_take_the_other_side() -> None:
    own, count = texture()[0], 9
    video = torch.stack([own.roll(index, -1) for index in range(count)], 1)[None]
    posed = PosedVideo(rgb=video, cameras=cameras(count))
    found = warped_flow(torch.full((1, 3, 64, 64), 5.0), posed)
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
    posed = PosedVideo(rgb=shifted, cameras=cameras(5, quarter))
    rates = (
        warped_flow(torch.full((1, 2, 64, 64), 5.0), posed)[INSIDE].flatten(-2).median(-1).values
    )
    want = torch.tensor([4 / 64, 0.0, 0.0]) / RATE_UNIT
    torch.testing.assert_close(rates[0, :, 0, :3], want.expand(2, 3), atol=0.02, rtol=0)


def test_one_frame_moves_nowhere() -> None:
    posed = PosedVideo(rgb=texture()[:, :, None], cameras=cameras(1))
    found = warped_flow(torch.full((1, 1, 64, 64), 5.0), posed)
    assert not found.any()


def test_frames_beyond_the_video_are_not_computed_and_repeat_the_last_one() -> None:
    pairs = []

    def counted(source: Tensor, target: Tensor, start: Tensor) -> Tensor:
        pairs.append(len(source))
        return optical_flow(source, target, start)

    own = texture()[0]
    video = torch.stack([own.roll(index**2 % 5, -1) for index in range(9)], 1)[None]
    posed = PosedVideo(rgb=video, cameras=cameras(9))
    found = warped_flow(torch.full((1, 3, 64, 64), 5.0), posed, counted)
    # The middle key frame has four frames to either side; the others have eight to one.
    assert pairs == [4] * 4 + [2] * 4
    middle = found[0, 1].unflatten(0, (2, len(DISTANCES)))
    torch.testing.assert_close(middle[:, 4:], middle[:, 3:4].expand(2, 4, 4, 64, 64))
    assert not torch.equal(middle[:, 2], middle[:, 3])


def test_every_video_of_a_batch_is_tracked_as_if_alone() -> None:
    own = texture(2)
    video = torch.stack([own.roll((index, -2 * index), (-1, -2)) for index in range(5)], 2)
    both = PosedVideo(rgb=video, cameras=cameras(5, 0.02, batch=2))
    depth = torch.stack([torch.full((2, 64, 64), depth) for depth in (4.0, 6.0)])
    found = warped_flow(depth, both)
    for index in range(2):
        alone = warped_flow(depth[index : index + 1], both.sample(index))
        torch.testing.assert_close(found[index : index + 1], alone, atol=1e-4, rtol=1e-4)


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
