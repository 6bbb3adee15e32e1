"""From a clip to tensors of one shape."""

from dataclasses import fields, replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_clips import make_clip

from diff4splat.data.clip import Clip
from diff4splat.errors import InputError
from diff4splat.geometry.camera import Camera, project
from diff4splat.training.batches.clip_batch import ClipBatch, collate
from diff4splat.training.batches.normalise_scale import normalized
from diff4splat.training.batches.resize import resized
from diff4splat.training.batches.sample import Origin, make_sample
from diff4splat.training.batches.samples import ClipSamples
from diff4splat.training.batches.targets import MIN_MOTION, draw_targets, draw_tracks
from diff4splat.training.batches.temporal_crop import _frames, crop, repeat_keyframes
from diff4splat.training.recipe.data import DataSettings, SourceSettings
from diff4splat.training.recipe.losses import ReconstructionLosses
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.stage import SampleKey

DATA = DataSettings(size_px=(24, 32), frames=5, views=2, target_frames=4, tracks=8)


def sample(clip: Clip, data: DataSettings = DATA, index: int = 0) -> ClipBatch:
    origin = Origin(key=SampleKey(0, "dynamic", index, "sample"), source="made")
    return make_sample(clip, data, origin)


def test_shapes_are_those_of_the_settings() -> None:
    one = sample(make_clip(tracks=20))
    assert one.video.shape == (1, 5, 24, 32, 3)
    assert one.cameras.batch_shape == (1, 5)
    assert one.target_rgb.shape == (1, 2, 2, 24, 32, 3)
    assert one.target_cameras.batch_shape == (1, 2, 2)
    assert one.target_time.shape == (1, 2)
    assert one.track_offset.shape == (1, 2, 8, 3)


def test_one_key_gives_one_sample_and_another_gives_another() -> None:
    clip = make_clip(tracks=20)
    first, again, other = sample(clip), sample(clip), sample(clip, index=1)
    for field in fields(ClipBatch):
        value = getattr(first, field.name)
        if isinstance(value, torch.Tensor):
            assert torch.equal(value, getattr(again, field.name)), field.name
    assert not torch.equal(first.track_cell, other.track_cell)


def test_batches_are_samples_one_after_the_other() -> None:
    clip = make_clip(tracks=20)
    both = collate([sample(clip, index=3), sample(clip, index=4)])
    assert both.sample_index.tolist() == [3, 4]
    assert both.cameras.batch_shape == (2, 5)
    assert both.target_cameras.batch_shape == (2, 2, 2)
    assert len(both.captions) == len(both) == 2


def test_targets_show_their_view_at_their_time() -> None:
    clip = normalized(make_clip(static=False))
    one = sample(clip)
    for time, fraction in enumerate(one.target_time[0].tolist()):
        frame = round(fraction * (clip.frames - 1))
        for place, view in enumerate((1, 0)):
            shown = clip.views[view]
            assert torch.equal(one.target_rgb[0, time, place], shown.rgb[frame])
            pose = one.target_cameras.world_from_camera[0, time, place]
            torch.testing.assert_close(pose, shown.cameras.world_from_camera[frame].float())


def test_tracks_start_at_the_pixel_that_shows_them() -> None:
    clip = make_clip(tracks=20)
    one = sample(clip)
    assert bool(one.track_valid.any())
    for cell, valid in zip(one.track_cell[0].tolist(), one.track_valid[0].tolist(), strict=True):
        frame, row, column = cell
        assert not valid or int(clip.views[0].instances[frame, row, column]) > 0


def test_track_offsets_lead_to_where_the_point_is_seen_then() -> None:
    clip = normalized(make_clip(static=False, tracks=20))
    generator = torch.Generator().manual_seed(0)
    frames = torch.tensor([0, 4])
    tracks = draw_tracks(clip, frames, DATA, generator)
    positions, uv = clip.tracks.positions, clip.views[0].track_uv
    for point in tracks.valid.nonzero()[:, 0].tolist():
        frame, row, column = tracks.cell[point].tolist()
        at = (uv[frame] - torch.tensor([column + 0.5, row + 0.5])).abs().amax(-1) <= 0.5
        candidates = positions[frames][:, at] - positions[frame][at]
        gap = (candidates - tracks.offset[:, point, None]).abs().amax((0, 2))
        assert float(gap.min()) < 1e-5


def test_what_stands_still_may_be_looked_at_at_any_time() -> None:
    times = torch.cat([sample(make_clip(static=True), index=i).target_time[0] for i in range(8)])
    steps = times * (DATA.frames - 1)
    assert float((steps - steps.round()).abs().max()) > 0.05
    assert bool(((times >= 0) & (times <= 1)).all())


def test_a_static_clip_offers_no_motion() -> None:
    one = sample(make_clip(static=True, tracks=20))
    assert bool(one.is_static) and float(one.track_offset.abs().max()) < 1e-6


def test_clips_without_tracks_make_samples_without_valid_points() -> None:
    one = sample(make_clip(tracks=0))
    assert not bool(one.track_valid.any()) and float(one.track_offset.abs().max()) == 0


def test_longer_clips_are_cut_and_start_at_the_identity() -> None:
    clip = make_clip(frames=9, tracks=16)
    part = crop(clip, 5, torch.Generator().manual_seed(3))
    assert part.frames == 5
    first = part.views[0].cameras.world_from_camera[0]
    torch.testing.assert_close(first, torch.eye(4, dtype=first.dtype))
    pixels, _ = project(part.views[1].cameras[2], part.tracks.positions[2].double())
    seen = part.views[1].track_visible[2]
    torch.testing.assert_close(
        pixels[seen].float(), part.views[1].track_uv[2][seen].float(), atol=1e-2, rtol=0
    )


def test_clips_that_are_too_short_say_so() -> None:
    with pytest.raises(InputError, match="clip-0: expected at least 5 frames, got 3"):
        sample(make_clip(frames=3))


def test_keyframes_give_the_motion_network_the_same_as_full_clips() -> None:
    whole = make_clip(frames=17, static=False, tracks=20)
    data = replace(DATA, input_stride=2)
    moments = sample(
        _frames(whole, slice(None, None, 8)), replace(data, frames=9, keyframes_only=True)
    )
    wanted = sample(whole, replace(data, frames=9))
    assert bool(wanted.moving.any())
    for name in ("field", "moving"):
        torch.testing.assert_close(getattr(moments, name), getattr(wanted, name), msg=name)
    assert torch.equal(moments.video[:, 0], wanted.video[:, 0])
    assert moments.video.shape == wanted.video.shape


def test_a_moment_stands_for_the_frames_up_to_it() -> None:
    clip = repeat_keyframes(make_clip(frames=3), 4)
    times_s = make_clip(frames=3).times_s
    wanted = [0, 1, 1, 1, 1, 2, 2, 2, 2]
    torch.testing.assert_close(clip.times_s, times_s[wanted])


def test_full_clips_are_refused_where_keyframes_are_expected() -> None:
    data = replace(DATA, frames=9, input_stride=2, keyframes_only=True)
    with pytest.raises(InputError, match="expected 3 keyframes, got 17 frames"):
        sample(make_clip(frames=17), data)


def test_smaller_images_keep_depth_and_rays_together() -> None:
    clip = make_clip(size_px=(48, 64), static=True)
    small = resized(clip, (24, 32))
    assert small.views[0].rgb.shape[1:3] == (24, 32)
    # Nearest pixels: the depth is that of a ray half a pixel away.
    assert set(small.views[0].depth[0].unique().tolist()) <= set(
        clip.views[0].depth[0].unique().tolist()
    )
    torch.testing.assert_close(small.views[0].cameras.focal_px * 2, clip.views[0].cameras.focal_px)
    mean = small.views[0].rgb.float().mean() - clip.views[0].rgb.float().mean()
    assert abs(float(mean)) < 1


def test_another_shape_of_image_is_refused() -> None:
    with pytest.raises(InputError, match="expected images of the shape 32×32, got 24×32"):
        resized(make_clip(), (32, 32))


@settings(max_examples=25, deadline=None)
@given(
    frames=st.integers(1, 9),
    views=st.integers(1, 4),
    wanted=st.integers(1, 12),
    seed=st.integers(0, 99),
)
def test_targets_exist_and_half_are_not_the_inputs(
    frames: int, views: int, wanted: int, seed: int
) -> None:
    data = replace(DATA, target_frames=wanted)
    drawn = draw_targets(frames, views, data, torch.Generator().manual_seed(seed))
    assert len(set(drawn.frames.tolist())) == len(drawn.frames) >= 1
    assert bool((drawn.frames < frames).all()) and bool((drawn.views < views).all())
    if views > 1:
        assert float((drawn.views > 0).float().mean()) >= 0.5


class Named:
    """A source that answers with clips it can be told by."""

    def __init__(self, seed: int) -> None:
        self.seed = seed

    def clip(self, index: int) -> Clip:
        return make_clip(seed=self.seed)


def test_sources_are_drawn_by_weight_and_named_in_the_sample() -> None:
    sources = (SourceSettings(weight=1.0), SourceSettings(weight=3.0))
    data = replace(DATA, sources=sources)
    recipe = StageRecipe(
        name="s",
        kind="static",
        steps=1,
        global_batch=1,
        micro_batch=1,
        trained=(),
        data=data,
        losses=ReconstructionLosses(),
    )
    samples = ClipSamples(recipe, 0, [Named(1), Named(2)])
    drawn = [int(samples[index].source[0][0]) for index in range(60)]
    assert 0.6 < sum(drawn) / len(drawn) < 0.9
    assert drawn == [int(samples[index].source[0][0]) for index in range(60)]


def test_moving_a_batch_keeps_everything() -> None:
    one = sample(make_clip(tracks=20))
    moved = one.to(torch.device("cpu"))
    assert moved.captions == one.captions and isinstance(moved.cameras, Camera)


def test_half_of_the_points_move_where_enough_do() -> None:
    clip = normalized(make_clip(static=False, tracks=60))
    settings = replace(DATA, tracks=8)
    frames = torch.arange(clip.frames)
    tracks = draw_tracks(clip, frames, settings, torch.Generator().manual_seed(0))
    moving = tracks.offset[:, tracks.valid].norm(dim=-1).amax(0) > MIN_MOTION / 2
    assert tracks.valid.all() and 3 <= int(moving.sum()) <= 5


def test_only_input_frames_that_carry_gaussians_are_followed_from() -> None:
    settings = replace(DATA, frames=5, input_stride=2, keyframe_stride=2, tracks=16)
    one = sample(make_clip(frames=9, tracks=40), settings)
    assert one.video.shape[1] == 5 and one.depth.shape[1] == 3
    assert set(one.track_cell[0, one.track_valid[0], 0].tolist()) <= {0, 2, 4}
    steps = one.target_time * 8
    torch.testing.assert_close(steps, steps.round())
