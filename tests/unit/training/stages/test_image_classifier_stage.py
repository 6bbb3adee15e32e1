"""The stage of the image classifier: what learns, and what stays."""

from dataclasses import replace

import pytest
import torch
from stage_fixtures import make_stage, stage_recipe

from diff4splat.configs.recipes import recipe_by_name
from diff4splat.errors import ConfigError
from diff4splat.models.config.model import MotionUNetConfig, ObjectMaskConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.image_classifier import network
from diff4splat.training.batches.requests.request_batch import RequestBatch
from diff4splat.training.recipe.losses import ImageClassifierLosses
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.model_stage import ModelStage

MODEL = replace(
    tiny_size(),
    motion_unet=MotionUNetConfig(width=8, heads=1),
    object_mask=ObjectMaskConfig(width=4, image_classifier=True),
)


def classifier_recipe() -> StageRecipe:
    return replace(
        stage_recipe("video_diffusion"),
        name="image_classifier",
        kind="image_classifier",
        trained=("image_classifier",),
        losses=ImageClassifierLosses(),
    )


@pytest.fixture(autouse=True)
def _every_cell_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """A random classifier is sure of nothing."""
    monkeypatch.setattr(network, "LEAST_PROBABILITY", 1e-9)


def classifier_stage() -> ModelStage:
    return make_stage(classifier_recipe(), model=MODEL)


def requests(*captions: str) -> RequestBatch:
    """One image; the first prompt asks for its left half, the second for nothing."""
    generator = torch.Generator().manual_seed(0)
    masks = torch.zeros(1, 2, 32, 32, dtype=torch.bool)
    masks[:, 0, :, :16] = True
    names = torch.zeros(1, 32, 32, dtype=torch.uint8)
    return RequestBatch(
        sample_index=torch.tensor([0]),
        source=("x",),
        images=torch.randint(256, (1, 32, 32, 3), generator=generator).to(torch.uint8),
        masks=masks,
        nouns=names,
        colors=names,
        objects=names,
        has_requests=torch.tensor([True]),
        captions=captions,
    )


CAPTIONS = ("the fox moves to the left", "the red car moves to the right")


def test_only_the_correction_learns_and_all_is_finite() -> None:
    stage = classifier_stage()
    torch.nn.init.normal_(stage.image_classifier.output.weight, std=0.1)
    terms = stage(requests(*CAPTIONS))
    assert set(terms) == {"cross_entropy", "dice", "absent", TOTAL}
    terms[TOTAL].sum().backward()
    gradients = {name: p.grad for name, p in stage.named_parameters() if p.grad is not None}
    wanted = {f"image_classifier.{layer}" for layer in ("input", "hidden", "output")}
    assert {name.rpartition(".")[0] for name in gradients} == wanted
    assert all(bool(gradient.isfinite().all()) for gradient in gradients.values())


def test_it_learns_which_classes_are_there() -> None:
    stage, batch = classifier_stage(), requests(*CAPTIONS)
    before = float(stage(batch)[TOTAL].detach().mean())
    learning = [p for name, p in stage.image_classifier.named_parameters() if "cells." not in name]
    optimiser = torch.optim.Adam(learning, lr=2e-2)
    for _ in range(30):
        optimiser.zero_grad()
        stage(batch)[TOTAL].mean().backward()
        optimiser.step()
    assert float(stage(batch)[TOTAL].detach().mean()) < 0.8 * before


def test_prompts_of_unknown_nouns_teach_nothing() -> None:
    stage = classifier_stage()
    torch.nn.init.normal_(stage.image_classifier.output.weight, std=0.1)
    stage(requests("a zorkel moves to the left", "nothing moves"))[TOTAL].sum().backward()
    gradients = [p.grad for p in stage.image_classifier.parameters() if p.grad is not None]
    assert not any(bool(gradient.any()) for gradient in gradients)


def test_images_whose_requests_do_not_count_have_no_loss() -> None:
    stage = classifier_stage()
    batch = replace(requests(*CAPTIONS), has_requests=torch.tensor([False]))
    assert not bool(stage(batch)[TOTAL].detach().any())


def test_a_recipe_for_a_model_without_a_classifier_is_refused() -> None:
    recipe = recipe_by_name("small")
    mask = replace(recipe.model.object_mask, image_classifier=False)
    with pytest.raises(ConfigError, match=r"object_mask\.image_classifier: expected true"):
        replace(recipe, model=replace(recipe.model, object_mask=mask))


def test_a_classifier_without_a_mask_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"image_classifier: expected false without an object"):
        ObjectMaskConfig(image_classifier=True)
