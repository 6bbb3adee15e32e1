"""Samples of which the first moment alone is shown, or judged."""

from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_clips import make_clip

from diff4splat.data.clip import Clip
from diff4splat.training.batches.clip_batch import ClipBatch, collate
from diff4splat.training.batches.normalise_scale import normalized
from diff4splat.training.batches.sample import Origin, make_sample
from diff4splat.training.batches.targets import draw_targets
from diff4splat.training.recipe.data import DataSettings
from diff4splat.training.stage import SampleKey

MOVING = DataSettings(size_px=(24, 32), frames=5, views=2, target_frames=4, tracks=8)
STANDING = replace(MOVING, supervise_motion=False)


def sample(clip: Clip, data: DataSettings = STANDING, index: int = 0) -> ClipBatch:
    origin = Origin(key=SampleKey(0, "first", index, "sample"), source="made")
    return make_sample(clip, data, origin)


@pytest.fixture(scope="module")
def moving() -> Clip:
    return make_clip(static=False, tracks=20)


@pytest.fixture(scope="module")
def still() -> Clip:
    return make_clip(static=True, tracks=20)


def test_moving_clips_are_judged_at_their_first_frame_from_all_views(moving: Clip) -> None:
    clip, one = normalized(moving), sample(moving)
    assert one.target_time.tolist() == [[0, 0]]
    for time in range(2):
        for place, view in enumerate((1, 0)):
            shown = clip.views[view]
            assert torch.equal(one.target_rgb[0, time, place], shown.rgb[0])
            torch.testing.assert_close(one.target_depth[0, time, place], shown.depth[0])
            pose = one.target_cameras.world_from_camera[0, time, place]
            torch.testing.assert_close(pose, shown.cameras.world_from_camera[0].float())


def test_the_input_is_still_the_whole_video(moving: Clip) -> None:
    one, other = sample(moving), sample(moving, MOVING)
    assert torch.equal(one.video, other.video) and torch.equal(one.depth, other.depth)


def test_points_are_followed_to_the_first_frame(moving: Clip) -> None:
    one = sample(moving)
    assert bool(one.track_valid.any())
    at_first = one.track_valid & (one.track_cell[..., 0] == 0)
    assert not one.track_offset[:, :, at_first[0]].any()
    assert torch.equal(one.track_offset[:, 0], one.track_offset[:, 1])


def test_still_clips_are_judged_at_all_frames_as_before(still: Clip) -> None:
    frames = normalized(still).views[0].rgb
    seen = set()
    for index in range(4):
        one, other = sample(still, index=index), sample(still, MOVING, index)
        assert torch.equal(one.target_rgb, other.target_rgb)
        assert torch.equal(one.target_time, other.target_time)
        for image in one.target_rgb[0, :, 1]:
            seen |= {k for k, frame in enumerate(frames) if torch.equal(image, frame)}
    assert len(seen) > 2


def test_moving_and_still_clips_make_one_batch(moving: Clip, still: Clip) -> None:
    both = collate([sample(moving), sample(still)])
    assert both.target_rgb.shape == (2, 2, 2, 24, 32, 3)
    assert both.target_time.shape == (2, 2) and both.is_static.tolist() == [False, True]


def test_moving_targets_are_the_default(moving: Clip) -> None:
    assert DataSettings().supervise_motion
    assert float(torch.cat([sample(moving, MOVING, i).target_time for i in range(3)]).max()) > 0


@settings(max_examples=40, deadline=None)
@given(
    frames=st.integers(1, 9),
    views=st.integers(1, 3),
    asked=st.integers(1, 6),
    seed=st.integers(0, 99),
)
def test_targets_are_different_times_where_there_are_several(
    frames: int, views: int, asked: int, seed: int
) -> None:
    settings_ = replace(MOVING, target_frames=asked, views=views)
    generator = torch.Generator().manual_seed(seed)
    targets = draw_targets(frames, views, settings_, generator)
    per_time = 2 if views > 1 and asked > 1 else 1
    count = max(asked // per_time, 1)
    times = targets.frames.tolist()
    assert targets.views.shape == (len(times), per_time)
    assert len(set(times)) == len(times) == min(count, frames)
    assert times == sorted(times) and times[-1] < frames


def test_the_first_image_is_all_that_is_left_of_the_input(moving: Clip, still: Clip) -> None:
    both = collate([sample(moving), sample(still)])
    alone = both.first_image()
    assert torch.equal(alone.video, both.video[:, :1])
    assert torch.equal(alone.depth, both.depth[:, :1])
    assert alone.cameras.batch_shape == (2, 1) and alone.cameras.size_px == both.cameras.size_px
    for name in ("focal_px", "center_px", "world_from_camera"):
        own, whole = getattr(alone.cameras, name), getattr(both.cameras, name)
        assert torch.equal(own, whole[:, :1])


def test_targets_stay_when_the_first_image_is_left(moving: Clip) -> None:
    both = sample(moving, MOVING)
    alone = both.first_image()
    for name in ("target_rgb", "target_depth", "target_time", "track_offset", "sample_index"):
        assert torch.equal(getattr(alone, name), getattr(both, name)), name
    poses = (one.target_cameras.world_from_camera for one in (alone, both))
    assert torch.equal(*poses) and alone.captions == both.captions and len(alone) == 1
    assert both.video.shape[1] == 5
    assert torch.equal(alone.first_image().video, alone.video)
