"""The correction of a mask by an image classifier."""

import pytest
import torch

from diff4splat.captions.image_classes.class_nouns import CLASSES, class_rows
from diff4splat.models.image_classifier.network import CELL_PX, ImageClassifier

KNOWN, OTHER = tuple(range(600)), tuple(range(300, 1000))
"""Many, so that a random classifier sees some."""


@pytest.fixture(scope="module")
def network() -> ImageClassifier:
    torch.manual_seed(0)
    fresh = ImageClassifier().eval()
    torch.nn.init.normal_(fresh.output.weight, std=0.5)
    return fresh


def inputs(prompts: list[tuple[int, ...]], size: tuple[int, int] = (32, 48)) -> list[torch.Tensor]:
    generator = torch.Generator().manual_seed(1)
    image = torch.rand(1, 3, *size, generator=generator)
    logits = torch.randn(1, len(prompts), *size, generator=generator)
    return [image, logits, class_rows(prompts)[None]]


def test_a_fresh_network_changes_nothing() -> None:
    image, logits, classes = inputs([KNOWN])
    torch.testing.assert_close(ImageClassifier()(image, logits, classes), logits)


def test_prompts_without_classes_stay_as_they_are(network: ImageClassifier) -> None:
    image, logits, classes = inputs([(), KNOWN])
    found = network(image, logits, classes)
    torch.testing.assert_close(found[:, 0], logits[:, 0], rtol=0, atol=0)
    assert bool((found[:, 1] != logits[:, 1]).any())


def test_what_no_cell_is_likely_to_show_stays_as_it_is(
    network: ImageClassifier, monkeypatch: pytest.MonkeyPatch
) -> None:
    image, logits, classes = inputs([(5, 700)])
    shown = torch.full((1, CLASSES, 2, 3), -10.0)
    shown[:, 5, 1, 1] = 10.0
    for values, changes in ((shown, True), (shown.flip(1), False)):
        monkeypatch.setattr(network.cells, "forward", lambda _, seen=values: seen)
        assert torch.equal(network(image, logits, classes), logits) != changes


def test_prompts_of_one_image_do_not_meet(network: ImageClassifier) -> None:
    image, logits, classes = inputs([KNOWN, OTHER])
    both = network(image, logits, classes)
    alone = network(image, logits[:, 1:], classes[:, 1:])
    torch.testing.assert_close(both[:, 1:], alone)


def test_images_of_a_batch_do_not_meet(network: ImageClassifier) -> None:
    image, logits, classes = inputs([KNOWN])
    pair = [torch.cat([one, one.flip(-1)]) for one in (image, logits)]
    both = network(*pair, classes.expand(2, -1, -1))
    torch.testing.assert_close(both[:1], network(image, logits, classes), rtol=1e-4, atol=1e-4)


def test_other_classes_give_another_correction(network: ImageClassifier) -> None:
    image, logits, classes = inputs([KNOWN])
    other = network(image, logits, class_rows([OTHER])[None])
    assert bool(((network(image, logits, classes) - other).abs() > 1e-4).any())


def test_what_is_added_has_no_edges_of_its_own(network: ImageClassifier) -> None:
    """The object mask alone draws them: neighbours within a cell are near each other."""
    image, logits, classes = inputs([KNOWN])
    with torch.no_grad():
        added = (network(image, logits, classes) - logits)[0, 0]
    steps = added.diff(dim=-1).abs()
    assert float(steps.max()) <= float(added.max() - added.min()) / CELL_PX + 1e-5


def test_only_the_correction_learns(network: ImageClassifier) -> None:
    network(*inputs([KNOWN])).sum().backward()
    assert all(weight.grad is None for weight in network.cells.parameters())
    assert network.output.weight.grad is not None
    assert bool(network.output.weight.grad.isfinite().all())
    network.zero_grad()


@pytest.mark.parametrize("value", [-1e4, 0.0, 1e4])
def test_extreme_masks_stay_finite(network: ImageClassifier, value: float) -> None:
    image, logits, classes = inputs([KNOWN])
    assert bool(network(image, torch.full_like(logits, value), classes).isfinite().all())
    for flat in (0.0, 1.0):
        assert bool(network(torch.full_like(image, flat), logits, classes).isfinite().all())
