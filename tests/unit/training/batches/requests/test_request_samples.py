"""Images with prompts from clips: any frame, a part of it, and what every prompt asks for."""

from dataclasses import replace

import pytest
import torch

from diff4splat.captions.colors import COLOR_NAMES
from diff4splat.captions.vocabulary import NOUNS
from diff4splat.data.clip import Clip, ClipMetadata, ObjectNote, View
from diff4splat.errors import InputError
from diff4splat.geometry.camera import pinhole
from diff4splat.training.batches.requests.request_batch import RequestBatch
from diff4splat.training.batches.requests.samples import REQUESTS, RequestSamples
from diff4splat.training.batches.samples import ClipSamples
from diff4splat.training.recipe.data import DataSettings
from diff4splat.training.recipe.losses import ObjectMaskLosses
from diff4splat.training.recipe.stage import StageRecipe

SIDE, FRAMES = 48, 2
RECIPE = StageRecipe(
    name="object_mask",
    kind="object_mask",
    steps=1,
    global_batch=1,
    micro_batch=1,
    trained=("object_mask",),
    losses=ObjectMaskLosses(),
    data=DataSettings(size_px=(32, 32)),
)


def clip(masked: bool = True) -> Clip:
    """A red box left of a blue ball; pixels have the colour of their object in every frame."""
    instances = torch.zeros(FRAMES, SIDE, SIDE, dtype=torch.uint8)
    instances[:, 10:26, 4:20], instances[:, 20:40, 28:44] = 1, 2
    rgb = torch.zeros(FRAMES, SIDE, SIDE, 3, dtype=torch.uint8)
    rgb[instances == 1] = torch.tensor([200, 0, 0], dtype=torch.uint8)
    rgb[instances == 2] = torch.tensor([0, 0, 200], dtype=torch.uint8)
    view = View(
        rgb=rgb,
        depth=None,
        cameras=pinhole(20.0, (SIDE, SIDE)).with_pose(torch.eye(4).repeat(FRAMES, 1, 1)),
        instances=instances if masked else None,
    )
    notes = (
        ObjectNote(instance=1, color="red", name="box", motion="", object_number=1),
        ObjectNote(instance=2, color="blue", name="ball", motion="rolls", object_number=2),
    )
    note = ClipMetadata(identifier="x", source="test", license="CC0-1.0", objects=notes)
    return Clip(note=note, times_s=torch.arange(FRAMES).double(), views=(view,))


class OneClip:
    """A source with one clip."""

    def __init__(self, given: Clip) -> None:
        self.given = given

    def clip(self, index: int) -> Clip:
        del index
        return self.given


def samples(given: Clip | None = None) -> RequestSamples:
    return RequestSamples(ClipSamples(RECIPE, 0, [OneClip(given or clip())]))


def test_shapes() -> None:
    source = samples()
    batch = source.collate([source[0], source[3]])
    assert batch.images.shape == (2, 32, 32, 3)
    assert batch.masks.shape == (2, REQUESTS, 32, 32)
    assert batch.nouns.shape == batch.colors.shape == (2, 32, 32)
    assert len(batch.captions) == 2 * REQUESTS and len(batch) == 2
    assert batch.sample_index.tolist() == [0, 3]
    assert batch.to(torch.device("cpu")).captions == batch.captions


def test_masks_lie_on_the_objects_that_captions_name() -> None:
    source, asked = samples(), set()
    for index in range(40):
        batch = source[index]
        rgb = batch.images[0].int()
        red, blue = rgb[..., 0] > 150, rgb[..., 2] > 150
        for mask in batch.masks[0]:
            parts = [bool((mask & one).any()) for one in (red, blue)]
            for part, pixels in zip(parts, (red, blue), strict=True):
                # Of a sliver at the edge most pixels are mixed.
                whole = int(pixels.sum()) > 100
                assert not (part and whole) or bool(mask[pixels].double().mean() > 0.8)
            asked.add(tuple(parts))
    assert asked == {(False, False), (True, False), (False, True), (True, True)}


def test_every_pixel_has_the_name_of_its_object() -> None:
    source = samples()
    for index in range(10):
        batch = source[index]
        box = batch.nouns[0] == 1 + NOUNS.index("box")
        assert torch.equal(box, batch.colors[0] == 1 + COLOR_NAMES.index("red"))
        ball = batch.nouns[0] == 1 + NOUNS.index("ball")
        assert torch.equal(ball, batch.colors[0] == 1 + COLOR_NAMES.index("blue"))
        assert not bool(batch.nouns[0][~(box | ball)].any())
        if bool(box.any()):
            assert float(batch.images[0][box].float().mean(0)[0]) > 120


def test_parts_and_mirrored_images_occur() -> None:
    source = samples()
    red = [(source[index].images[0, ..., 0] > 150) for index in range(30)]
    centers = [float(one.nonzero()[:, 1].double().mean()) for one in red if bool(one.any())]
    assert min(centers) < 12 and max(centers) > 20
    areas = {int(one.sum()) for one in red}
    assert len(areas) > 8


def test_one_index_gives_one_sample() -> None:
    def bits(batch: RequestBatch) -> tuple:
        return batch.captions, batch.images.sum().item(), batch.masks.sum().item()

    assert bits(samples()[5]) == bits(samples()[5]) != bits(samples()[6])


def test_clips_without_masks_are_refused() -> None:
    with pytest.raises(InputError, match="expected masks of objects"):
        samples(clip(masked=False))[0]


def test_an_image_without_named_objects_asks_for_nothing() -> None:
    bare = replace(clip(), note=replace(clip().note, objects=()))
    assert not bool(samples(bare)[0].masks.any())


def test_every_pixel_has_the_number_of_its_object() -> None:
    source = samples()
    for index in range(6):
        batch = source[index]
        for number, noun in ((1, "box"), (2, "ball")):
            named = batch.nouns[0] == 1 + NOUNS.index(noun)
            assert torch.equal(batch.objects[0] == number, named)


@pytest.mark.parametrize(("motion_loss", "counts"), [("true", True), ("never", False)])
def test_sentences_of_some_sources_do_not_count(motion_loss: str, counts: bool) -> None:
    quiet = replace(RECIPE.data.sources[0], motion_loss=motion_loss)
    recipe = replace(RECIPE, data=replace(RECIPE.data, sources=(quiet,)))
    source = RequestSamples(ClipSamples(recipe, 0, [OneClip(clip())]))
    assert source[0].has_requests.tolist() == [counts]
    assert bool(source[0].objects.any())
