"""The stage of the object shadow: it learns, forgives masks, and measures what it explains."""

from dataclasses import replace

import pytest
import torch
from stage_fixtures import make_stage, stage_recipe

from diff4splat.errors import ConfigError
from diff4splat.models.config.model import ObjectShadowConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.training.batches.shadows.shadow_batch import ShadowBatch
from diff4splat.training.recipe.losses import ObjectShadowLosses
from diff4splat.training.recipe.requirements import require_fit
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.kinds.object_shadow import MASK_ERROR_PX, grown
from diff4splat.training.stages.model_stage import ModelStage

MODEL = replace(tiny_size(), object_shadow=ObjectShadowConfig(width=4))


def recipe(**losses: float) -> StageRecipe:
    return replace(
        stage_recipe("video_diffusion"),
        name="object_shadow",
        kind="object_shadow",
        trained=("object_shadow",),
        losses=ObjectShadowLosses(**losses),
    )


def stage(**losses: float) -> ModelStage:
    return make_stage(recipe(**losses), model=MODEL)


def batch(darkness: float = 0.5, count: int = 2) -> ShadowBatch:
    """Boxes on light ground, with a shadow to their right."""
    without = torch.full((count, 32, 32, 3), 180, dtype=torch.uint8)
    image, masks = without.clone(), torch.zeros(count, 32, 32, dtype=torch.bool)
    image[:, 8:20, 16:28] = round(180 * darkness)
    image[:, 8:20, 8:16], masks[:, 8:20, 8:16] = 40, True
    return ShadowBatch(
        sample_index=torch.arange(count),
        source=("x",) * count,
        images=image,
        without=without,
        masks=masks,
    )


def test_terms_are_finite_and_weighted() -> None:
    terms = stage(darkening=2.0, lit_colors=3.0)(batch())
    assert set(terms) == {"darkening", "lit_colors", TOTAL}
    wanted = 2 * terms["darkening"] + 3 * terms["lit_colors"]
    assert torch.allclose(terms[TOTAL], wanted)
    assert all(bool(value.isfinite().all()) for value in terms.values())


def test_it_learns_one_shadow() -> None:
    made = stage()
    optimizer = torch.optim.Adam(made.parameters(), lr=5e-3)
    first = float(made.measure(batch())["explained"].mean())
    for _ in range(60):
        optimizer.zero_grad()
        made(batch())[TOTAL].mean().backward()
        optimizer.step()
    assert first == pytest.approx(0, abs=1e-6)
    assert float(made.measure(batch())["explained"].mean()) > 0.7


def test_without_a_shadow_nothing_is_measured() -> None:
    assert bool(stage().measure(batch(darkness=1.0))["explained"].isnan().all())


def test_masks_are_wrong_by_a_few_pixels_and_alike_every_time() -> None:
    made, given = stage(), batch(count=12)
    masks = made._random_mask(given) > 0
    assert torch.equal(masks, made._random_mask(given) > 0)
    areas = {int(one.sum()) for one in masks}
    assert len(areas) > 2
    largest, smallest = grown(given.masks, MASK_ERROR_PX), ~grown(~given.masks, MASK_ERROR_PX)
    assert bool((masks <= largest).all()) and bool((smallest <= masks).all())


def test_the_panel_shows_three_images() -> None:
    panel = stage().panel(batch())
    assert panel.shape[-1] == 3 and bool(((panel >= 0) & (panel <= 1)).all())


def test_a_model_without_the_network_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"object_shadow\.width"):
        require_fit(recipe(), tiny_size())
