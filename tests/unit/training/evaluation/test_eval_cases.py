"""Clips as they are judged: units, times, shapes."""

from dataclasses import replace

import pytest
import torch
from oracles_clips import make_clip
from oracles_evaluation import FRAMES, SIZE, tiny_protocol

from diff4splat.errors import InputError
from diff4splat.training.evaluation.case import clip_sha256, make_case


def test_the_median_depth_of_the_first_input_frame_becomes_the_plane() -> None:
    clip = make_clip(FRAMES, SIZE)
    case = make_case(clip, tiny_protocol(), "generation")
    depth = case.input_view.depth[0]
    assert float(depth[depth > 0].median()) == pytest.approx(4.0, rel=1e-6)
    factor = float(case.clip.views[1].depth.max() / clip.views[1].depth.max())
    moved = clip.views[1].cameras.position * factor
    assert torch.allclose(case.clip.views[1].cameras.position, moved)
    assert torch.allclose(case.clip.tracks.positions, clip.tracks.positions * factor)


def test_time_starts_at_zero_and_generation_sees_one_frame() -> None:
    clip = make_clip(FRAMES, SIZE)
    late = replace(clip, times_s=clip.times_s + 7)
    case = make_case(late, tiny_protocol(), "generation")
    assert case.time_s(0) == 0
    assert case.time_s(4) == pytest.approx(float(clip.times_s[4]))
    assert (case.input_frames, case.nearest_input(4)) == (1, 0)
    whole = make_case(late, tiny_protocol(), "reconstruction")
    assert (whole.input_frames, whole.nearest_input(4)) == (FRAMES, 4)


def test_a_clip_without_depth_keeps_its_unit() -> None:
    clip = make_clip(FRAMES, SIZE)
    views = tuple(replace(view, depth=torch.zeros_like(view.depth)) for view in clip.views)
    case = make_case(replace(clip, views=views), tiny_protocol(), "generation")
    assert not case.has_depth
    assert torch.equal(case.clip.tracks.positions, clip.tracks.positions)


@pytest.mark.parametrize(("frames", "views"), [(4, 2), (FRAMES, 1)])
def test_clips_of_another_length_are_refused(frames: int, views: int) -> None:
    with pytest.raises(InputError, match=r"expected 5 frames of at least 2 views, got"):
        make_case(make_clip(frames, SIZE, views), tiny_protocol(), "generation")


def test_a_digest_tells_clips_apart() -> None:
    assert clip_sha256(make_clip(2, (8, 8))) == clip_sha256(make_clip(2, (8, 8)))
    assert clip_sha256(make_clip(2, (8, 8))) != clip_sha256(make_clip(2, (8, 8), seed=1))
