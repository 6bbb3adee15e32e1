"""Clips as they are judged: units, times, shapes."""

from dataclasses import replace

import pytest
import torch
from oracles_clips import make_clip
from oracles_evaluation import FRAMES, SIZE, Fixed, tiny_protocol, wall_and_patch

from diff4splat.data.clip import Clip
from diff4splat.errors import InputError
from diff4splat.evaluation.protocols.protocol import Protocol
from diff4splat.evaluation.protocols.sample import clip_sha256, make_sample
from diff4splat.evaluation.systems.evaluated_system import Reconstructor
from diff4splat.scene.scene import Scene


def strided(stride: int) -> Protocol:
    """The protocol for tests, with every so many-th frame given."""
    return replace(tiny_protocol(), input_stride=stride)


def test_the_median_depth_of_the_first_input_frame_becomes_the_plane() -> None:
    clip = make_clip(FRAMES, SIZE)
    case = make_sample(clip, tiny_protocol(), "generation")
    depth = case.input_view.depth[0]
    assert float(depth[depth > 0].median()) == pytest.approx(4.0, rel=1e-6)
    factor = float(case.clip.views[1].depth.max() / clip.views[1].depth.max())
    moved = clip.views[1].cameras.position * factor
    assert torch.allclose(case.clip.views[1].cameras.position, moved)
    assert torch.allclose(case.clip.tracks.positions, clip.tracks.positions * factor)


def test_time_starts_at_zero_and_generation_sees_one_frame() -> None:
    clip = make_clip(FRAMES, SIZE)
    late = replace(clip, times_s=clip.times_s + 7)
    case = make_sample(late, tiny_protocol(), "generation")
    assert case.time_s(0) == 0
    assert case.time_s(4) == pytest.approx(float(clip.times_s[4]))
    assert (case.input_frames, case.nearest_input(4)) == ((0,), 0)
    whole = make_sample(late, tiny_protocol(), "reconstruction")
    assert (whole.input_frames, whole.nearest_input(4)) == (tuple(range(FRAMES)), 4)


@pytest.mark.parametrize("later_s", [0.0, 0.1, 7.3])
def test_of_two_given_frames_that_are_equally_near_the_earlier_is_taken(later_s: float) -> None:
    clip = make_clip(FRAMES, SIZE)
    clip = replace(clip, times_s=clip.times_s + later_s)
    case = make_sample(clip, strided(2), "reconstruction")
    assert [case.nearest_input(frame) for frame in range(FRAMES)] == [0, 0, 2, 2, 4]
    assert [case.neighbouring_inputs(frame) for frame in range(FRAMES)] == [
        (0,),
        (0, 2),
        (2,),
        (2, 4),
        (4,),
    ]


def test_nearness_is_measured_in_seconds() -> None:
    times_s = torch.tensor([0.0, 0.9, 1.0, 1.1, 2.0], dtype=torch.float64)
    case = make_sample(
        replace(make_clip(FRAMES, SIZE), times_s=times_s), strided(2), "reconstruction"
    )
    assert [case.nearest_input(frame) for frame in (1, 3)] == [2, 2]


def test_after_the_last_given_frame_there_is_only_one_around() -> None:
    case = make_sample(make_clip(FRAMES, SIZE), strided(3), "reconstruction")
    assert case.input_frames == (0, 3)
    assert case.neighbouring_inputs(4) == (3,)
    assert case.nearest_input(4) == 3


@pytest.mark.parametrize("stride", [1, 2])
def test_only_the_input_video_is_handed_on(stride: int) -> None:
    case = make_sample(make_clip(FRAMES, SIZE), strided(stride), "reconstruction")
    given, frames = case.input_clip, list(range(0, FRAMES, stride))
    assert (len(given.views), given.frames) == (1, len(frames))
    assert torch.equal(given.views[0].rgb, case.input_view.rgb[frames])
    assert torch.equal(given.times_s, case.clip.times_s[frames])
    poses = case.input_view.cameras.world_from_camera[frames]
    assert torch.equal(given.views[0].cameras.world_from_camera, poses)
    # It shares no memory with the truth, and tells nothing else of it.
    given.views[0].rgb.zero_()
    assert bool(case.input_view.rgb[0].any())
    assert not given.views[0].depth.any()
    hidden = (given.tracks, given.views[0].instances, given.views[0].flow, given.views[0].track_uv)
    assert hidden == (None, None, None, None)
    assert (given.note.objects, given.note.is_static) == ((), False)
    assert given.note.caption == case.clip.note.caption


def test_a_reconstruction_is_given_the_input_video_and_nothing_else() -> None:
    handed: list[Clip] = []

    def reconstruct(clip: Clip) -> Scene:
        handed.append(clip)
        return wall_and_patch()

    case = make_sample(make_clip(FRAMES, SIZE), strided(2), "reconstruction")
    subject = Reconstructor(reconstruct=reconstruct, identity=Fixed(wall_and_patch()).identity)
    subject.predict(case, 0)
    assert (len(handed[0].views), handed[0].frames, handed[0].tracks) == (1, 3, None)
    assert handed[0].times_s.tolist() == [case.time_s(frame) for frame in (0, 2, 4)]


def test_a_clip_without_depth_keeps_its_unit() -> None:
    clip = make_clip(FRAMES, SIZE)
    views = tuple(replace(view, depth=torch.zeros_like(view.depth)) for view in clip.views)
    case = make_sample(replace(clip, views=views), tiny_protocol(), "generation")
    assert not case.has_depth
    assert torch.equal(case.clip.tracks.positions, clip.tracks.positions)


@pytest.mark.parametrize(("frames", "views"), [(4, 2), (FRAMES, 1)])
def test_clips_of_another_length_are_refused(frames: int, views: int) -> None:
    with pytest.raises(InputError, match=r"expected 5 frames of at least 2 views, got"):
        make_sample(make_clip(frames, SIZE, views), tiny_protocol(), "generation")


def test_a_digest_tells_clips_apart() -> None:
    assert clip_sha256(make_clip(2, (8, 8))) == clip_sha256(make_clip(2, (8, 8)))
    assert clip_sha256(make_clip(2, (8, 8))) != clip_sha256(make_clip(2, (8, 8), seed=1))
