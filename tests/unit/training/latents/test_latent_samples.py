"""Samples from folders of encoded clips: which, in what shares, and how they are stacked."""

from collections import Counter
from pathlib import Path

import pytest
import torch
from clip_shards import write_shards
from hypothesis import given, settings
from hypothesis import strategies as st
from latent_folders import FRAMES, latent_folder, latents_of, learning_from, make_pack

from diff4splat.errors import ConfigError, FileFormatError, InputError
from diff4splat.training.batches.epoch_shuffle import ShuffledIndices, split_by_motion
from diff4splat.training.batches.samples import ClipSamples
from diff4splat.training.latents.latent_batch import LatentBatch, collate_latents
from diff4splat.training.latents.samples import LatentSamples, open_samples
from diff4splat.training.recipe.data import SourceSettings
from diff4splat.training.trainer.loading.loader import load_batch
from diff4splat.training.trainer.loading.samples import EVALUATION_START

PAIRS = [[False] * 2, [True] * 2] * 8
KINDS = [static for pair in PAIRS for static in pair]
"""Sixteen clips with their mirror images: one in sixteen of a kind would be half a clip."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    packs = [make_pack(KINDS[:24], versions=2), make_pack(KINDS[24:], first=24, versions=2)]
    return latent_folder(tmp_path_factory.mktemp("latents"), *packs)


def numbers(samples: LatentSamples, indices: range) -> list[int]:
    return [int(samples[index].latent[0, 0, 0, 0, 0]) for index in indices]


def judged(count: int) -> range:
    return range(EVALUATION_START, EVALUATION_START + count)


def test_everything_of_a_sample_belongs_to_one_clip(folder: Path) -> None:
    sample = LatentSamples(learning_from(latents_of(folder)), 0)[3]
    number = float(sample.latent.mean())
    assert len(sample) == 1 and sample.sample_index.tolist() == [3]
    assert bool((sample.latent == number).all())
    condition = sample.render_condition
    assert condition is not None and bool((condition.latent == number + 0.5).all())
    hidden = (condition.validity == 0).nonzero()
    assert {tuple(place) for place in hidden[:, [2, 4]].tolist()} == {(4, int(number) % 24)}
    assert sample.captions == (f"clip {number:.0f}, “said”",)
    assert sample.source == (str(folder),)
    assert sample.cameras.batch_shape == (1, FRAMES)
    assert float(sample.cameras.focal_px[0, 0, 0]) == 20 + number


def test_equal_indices_give_equal_samples_and_seeds_another_order(folder: Path) -> None:
    recipe = learning_from(latents_of(folder))
    first = numbers(LatentSamples(recipe, 0), range(16))
    assert numbers(LatentSamples(recipe, 0), range(16)) == first
    assert numbers(LatentSamples(recipe, 1), range(16)) != first


@pytest.mark.parametrize("still_share", [0.0, 0.5, 1.0])
def test_what_is_judged_is_learnt_in_no_version(folder: Path, still_share: float) -> None:
    samples = LatentSamples(learning_from(latents_of(folder, still_share)), 0)
    trained = {number // 2 for number in numbers(samples, range(200))}
    kept = {number // 2 for number in numbers(samples, judged(60))}
    assert trained and kept and not trained & kept
    assert len(trained | kept) == 8 * ((still_share > 0) + (still_share < 1))


def test_still_clips_come_in_the_asked_share(folder: Path) -> None:
    samples = LatentSamples(learning_from(latents_of(folder, 0.25)), 0)
    still = [KINDS[number] for number in numbers(samples, range(200))]
    assert 0.15 < sum(still) / len(still) < 0.35


@settings(max_examples=60, deadline=None)
@given(
    kinds=st.lists(st.booleans(), min_size=1, max_size=80),
    versions=st.integers(1, 3),
)
def test_places_keep_all_versions_of_a_clip_on_one_side(kinds: list[bool], versions: int) -> None:
    is_static = [static for static in kinds for _ in range(versions)]
    places = split_by_motion(is_static, versions)
    for kind, wanted in (("still", True), ("moving", False)):
        own = [place for place, static in enumerate(is_static) if static is wanted]
        learnt, kept = places[kind, False], places[kind, True]
        assert sorted({*learnt, *kept}) == own
        if len(own) > versions:
            clips = [{place // versions for place in side} for side in (learnt, kept)]
            assert all(clips) and not clips[0] & clips[1]
            assert len(kept) == versions * -(-len(own) // (16 * versions))
        else:
            assert learnt == kept == own


def test_every_epoch_shows_every_place_once() -> None:
    places = split_by_motion([False] * 40, versions=2)
    order = ShuffledIndices(0.0, 0)
    count = len(places["moving", False])
    epochs = [[order.place(epoch * count + k, places) for k in range(count)] for epoch in range(3)]
    assert all(sorted(epoch) == places["moving", False] for epoch in epochs)
    assert epochs[0] != epochs[1] != epochs[2]


def test_mixtures_follow_their_weights(tmp_path: Path, folder: Path) -> None:
    other = latent_folder(tmp_path, make_pack(KINDS, first=100, versions=2))
    sources = (latents_of(folder, weight=1.0), latents_of(other, weight=3.0))
    samples = LatentSamples(learning_from(*sources), 0)
    drawn = Counter(samples[index].source[0] for index in range(300))
    assert 0.65 < drawn[str(other)] / 300 < 0.85
    for index in (*range(20), *judged(20)):
        sample = samples[index]
        assert (float(sample.latent.mean()) >= 100) == (sample.source == (str(other),))


def test_a_source_of_no_weight_is_never_asked(tmp_path: Path, folder: Path) -> None:
    other = latent_folder(tmp_path, make_pack(KINDS, first=100, versions=2))
    sources = (latents_of(folder, weight=0.0), latents_of(other))
    samples = LatentSamples(learning_from(*sources), 0)
    assert min(numbers(samples, range(40))) >= 100


@pytest.mark.parametrize(
    ("is_static", "share", "kind"),
    [([True] * 4, 0.25, "moving"), ([False] * 4, 0.25, "still"), ([False] * 4, 1.0, "still")],
)
def test_a_folder_without_a_kind_that_is_asked_for_is_refused_at_once(
    tmp_path: Path, is_static: list[bool], share: float, kind: str
) -> None:
    latent_folder(tmp_path, make_pack(is_static))
    says = rf"expected {kind} clips for still_share {share:g}, got none; .* change still_share"
    with pytest.raises(InputError, match=says):
        LatentSamples(learning_from(latents_of(tmp_path, share)), 0)
    LatentSamples(learning_from(latents_of(tmp_path, float(is_static[0]))), 0)


@pytest.mark.parametrize("rendered", [True, False])
def test_batches_are_samples_one_after_the_other(tmp_path: Path, rendered: bool) -> None:
    latent_folder(tmp_path, make_pack(KINDS, rendered=rendered, versions=2))
    samples = LatentSamples(learning_from(latents_of(tmp_path)), 0)
    alone = [samples[index] for index in range(3)]
    both = collate_latents(alone)
    assert len(both) == 3 and both.sample_index.tolist() == [0, 1, 2]
    torch.testing.assert_close(both.latent, torch.cat([one.latent for one in alone]))
    assert both.captions == tuple(text for one in alone for text in one.captions)
    assert both.cameras.batch_shape == (3, FRAMES) and len(both.source) == 3
    if rendered:
        torch.testing.assert_close(both.render_condition.latent, both.latent + 0.5)
        for index, one in enumerate(alone):
            assert torch.equal(both.render_condition.validity[index], one.validity[0])
    else:
        assert both.render_condition is None


def test_batches_move_whole(folder: Path) -> None:
    batch = LatentSamples(learning_from(latents_of(folder)), 0)[0]
    moved = batch.to(torch.device("meta"))
    tensors = (moved.sample_index, moved.latent, moved.render_latent, moved.validity)
    assert all(tensor.is_meta for tensor in (*tensors, moved.cameras.focal_px))
    assert moved.captions == batch.captions


def test_loaders_read_them_as_they_read_clips(folder: Path) -> None:
    loaded = load_batch(LatentSamples(learning_from(latents_of(folder)), 0), range(4))
    assert isinstance(loaded.batch, LatentBatch) and len(loaded.batch) == 4
    assert not loaded.failures


def test_sources_are_all_latents_or_all_clips(tmp_path: Path, folder: Path) -> None:
    shards = write_shards(tmp_path, still=1, moving=1)
    clips = SourceSettings(kind="shards", folder=str(shards), still_share=0.5)
    for sources in ((latents_of(folder), clips), (SourceSettings(), latents_of(folder))):
        with pytest.raises(ConfigError, match=r"expected .* all latents or all clips"):
            open_samples(learning_from(*sources), 0)
    assert isinstance(open_samples(learning_from(clips), 0), ClipSamples)
    assert isinstance(open_samples(learning_from(latents_of(folder)), 0), LatentSamples)


def test_folders_of_something_else_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="prepare latents"):
        open_samples(learning_from(latents_of(tmp_path)), 0)
    (tmp_path / "latents-00000.safetensors").write_text("something else")
    with pytest.raises(FileFormatError):
        open_samples(learning_from(latents_of(tmp_path)), 0)
