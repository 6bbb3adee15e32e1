"""Clips of any frame rate and any shape of image become samples of one."""

from dataclasses import replace

import pytest
import torch
from clip_shards import exact_clip
from oracles_clips import make_clip

from diff4splat.data.clip import Clip
from diff4splat.training.batches.resize import fitted
from diff4splat.training.batches.temporal_crop import at_frame_rate


def clip_at(fps: float, frames: int = 25) -> Clip:
    clip = make_clip(frames, (16, 16), seed=2, tracks=8)
    return replace(clip, times_s=torch.arange(frames, dtype=torch.float64) / fps)


@pytest.mark.parametrize(
    ("fps", "wanted", "step"),
    [
        (30, 10, 3),
        (24, 10, 2),
        (25, 10, 2),
        (15, 10, 2),
        (14, 10, 1),
        (10, 10, 1),
        (5, 10, 1),
        (60, 10, 6),
    ],
)
def test_frames_are_left_out_until_the_rate_is_nearest(
    fps: float, wanted: float, step: int
) -> None:
    clip = clip_at(fps)
    found = at_frame_rate(clip, float(wanted), least_frames=2)
    chosen = torch.arange(0, 25, step)
    assert torch.equal(found.times_s, clip.times_s[chosen])
    assert torch.equal(found.views[0].rgb, clip.views[0].rgb[chosen])
    assert torch.equal(found.tracks.positions, clip.tracks.positions[chosen])
    poses = [one.views[0].cameras.world_from_camera for one in (found, clip)]
    assert torch.equal(poses[0], poses[1][chosen])


def test_as_many_frames_remain_as_a_sample_needs() -> None:
    assert at_frame_rate(clip_at(60), 10.0, least_frames=9).frames == 9, "every third, not sixth"
    assert at_frame_rate(clip_at(60), 10.0, least_frames=25).frames == 25
    assert at_frame_rate(clip_at(60), 10.0, least_frames=99).frames == 25, "left to the crop"
    assert at_frame_rate(clip_at(60, 2), 1.0, least_frames=1).frames == 2


def test_without_a_rate_every_frame_stays() -> None:
    clip = clip_at(30)
    assert at_frame_rate(clip, 0.0, 2) is clip
    untimed = replace(clip, note=replace(clip.note, timed=False))
    assert at_frame_rate(untimed, 10.0, 2) is untimed


@pytest.mark.parametrize("size_px", [(24, 48), (48, 24), (20, 20), (7, 60)])
@pytest.mark.parametrize("wanted_px", [(16, 16), (12, 20)])
def test_other_shapes_lose_their_edges_and_keep_their_geometry(
    size_px: tuple[int, int], wanted_px: tuple[int, int]
) -> None:
    clip = make_clip(3, size_px, seed=4, tracks=16)
    found = fitted(clip, wanted_px)
    view = found.views[0]
    assert found.size_px == wanted_px and view.rgb.shape[1:3] == wanted_px
    # Points project where the track says, in the new pixels.
    cameras = view.cameras
    for frame in range(3):
        local = found.tracks.positions[frame].double() @ cameras.world_from_camera[frame, :3, :3]
        local = local - cameras.position[frame] @ cameras.world_from_camera[frame, :3, :3]
        uv = local[:, :2] / local[:, 2:] * cameras.focal_px[frame] + cameras.center_px[frame]
        seen = view.track_visible[frame]
        torch.testing.assert_close(uv[seen].float(), view.track_uv[frame][seen], atol=2e-3, rtol=0)
    # The middle stays the middle.
    side = torch.tensor(wanted_px[::-1]) / 2
    before = torch.tensor(size_px[::-1]) / 2
    shift = (clip.views[0].cameras.center_px[0] - before).abs().max()
    assert float((cameras.center_px[0] - side).abs().max()) <= float(shift) * 3 + 1.0


def test_points_outside_of_the_cut_are_not_visible() -> None:
    found = fitted(make_clip(3, (20, 80), seed=1, tracks=64), (16, 16))
    seen = found.views[0].track_uv[found.views[0].track_visible]
    assert len(seen)
    assert bool(((seen >= 0) & (seen <= 16)).all())


def test_the_same_shape_is_only_resized() -> None:
    clip = exact_clip(0, False)
    assert fitted(clip, clip.size_px) is clip
