"""Pairs of images with and without an object, in one window."""

from dataclasses import replace

import pytest
import torch

from diff4splat.data.clip import Clip, ClipMetadata, View
from diff4splat.errors import InputError
from diff4splat.geometry.camera import pinhole
from diff4splat.training.batches.samples import ClipSamples
from diff4splat.training.batches.shadows.samples import ShadowSamples, views_without_object
from diff4splat.training.recipe.data import DataSettings
from diff4splat.training.recipe.losses import ObjectShadowLosses
from diff4splat.training.recipe.stage import StageRecipe

SIDE = 48
RECIPE = StageRecipe(
    name="object_shadow",
    kind="object_shadow",
    steps=1,
    global_batch=1,
    micro_batch=1,
    trained=("object_shadow",),
    losses=ObjectShadowLosses(),
    data=DataSettings(size_px=(32, 32), frames=1, views=3),
)


def view(taken: int | None) -> View:
    """A box with a shadow below it, and another box; one of them may be absent."""
    instances = torch.zeros(1, SIDE, SIDE, dtype=torch.uint8)
    rgb = torch.full((1, SIDE, SIDE, 3), 200, dtype=torch.uint8)
    if taken != 1:
        instances[:, 8:24, 8:24] = 1
        rgb[:, 24:32, 8:24] = 100
    if taken != 2:
        instances[:, 8:24, 30:44] = 2
    rgb[instances > 0] = 30
    cameras = pinhole(20.0, (SIDE, SIDE)).with_pose(torch.eye(4)[None])
    return View(rgb=rgb, depth=None, cameras=cameras, instances=instances)


def clip(*taken: int | None) -> Clip:
    note = ClipMetadata(identifier="x", source="test", license="CC0-1.0")
    views = tuple(view(one) for one in (None, *taken))
    return Clip(note=note, times_s=torch.zeros(1).double(), views=views)


class OneClip:
    """A source with one clip."""

    def __init__(self, given: Clip) -> None:
        self.given = given

    def clip(self, index: int) -> Clip:
        return self.given


def samples(given: Clip) -> ShadowSamples:
    return ShadowSamples(ClipSamples(RECIPE, 0, [OneClip(given)]))


def test_views_are_paired_with_the_pixels_of_what_they_lack() -> None:
    pairs = views_without_object(clip(1, None, 2))
    assert [at for at, _ in pairs] == [1, 3]
    for (_, mask), number in zip(pairs, (1, 2), strict=True):
        assert torch.equal(mask, view(None).instances[0] == number)


def test_a_sample_shows_one_window_of_both() -> None:
    source, shadows = samples(clip(1, 2)), 0
    for index in range(12):
        batch = source[index]
        image, without, mask = batch.images[0], batch.without[0], batch.masks[0]
        assert image.shape == without.shape == (32, 32, 3) and mask.shape == (32, 32)
        lighter = (without.int() - image.int()).amax(-1) > 8
        grown = torch.nn.functional.max_pool2d(mask[None, None].float(), 5, 1, 2)[0, 0] > 0
        assert bool(mask[lighter & ~grown].logical_not().all())
        shadows += int(bool((lighter & ~grown).any()))
    assert 0 < shadows < 12


def test_equal_indices_give_equal_samples() -> None:
    first, again = samples(clip(1, 2))[7], samples(clip(1, 2))[7]
    assert torch.equal(first.images, again.images) and torch.equal(first.masks, again.masks)


def test_samples_become_a_batch() -> None:
    source = samples(clip(1))
    batch = source.collate([source[0], source[1]]).to(torch.device("cpu"))
    assert len(batch) == 2 and batch.images.shape == (2, 32, 32, 3)
    assert batch.sample_index.tolist() == [0, 1]


@pytest.mark.parametrize(
    "given",
    [
        clip(),
        clip(None),
        replace(clip(1), views=tuple(replace(one, instances=None) for one in clip(1).views)),
    ],
)
def test_clips_without_such_views_are_refused(given: Clip) -> None:
    with pytest.raises(InputError, match="--without-objects"):
        samples(given)[0]
