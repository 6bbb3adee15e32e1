"""Clips by index: from folders, in shares and epochs, and from worlds without end."""

import os
import pickle
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import pytest
import torch
from clip_shards import FRAMES, SIZE_PX, exact_clip, process_and_name, without_depth, write_shards
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.data.clip import Clip
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.errors import FileFormatError, InputError
from diff4splat.training.batches.epoch_shuffle import VALIDATION_EVERY
from diff4splat.training.batches.normalise_scale import normalized
from diff4splat.training.batches.samples import ClipSamples
from diff4splat.training.batches.sources import (
    EndlessClips,
    FolderClips,
    open_source,
    unused_sources,
    world_clips,
)
from diff4splat.training.recipe.data import DataSettings, SourceSettings
from diff4splat.training.recipe.losses import ReconstructionLosses
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.trainer.loading.loader import load_batch
from diff4splat.training.trainer.loading.samples import EVALUATION_START

STILL, MOVING = 5, 18
DATA = DataSettings(size_px=SIZE_PX, frames=FRAMES, views=2, target_frames=2, tracks=8, workers=0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_shards(tmp_path_factory.mktemp("shards"), still=STILL, moving=MOVING)


def source(folder: Path, still_share: float, seed: int = 0) -> EndlessClips:
    given = SourceSettings(kind="shards", folder=str(folder), still_share=still_share)
    return open_source(given, DATA, seed)


def names(clips: EndlessClips, indices: range) -> list[str]:
    return [clips.clip(index).note.identifier for index in indices]


def recipe(*sources: SourceSettings, data: DataSettings = DATA) -> StageRecipe:
    return StageRecipe(
        name="s",
        kind="static",
        steps=1,
        global_batch=1,
        micro_batch=1,
        trained=("ldrm",),
        losses=ReconstructionLosses(),
        data=replace(data, sources=sources),
    )


@pytest.mark.slow
def test_the_share_of_still_clips_is_the_asked_one(folder: Path) -> None:
    clips = source(folder, still_share=0.3)
    still = [clips.clip(index).note.is_static for index in range(200)]
    # Three standard deviations of 200 draws are 0.1.
    assert 0.2 < sum(still) / len(still) < 0.4
    assert all(source(folder, 1.0).clip(index).note.is_static for index in range(8))
    assert not any(source(folder, 0.0).clip(index).note.is_static for index in range(8))


@pytest.mark.parametrize(("still_share", "count"), [(1.0, STILL), (0.0, MOVING)])
def test_every_epoch_shows_every_clip_once_in_another_order(
    folder: Path, still_share: float, count: int
) -> None:
    trained = count - -(-count // VALIDATION_EVERY)
    clips = source(folder, still_share)
    epochs = [names(clips, range(trained * e, trained * (e + 1))) for e in range(4)]
    for epoch in epochs:
        assert len(set(epoch)) == trained
        assert set(epoch) == set(epochs[0])
    assert len({tuple(epoch) for epoch in epochs}) > 1


@pytest.mark.parametrize(
    "still_share", [0.5, *(pytest.param(share, marks=pytest.mark.slow) for share in (0.0, 1.0))]
)
def test_clips_kept_back_are_never_trained_on(folder: Path, still_share: float) -> None:
    clips = source(folder, still_share)
    trained = set(names(clips, range(100)))
    judged = set(names(clips, range(EVALUATION_START, EVALUATION_START + 40)))
    assert judged and not trained & judged
    kinds = (still_share > 0) * STILL + (still_share < 1) * MOVING
    assert len(trained | judged) == kinds


def test_equal_indices_give_equal_clips_and_seeds_another_order(folder: Path) -> None:
    first = names(source(folder, 0.0), range(12))
    assert names(source(folder, 0.0), range(12)) == first
    assert names(source(folder, 0.0, seed=1), range(12)) != first


def test_a_single_clip_is_learnt_and_judged(tmp_path: Path) -> None:
    clips = source(write_shards(tmp_path, still=1, moving=0), still_share=1.0)
    assert set(names(clips, range(3))) == set(
        names(clips, range(EVALUATION_START, EVALUATION_START + 3))
    )


def test_flow_stays_on_disk_and_views_beyond_the_asked_ones_too(folder: Path) -> None:
    given = SourceSettings(kind="shards", folder=str(folder), still_share=1.0)
    clip = open_source(given, replace(DATA, views=1), 0).clip(0)
    assert len(clip.views) == 1
    assert clip.views[0].flow is None
    assert len(open_source(given, replace(DATA, views=9), 0).clip(0).views) == 2


@pytest.mark.parametrize(
    ("still", "moving", "share", "says"),
    [
        (0, 2, 0.25, r"expected still clips for still_share 0.25, got none; .* still_share to 0"),
        (2, 0, 0.25, r"expected moving clips for still_share 0.25, .* still_share to 1"),
        (0, 2, 1.0, "expected still clips for still_share 1, got none"),
    ],
)
def test_a_folder_without_a_kind_that_is_asked_for_is_refused_at_once(
    tmp_path: Path, still: int, moving: int, share: float, says: str
) -> None:
    write_shards(tmp_path, still=still, moving=moving)
    with pytest.raises(InputError, match=says) as caught:
        source(tmp_path, share)
    assert str(caught.value).startswith(f"{tmp_path}: ")


def test_folders_without_clips_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"manifest\.json: expected"):
        source(tmp_path, 0.5)
    write_shards(tmp_path, still=1, moving=1)
    (tmp_path / "manifest.json").write_text("{}")
    with pytest.raises(FileFormatError, match=r"manifest\.json"):
        source(tmp_path, 0.5)


@pytest.mark.slow
def test_other_processes_draw_the_same_clips(folder: Path) -> None:
    clips = source(folder, 0.5)
    here = names(clips, range(3))
    # Opened already: what was read so far must not hinder sending it.
    assert names(pickle.loads(pickle.dumps(clips)), range(3)) == here
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        found = list(pool.map(process_and_name, [clips] * 3, range(3), timeout=300))
    assert [name for _, name in found] == here
    assert os.getpid() not in {process for process, _ in found}


class Counting:
    """A source that can be told by its clip."""

    def __init__(self, clip: Clip) -> None:
        self._clip = clip

    def clip(self, index: int) -> Clip:
        return self._clip


@settings(max_examples=10, deadline=None)
@given(weight=st.floats(0.2, 5.0))
def test_mixtures_follow_their_weights(weight: float) -> None:
    given_ = (SourceSettings(weight=1.0), SourceSettings(weight=weight))
    samples = ClipSamples(recipe(*given_), 0, [Counting(exact_clip(0, True))] * 2)
    drawn = Counter(samples._source(index) for index in range(300))
    share = weight / (1 + weight)
    assert abs(drawn[1] / 300 - share) < 0.12
    assert Counter(samples._source(EVALUATION_START + index) for index in range(50)).keys() <= {
        0,
        1,
    }


def test_a_source_of_no_weight_is_never_asked() -> None:
    given_ = (SourceSettings(weight=0.0), SourceSettings())
    samples = ClipSamples(recipe(*given_), 0, [Counting(exact_clip(0, True))] * 2)
    assert {samples._source(index) for index in range(50)} == {1}


def test_folders_that_give_no_clip_are_named(tmp_path: Path, folder: Path) -> None:
    stills = write_shards(tmp_path / "stills", still=2, moving=0)
    shards = [
        SourceSettings(kind="shards", folder=str(one), still_share=share, weight=weight)
        for one, share, weight in ((folder, 0.0, 1.0), (stills, 0.0, 1.0), (stills, 0.0, 0.0))
    ]
    (line,) = unused_sources(replace(DATA, sources=tuple(shards)))
    assert str(stills) in line and "moving clips" in line and "still_share" in line
    fitting = replace(shards[1], still_share=0.5)
    assert not unused_sources(replace(DATA, sources=(shards[0], fitting)))
    assert not unused_sources(replace(DATA, sources=(shards[1],)))


def test_samples_say_which_source_they_come_from(folder: Path) -> None:
    shards = SourceSettings(kind="shards", folder=str(folder), still_share=1.0)
    sample = ClipSamples.open(recipe(shards), 0)[3]
    assert sample.source == (f"0 {folder}",)
    assert bool(sample.is_static.all())


def test_clips_of_one_view_mix_with_those_of_several() -> None:
    clip = exact_clip(0, True)
    alone = replace(clip, views=clip.views[:1])
    both = (SourceSettings(), SourceSettings())
    samples = ClipSamples(recipe(*both), 0, [Counting(alone), Counting(clip)])
    batch = load_batch(samples, range(12)).batch
    assert len(set(batch.source)) == 2
    # The camera of a static clip at another frame is another view, and has its own pose.
    one = batch.source.index(next(name for name in batch.source if name.startswith("0")))
    poses = batch.target_cameras.world_from_camera[one]
    assert poses.shape[1] == 2


def test_sources_decide_about_depth_and_absent_depth_teaches_nothing() -> None:
    clip = exact_clip(0, False)
    second = replace(clip.views[1], depth=None)
    cases = {
        "never": (clip, "never", False),
        "given": (clip, "true", True),
        "assumed": (replace(clip, note=replace(clip.note, metric="pseudo")), "true", False),
        "asked": (replace(clip, note=replace(clip.note, metric="pseudo")), "always", True),
        "some": (replace(clip, views=(clip.views[0], second)), "true", True),
    }
    for made, rule, teaches in cases.values():
        source = SourceSettings(depth_loss=rule)
        sample = ClipSamples(recipe(source), 0, [Counting(made)])[0]
        assert bool((sample.depth > 0).any()) is teaches


def test_images_alone_teach_and_unknown_motion_is_not_stillness() -> None:
    clip = exact_clip(0, False)
    views = [
        replace(v, depth=None, instances=None, moving=None, track_uv=None, track_visible=None)
        for v in clip.views
    ]
    images = replace(clip, views=tuple(views), tracks=None)
    sample = ClipSamples(recipe(SourceSettings()), 0, [Counting(images)])[0]
    assert not bool(sample.motion_known) and not bool(sample.target_depth.any())
    assert bool(ClipSamples(recipe(SourceSettings()), 0, [Counting(clip)])[0].motion_known)


def test_positions_that_are_not_known_teach_nothing() -> None:
    clip = exact_clip(0, False)
    hidden = torch.zeros(clip.tracks.positions.shape[:2], dtype=torch.bool)
    views = tuple(
        replace(view, track_visible=torch.zeros_like(view.track_visible)) for view in clip.views
    )
    gone = replace(clip, views=views, tracks=replace(clip.tracks, known=hidden))
    sample = ClipSamples(recipe(SourceSettings()), 0, [Counting(gone)])[0]
    assert not bool(sample.track_valid.any()) and not bool(sample.motion_known)


def test_metric_clips_keep_metres_and_others_are_refused() -> None:
    clip = exact_clip(0, True)
    metres = recipe(SourceSettings(), data=replace(DATA, unit="metre"))
    exact = replace(clip, note=replace(clip.note, metric="exact"))
    sample = ClipSamples(metres, 0, [Counting(exact)])[0]
    assert float(sample.depth.max()) <= float(clip.views[0].depth.max()) + 1e-3
    with pytest.raises(InputError, match="metres"):
        relative = replace(clip, note=replace(clip.note, metric="none"))
        ClipSamples(metres, 0, [Counting(relative)])[0]


def test_metres_are_kept_where_they_are_known_in_one_stream() -> None:
    clip = exact_clip(0, True)
    exact = replace(clip, note=replace(clip.note, metric="exact"))
    relative = replace(clip, note=replace(clip.note, metric="none"))
    stream = recipe(
        SourceSettings(unit="known"), SourceSettings(views=1, motion_loss="never"), data=DATA
    )
    samples = ClipSamples(stream, 0, [Counting(exact), Counting(relative)])
    found = [samples[index] for index in range(12)]
    batch = samples.collate(found)
    assert len(set(batch.source)) == 2, "multi-view and monocular clips beside each other"
    for sample, source in zip(found, batch.source, strict=True):
        true = (clip if source.startswith("0") else normalized(clip)).views[0].depth[0]
        assert float(sample.depth[0, 0].max()) == pytest.approx(float(true.max()), rel=1e-3)


def test_a_source_without_motion_does_not_teach_stillness() -> None:
    moving = exact_clip(0, False)
    sample = ClipSamples(recipe(SourceSettings(motion_loss="never")), 0, [Counting(moving)])[0]
    assert not bool(sample.motion_known) and not bool(sample.track_valid.any())


def test_clips_without_depth_are_replaced_and_counted(tmp_path: Path) -> None:
    write_shards(tmp_path, still=6, moving=0, blind=(0, 1))
    shards = SourceSettings(kind="shards", folder=str(tmp_path), still_share=1.0)
    samples = ClipSamples.open(recipe(shards), 0)
    loaded = load_batch(samples, range(5))  # one epoch: five of six, one is kept back
    assert len(loaded.batch) == 5
    assert len(loaded.failures) >= 2
    reasons = {failure.reason for failure in loaded.failures}
    assert reasons == {"InputError: expected depth in at least 1% of the first input frame"}
    assert all("leave the clip out" in failure.message for failure in loaded.failures)


def test_a_blind_clip_alone_leaves_no_sample(tmp_path: Path) -> None:
    clip = exact_clip(0, True)
    bare = tuple(replace(view, track_uv=None, track_visible=None) for view in clip.views)
    with ShardWriter(tmp_path, ShardOptions(generator="oracle 1")) as writer:
        writer.write(without_depth(replace(clip, views=bare)))
    shards = SourceSettings(kind="shards", folder=str(tmp_path), still_share=1.0)
    assert load_batch(ClipSamples.open(recipe(shards), 0), [0]).batch is None


@pytest.fixture(scope="module")
def worlds() -> EndlessClips:
    return open_source(SourceSettings(kind="worlds", still_share=0.0), DATA, 0)


@pytest.mark.parametrize("index", [0, EVALUATION_START, EVALUATION_START + 2**39 + 7])
def test_every_index_is_one_world(worlds: EndlessClips, index: int) -> None:
    first, again = worlds.clip(index), worlds.clip(index)
    assert first.note == again.note
    assert torch.equal(first.views[1].rgb, again.views[1].rgb)
    assert torch.equal(first.views[0].depth, again.views[0].depth)
    assert (first.frames, first.size_px, len(first.views)) == (FRAMES, SIZE_PX, 2)
    assert not first.note.is_static
    assert first.views[0].flow is None


def test_moments_are_drawn_as_far_apart_as_the_video_is_long() -> None:
    data = DataSettings(frames=9, input_stride=2, keyframes_only=True)
    moments = world_clips(SourceSettings(), data, 0).recipe
    whole = world_clips(SourceSettings(), replace(data, keyframes_only=False), 0).recipe
    assert (moments.frames, moments.fps) == (3, 1.0)
    assert (whole.frames, whole.fps) == (17, 8.0)


def test_neighbours_are_other_worlds(worlds: EndlessClips) -> None:
    assert worlds.clip(0).note.identifier != worlds.clip(EVALUATION_START).note.identifier
    assert not torch.equal(worlds.clip(0).views[0].rgb, worlds.clip(EVALUATION_START).views[0].rgb)


def test_clips_kept_in_memory_are_read_once_and_stay_as_they_were(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = SourceSettings(kind="shards", folder=str(folder), still_share=0.5)
    data = replace(DATA, augment=True)
    read: list[int] = []
    plain = FolderClips._read
    monkeypatch.setattr(
        FolderClips, "_read", lambda self, place: (read.append(place), plain(self, place))[1]
    )

    def images(in_memory: bool) -> list[torch.Tensor]:
        kept = replace(data, in_memory=in_memory)
        samples = ClipSamples.open(recipe(given, data=kept), seed=0)
        return [samples[index].video for index in (*range(40), *range(40))]

    before, counted = images(in_memory=False), len(read)
    after = images(in_memory=True)
    assert counted == 80 and len(read) - counted == len(set(read[counted:])) < 40
    assert all(torch.equal(one, other) for one, other in zip(before, after, strict=True))
