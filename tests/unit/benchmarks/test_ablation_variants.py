"""What each variant changes in the recipe, and nothing else."""

from dataclasses import replace

import pytest
from ablations.course import is_shared
from ablations.variants import (
    DYNAMIC,
    FULL,
    MOTION,
    STAGES,
    STATIC,
    VARIANTS,
    Variant,
    chosen_variants,
    paid_by,
    recipe_of,
    reduced,
    trained_stages,
    with_steps,
)

from diff4splat.configs.recipes import recipe_by_name
from diff4splat.configs.stages import motion_stage
from diff4splat.errors import ConfigError
from diff4splat.training.prerequisites import sources_of_parts
from diff4splat.training.recipe.overrides import override
from diff4splat.training.recipe.recipe import Recipe

STEPS = {STATIC: 30, MOTION: 20, DYNAMIC: 50}
BASE = reduced(recipe_by_name("small"), STEPS)
LEFT_OUT = {
    "full": (),
    "no-motion-loss": (MOTION,),
    "no-deformation": (MOTION,),
    "no-depth-correlation": (),
    "no-depth-loss": (),
    "no-motion-stage": (MOTION,),
    "no-order": (STATIC, MOTION),
    "pictures": (),
    "no-comparison": (),
    "no-surroundings": (),
}


def variant(name: str) -> Variant:
    return next(one for one in VARIANTS if one.name == name)


def recipe(name: str) -> Recipe:
    return recipe_of(variant(name), BASE)


def losses(name: str, key: str) -> list[float]:
    static, dynamic = (recipe(name).stage(stage).losses for stage in (STATIC, DYNAMIC))
    return [getattr(static, key), getattr(dynamic.reconstruction, key)]


def test_all_stages_are_short_small_and_sampled_in_the_training_process() -> None:
    larger = override(recipe_by_name("small"), [f"stages.{DYNAMIC}.data.size_px=[96, 96]"])
    found = reduced(larger, STEPS)
    stages = [found.stage(name) for name in STAGES]
    assert [stage.name for stage in found.stages] == ["vae", STATIC, MOTION, DYNAMIC]
    assert [stage.kind for stage in stages] == ["static", "motion", "dynamic"]
    assert [stage.steps for stage in stages] == [30, 20, 50]
    assert [stage.optimizer.warmup_steps for stage in stages] == [3, 2, 5]
    assert {(stage.data.size_px, stage.data.workers, stage.gates) for stage in stages} == {
        ((64, 64), 0, ())
    }
    assert found.trainer.evaluation_samples == 0


def test_stages_build_on_the_autoencoder_and_on_each_other_alone() -> None:
    sources = sources_of_parts(BASE, BASE.stage(DYNAMIC))
    found = {part: stage.name for part, stage in sources.items()}
    assert found == {"vae": "vae", "ldrm": STATIC, "deformation": MOTION}


@pytest.mark.parametrize(("name", "left_out"), LEFT_OUT.items())
def test_the_dynamic_stage_gets_the_time_of_the_stages_left_out(
    name: str, left_out: tuple[str, ...]
) -> None:
    found = recipe(name)
    assert trained_stages(found) == tuple(stage for stage in STAGES if stage not in left_out)
    assert found.stage(DYNAMIC).steps == sum(STEPS[stage] for stage in (*left_out, DYNAMIC))
    paid = {stage: paid_by(found, stage) for stage in trained_stages(found)}
    assert paid.pop(DYNAMIC) == (*left_out, DYNAMIC)
    assert paid == {stage: (stage,) for stage in paid}


def test_no_other_variants_are_known() -> None:
    assert [one.name for one in VARIANTS] == list(LEFT_OUT)


def test_the_full_variant_is_the_base() -> None:
    assert recipe_of(FULL, BASE) == BASE


def test_without_motion_stage_the_dynamic_one_differs_in_length_alone() -> None:
    assert recipe("no-motion-stage").stage(DYNAMIC) == with_steps(BASE, DYNAMIC, 70).stage(DYNAMIC)


def test_without_motion_loss_that_weight_differs_as_well() -> None:
    dynamic, kept = (recipe(name).stage(DYNAMIC) for name in ("no-motion-loss", "no-motion-stage"))
    assert dynamic.losses.motion.weight == 0
    assert replace(dynamic, losses=kept.losses) == kept


def test_without_deformation_the_static_kind_goes_on_with_the_data_of_the_dynamic_one() -> None:
    found, kept = (recipe(name).stage(DYNAMIC) for name in ("no-deformation", "no-motion-stage"))
    assert (found.kind, found.trained) == ("static", ("ldrm",))
    assert found.losses == kept.losses.reconstruction
    assert replace(found, kind=kept.kind, trained=kept.trained, losses=kept.losses) == kept


def test_depth_losses_go_in_both_stages_that_render() -> None:
    assert losses("no-depth-correlation", "depth") == [0, 0]
    assert losses("no-depth-correlation", "depth_log") == losses("full", "depth_log") == [0.5, 0.5]
    assert losses("no-depth-loss", "depth") == losses("no-depth-loss", "depth_log") == [0, 0]
    assert recipe("no-depth-loss").stage(MOTION) == BASE.stage(MOTION)


def test_without_order_one_stage_starts_from_nothing_at_the_rate_of_what_does() -> None:
    stage, full = recipe("no-order").stage(DYNAMIC), BASE.stage(DYNAMIC)
    assert stage.optimizer == replace(BASE.stage(STATIC).optimizer, warmup_steps=10)
    assert replace(stage, steps=full.steps, optimizer=full.optimizer) == full


def test_pictures_are_true_in_training_and_evaluation() -> None:
    found = recipe("pictures")
    assert found.model.ldrm.input == "frames"
    assert all(found.stage(stage).use_ground_truth_frames for stage in STAGES)
    assert [one.name for one in VARIANTS if one.use_ground_truth_frames] == ["pictures"]


def test_parts_of_the_detail_decoder_are_left_out_one_at_a_time() -> None:
    refinement = BASE.model.refinement
    assert recipe("no-comparison").model.refinement == replace(refinement, cost_volume_depths=0)
    assert recipe("no-surroundings").model.refinement == replace(refinement, border_cells=0)


def test_static_stages_are_shared_exactly_where_nothing_in_them_differs() -> None:
    names = [one.name for one in VARIANTS if STATIC not in one.without]
    shared = [name for name in names if is_shared(recipe(name), STATIC, BASE)]
    assert shared == ["full", "no-motion-loss", "no-deformation", "no-motion-stage"]
    assert not is_shared(with_steps(BASE, STATIC, 31), STATIC, BASE)
    assert not is_shared(BASE, DYNAMIC, BASE)


@pytest.mark.parametrize(
    ("change", "shared"),
    [
        (f"stages.{DYNAMIC}.losses.motion.weight=1", True),
        (f"stages.{MOTION}.losses.weight=1", False),
        # The motion stage itself is the same, but not the networks that it starts with.
        (f"stages.{STATIC}.losses.depth=0", False),
        ("model.refinement.cost_volume_depths=0", False),
    ],
)
def test_motion_stages_are_shared_where_the_static_ones_are(change: str, shared: bool) -> None:
    assert is_shared(override(BASE, [change]), MOTION, BASE) is shared


def test_the_full_variant_comes_first_whatever_is_chosen() -> None:
    assert chosen_variants(()) == VARIANTS
    names = [one.name for one in chosen_variants(("pictures", "no-order"))]
    assert names == ["full", "no-order", "pictures"]


def test_unknown_names_are_refused_with_the_known_ones() -> None:
    with pytest.raises(ConfigError, match=r"--only: expected names among full, .*got 'half'"):
        chosen_variants(("half",))


def test_a_recipe_that_cannot_be_changed_says_which_variant() -> None:
    test = recipe_by_name("test")
    stages = (*test.stages, motion_stage(test.stage(STATIC), tracks=32))
    without_detail = reduced(replace(test, stages=stages), STEPS)
    with pytest.raises(ConfigError, match=r"variant pictures: .*refinement decoder"):
        recipe_of(variant("pictures"), without_detail)


def test_no_steps_are_refused() -> None:
    with pytest.raises(ConfigError):
        reduced(recipe_by_name("small"), STEPS | {MOTION: 0})


def test_a_recipe_without_one_of_the_stages_is_refused() -> None:
    with pytest.raises(ConfigError, match="got 'test' without motion; choose another"):
        reduced(recipe_by_name("test"), STEPS)
