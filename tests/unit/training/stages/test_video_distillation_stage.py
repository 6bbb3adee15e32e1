"""The stage that teaches the video model few steps."""

from dataclasses import replace

import pytest
import torch
from stage_fixtures import make_batch, make_stage, shake_heads, stage_recipe

from diff4splat.configs.recipes import recipe_by_name
from diff4splat.errors import ConfigError
from diff4splat.training.latents.latent_batch import LatentBatch
from diff4splat.training.recipe.losses import DistillationLosses, FlowLosses
from diff4splat.training.recipe.recipe_json import recipe_from_json, recipe_to_json
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.factory import STAGES
from diff4splat.training.stages.kinds.video_distillation import VideoDistillationStage


def distil(**losses: object) -> StageRecipe:
    return replace(
        stage_recipe("video_diffusion"), name="video_distillation", kind="video_distillation",
        trained=("dit",), losses=DistillationLosses(**losses), text_dropout=0.0,
    )  # fmt: skip


def shaken(recipe: StageRecipe) -> VideoDistillationStage:
    """With heads that say something, in the teacher too."""
    stage = make_stage(recipe)
    shake_heads(stage)
    stage._teacher[0].load_state_dict(stage.dit.state_dict())
    return stage


def encoded(stage: VideoDistillationStage, recipe: StageRecipe) -> LatentBatch:
    return stage.encoded(make_batch(recipe, (0, 1)))


def test_a_student_of_as_many_steps_is_its_teacher() -> None:
    recipe = distil(segments=3, teacher_steps=1)
    stage = shaken(recipe)
    batch = encoded(stage, recipe)
    assert float(stage(batch)[TOTAL].detach().max()) < 1e-9
    assert float(stage.measure(batch)["distillation_error"].max()) < 1e-9


def test_a_teacher_of_more_steps_teaches_where_they_lead() -> None:
    recipe = distil(segments=2, teacher_steps=3)
    stage = shaken(recipe)
    batch = encoded(stage, recipe)
    levels = (torch.ones(2), torch.full((2,), 0.5))
    video, taught = stage.taught(batch, levels, "noise")
    state = video.latent
    for number in range(3):
        level = torch.full((2,), 1 - number / 6)
        velocity = stage.flow.velocity_at(
            batch, state, replace(video, level=level).levels, stage.training
        )
        state = torch.cat([state[:, :, :1], state[:, :, 1:] - velocity[:, :, 1:] / 6], 2)
    reached = video.latent - 0.5 * (taught.noise - taught.clean)
    torch.testing.assert_close(reached, state, rtol=1e-4, atol=1e-5)
    assert torch.equal(taught.latent[:, :, 0], batch.latent[:, :, 0])


def test_guidance_goes_into_the_student_above_its_lower_end() -> None:
    plain, told = (
        distil(segments=2, teacher_steps=1, guidance=g, guidance_low=0.6) for g in (1.0, 4.0)
    )
    stages = [shaken(recipe) for recipe in (plain, told)]
    batch = encoded(stages[0], plain)
    for ends, differs in (((1.0, 0.5), True), ((0.5, 0.0), False)):
        levels = tuple(torch.full((2,), end) for end in ends)
        clean = [stage.taught(batch, levels, "noise")[1].clean for stage in stages]
        assert torch.equal(*clean) != differs


def test_only_the_student_learns_and_the_teacher_is_not_stored() -> None:
    recipe = distil()
    stage = shaken(recipe)
    with torch.no_grad():
        for parameter in stage.dit.parameters():
            parameter.mul_(1.01)
    terms = stage(encoded(stage, recipe))
    assert set(terms) == {"distillation", TOTAL}
    terms[TOTAL].sum().backward()
    gradients = {name: one.grad for name, one in stage.named_parameters() if one.grad is not None}
    assert gradients and all(name.startswith("dit.") for name in gradients)
    assert all(bool(one.isfinite().all()) for one in gradients.values())
    assert all(one.grad is None for one in stage._teacher[0].parameters())
    assert set(dict(stage.named_children())) == set(stage.parts)


@pytest.mark.parametrize(
    ("field", "value"),
    [("segments", 0), ("teacher_steps", 0), ("guidance_low", 1.5), ("guidance", float("nan"))],
)
def test_settings_that_mean_nothing_are_refused(field: str, value: float) -> None:
    with pytest.raises(ConfigError, match=f"losses: {field}: expected"):
        DistillationLosses(**{field: value})


def test_the_recipe_is_written_and_read() -> None:
    recipe = recipe_by_name("distil")
    assert recipe_from_json(recipe_to_json(recipe)) == recipe
    stage = recipe.stage("video_distillation")
    assert STAGES[stage.kind] is VideoDistillationStage
    assert isinstance(stage.losses.flow, FlowLosses)
