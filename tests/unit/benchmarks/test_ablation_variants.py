"""What each variant changes in the recipe, and nothing else."""

from dataclasses import replace

import pytest
from ablations.course import is_shared
from ablations.variants import (
    DYNAMIC,
    FULL,
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
from diff4splat.errors import ConfigError
from diff4splat.training.prerequisites import sources_of_parts
from diff4splat.training.recipe import Recipe

BASE = reduced(recipe_by_name("small"), 30, 50)


def variant(name: str) -> Variant:
    return next(one for one in VARIANTS if one.name == name)


def recipe(name: str) -> Recipe:
    return recipe_of(variant(name), BASE)


def losses(name: str, key: str) -> list[float]:
    return [getattr(recipe(name).stage(stage).losses, key) for stage in (STATIC, DYNAMIC)]


def test_both_stages_are_short_small_and_sampled_in_the_training_process() -> None:
    static, dynamic = BASE.stage(STATIC), BASE.stage(DYNAMIC)
    assert [stage.name for stage in BASE.stages] == ["vae", STATIC, DYNAMIC]
    assert (static.steps, dynamic.steps) == (30, 50)
    assert static.data.size_px == dynamic.data.size_px == (64, 64)
    assert static.data.workers == dynamic.data.workers == 0
    assert (static.optimizer.warmup_steps, dynamic.optimizer.warmup_steps) == (3, 5)
    assert BASE.trainer.evaluation_samples == 0


def test_stages_build_on_the_autoencoder_and_on_each_other_alone() -> None:
    sources = sources_of_parts(BASE, BASE.stage(DYNAMIC))
    assert {part: stage.name for part, stage in sources.items()} == {"vae": "vae", "ldrm": STATIC}


def test_the_full_variant_is_the_base() -> None:
    assert recipe_of(FULL, BASE) == BASE


def test_without_motion_loss_only_that_weight_differs() -> None:
    dynamic = recipe("no-motion-loss").stage(DYNAMIC)
    assert dynamic.losses.motion == 0
    assert replace(dynamic, losses=BASE.stage(DYNAMIC).losses) == BASE.stage(DYNAMIC)


def test_without_deformation_the_static_kind_goes_on_with_the_data_of_the_dynamic_one() -> None:
    found, full = recipe("no-deformation").stage(DYNAMIC), BASE.stage(DYNAMIC)
    assert (found.kind, found.trained) == ("static", ("ldrm",))
    assert (found.data, found.steps, found.name) == (full.data, full.steps, full.name)


def test_depth_losses_go_in_both_stages() -> None:
    assert losses("no-depth-correlation", "depth") == [0, 0]
    assert losses("no-depth-correlation", "depth_log") == losses("full", "depth_log") == [0.5, 0.5]
    assert losses("no-depth-loss", "depth") == losses("no-depth-loss", "depth_log") == [0, 0]


def test_without_order_one_stage_starts_from_nothing_in_the_time_of_both() -> None:
    found = recipe("no-order")
    stage, static = found.stage(DYNAMIC), BASE.stage(STATIC)
    assert trained_stages(found) == (DYNAMIC,)
    assert (stage.steps, stage.kind, stage.optimizer.warmup_steps) == (80, "dynamic", 8)
    assert stage.optimizer.learning_rate == static.optimizer.learning_rate
    assert stage.data == BASE.stage(DYNAMIC).data
    assert paid_by(found, DYNAMIC) == (STATIC, DYNAMIC)
    assert paid_by(BASE, DYNAMIC) == (DYNAMIC,)


def test_pictures_are_true_in_training_and_judging() -> None:
    found = recipe("pictures")
    assert found.model.ldrm.reads == "frames"
    assert all(found.stage(stage).true_pictures for stage in (STATIC, DYNAMIC))
    assert [one.name for one in VARIANTS if one.true_pictures] == ["pictures"]


def test_parts_of_the_detail_decoder_are_left_out_one_at_a_time() -> None:
    detail = BASE.model.detail
    assert recipe("no-comparison").model.detail == replace(detail, depths=0)
    assert recipe("no-surroundings").model.detail == replace(detail, surroundings=0)


def test_static_stages_are_shared_exactly_where_nothing_in_them_differs() -> None:
    shared = [one.name for one in VARIANTS if one.ordered]
    shared = [name for name in shared if is_shared(recipe(name), STATIC, BASE)]
    assert shared == ["full", "no-motion-loss", "no-deformation"]
    assert not is_shared(with_steps(BASE, STATIC, 31), STATIC, BASE)
    assert not is_shared(BASE, DYNAMIC, BASE)


def test_the_full_variant_comes_first_whatever_is_chosen() -> None:
    assert chosen_variants(()) == VARIANTS
    names = [one.name for one in chosen_variants(("pictures", "no-order"))]
    assert names == ["full", "no-order", "pictures"]


def test_unknown_names_are_refused_with_the_known_ones() -> None:
    with pytest.raises(ConfigError, match=r"--only: expected names among full, .*got 'half'"):
        chosen_variants(("half",))


def test_a_recipe_that_cannot_be_changed_says_which_variant() -> None:
    without_detail = reduced(recipe_by_name("test"), 3, 3)
    with pytest.raises(ConfigError, match=r"variant pictures: .*detail decoder"):
        recipe_of(variant("pictures"), without_detail)


def test_no_steps_are_refused() -> None:
    with pytest.raises(ConfigError):
        reduced(recipe_by_name("small"), 0, 10)
