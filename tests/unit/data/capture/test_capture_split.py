"""What held-out frames are new in is found from poses and times, not from names."""

from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from small_captures import poses_at, small_capture

from diff4splat.data.capture.split import SAME_POSE, report_split, same_view_groups
from diff4splat.errors import InputError


def test_a_camera_that_is_missed_is_a_new_view() -> None:
    capture = small_capture([0, 0, 1, 1, 2, 2], [0, 1] * 3, [True, True] + [False] * 4)
    report = report_split(capture)
    assert (report.training, report.new_views, report.new_times, report.held_out) == (4, 2, 0, 2)
    assert str(report) == "4 frames to learn from, 2 held out (new views)"


def test_a_time_that_is_missed_is_a_new_time_of_training_views() -> None:
    report = report_split(small_capture([0, 1] * 3, [0, 0, 1, 1, 2, 2], [0, 0, 1, 1, 0, 0]))
    assert (report.new_views, report.new_times) == (0, 2)
    assert report.kind == "new times of training views"


def test_both_kinds_are_counted() -> None:
    report = report_split(small_capture([0, 1, 0, 2], [0, 0, 1, 1], [0, 0, 1, 1]))
    assert (report.new_views, report.new_times) == (1, 1)
    assert report.kind == "new views and new times"


def test_nothing_may_be_held_out_but_something_must_be_learnt_from() -> None:
    assert str(report_split(small_capture([0, 1], [0, 0], [0, 0]))) == (
        "2 frames to learn from, nothing held out"
    )
    with pytest.raises(InputError, match="expected frames to learn from, got 2 held-out ones only"):
        report_split(small_capture([0, 1], [0, 0], [1, 1]))


def test_an_image_that_training_sees_is_no_test() -> None:
    capture = small_capture([0, 1, 0, 1, 0], [0, 0, 1, 1, 1], [0, 0, 0, 0, 1])
    with pytest.raises(InputError, match=r"got frame 4, whose view .* \(1 such frames\); hold out"):
        report_split(capture)


@pytest.mark.parametrize(("share", "same"), [(0.3, True), (30.0, False)])
def test_poses_and_times_that_differ_by_rounding_are_the_same(share: float, same: bool) -> None:
    capture = small_capture([0, 1, 0], [0, 5, 5 * share * 1e-6], [0, 0, 1])
    pose = capture.cameras.world_from_camera.clone()
    pose[2, 0, 3] += share * SAME_POSE * float((pose[0, :3, 3] - pose[1, :3, 3]).norm() / 2)
    capture = replace(capture, cameras=replace(capture.cameras, world_from_camera=pose))
    if same:
        with pytest.raises(InputError, match="got frame 2"):
            report_split(capture)
    else:
        assert report_split(capture).new_views == 1


def test_scale_and_place_of_the_world_do_not_matter() -> None:
    capture = small_capture([0, 1, 2, 0], [0, 0, 0, 1], [0, 0, 0, 1])
    for scale, offset in ((1e-6, 0.0), (1e6, 0.0), (1.0, 1e5)):
        pose = capture.cameras.world_from_camera.clone()
        pose[:, :3, 3] = pose[:, :3, 3] * scale + offset
        moved = replace(capture, cameras=replace(capture.cameras, world_from_camera=pose))
        assert report_split(moved).new_times == 1


@settings(max_examples=30, deadline=None)
@given(
    places=st.lists(st.integers(0, 4), min_size=2, max_size=12),
    moments=st.lists(st.integers(0, 3), min_size=12, max_size=12),
    held=st.lists(st.booleans(), min_size=12, max_size=12),
)
def test_every_held_out_frame_is_judged_as_by_comparing_all_pairs(places, moments, held) -> None:
    count = len(places)
    moments, held = moments[:count], held[:count]
    pairs = list(zip(places, moments, strict=True))
    learnt = [pair for pair, out in zip(pairs, held, strict=True) if not out]
    tested = [pair for pair, out in zip(pairs, held, strict=True) if out]
    capture = small_capture([0.3 * place for place in places], [float(m) for m in moments], held)
    if not learnt or set(learnt) & set(tested):
        with pytest.raises(InputError):
            report_split(capture)
        return
    report = report_split(capture)
    seen = {place for place, _ in learnt}
    assert report.new_times == sum(place in seen for place, _ in tested)
    assert report.new_views == len(tested) - report.new_times


def test_views_are_numbered_alike_when_their_poses_are() -> None:
    groups = same_view_groups(poses_at([0.1, 0.5, 0.1, 0.9, 0.5]))
    assert groups[0] == groups[2] != groups[1] == groups[4] != groups[3]
    turned = poses_at([0.1, 0.1])
    turned[1, :3, :2] = -turned[1, :3, :2]
    assert len(set(same_view_groups(turned).tolist())) == 2


@pytest.mark.parametrize("scale", [1e-7, 1.0, 1e7])
def test_places_are_told_apart_in_shares_of_the_rig(scale: float) -> None:
    pose = poses_at([0.3]).repeat(4, 1, 1)
    pose[:, 0, 3] = scale * torch.tensor([0.0, 1e-6, 1.0, 1.001], dtype=torch.float64)
    groups = same_view_groups(pose).tolist()
    assert groups[0] == groups[1]
    assert len(set(groups)) == 3


def test_thousands_of_frames_need_no_table_of_all_pairs() -> None:
    # 40,000 squared bytes would be 1.6 GB for each of thirteen values.
    count = 40_000
    base = small_capture([0, 1], [0, 0], [0, 0])
    pose = base.cameras.world_from_camera[:1].repeat(count, 1, 1)
    pose[:, 0, 3] = torch.arange(count, dtype=torch.float64)
    capture = replace(
        base,
        cameras=replace(base.cameras[:1].with_pose(pose)),
        times_s=torch.arange(count, dtype=torch.float64),
        camera_index=torch.zeros(count, dtype=torch.int64),
        held_out=torch.arange(count) % 8 == 0,
    )
    assert report_split(capture).new_views == 5000
