"""Recipes on disk and from the command line."""

import json
from dataclasses import replace

import pytest

from diff4splat.configs.recipes import RECIPES, recipe_by_name
from diff4splat.errors import ConfigError
from diff4splat.training.recipe.fingerprint import fingerprint, fingerprint_of
from diff4splat.training.recipe.overrides import override
from diff4splat.training.recipe.recipe_json import recipe_from_json, recipe_to_dict, recipe_to_json


@pytest.mark.parametrize("name", RECIPES)
def test_every_recipe_survives_its_json(name: str) -> None:
    recipe = recipe_by_name(name)
    assert recipe_from_json(recipe_to_json(recipe)) == recipe


@pytest.mark.parametrize("name", RECIPES)
def test_every_recipe_keeps_the_order_of_stages(name: str) -> None:
    names = [stage.name for stage in recipe_by_name(name).stages]
    # Small has one size, so one static stage. The motion network and the object mask read the
    # text encoder that the stage before them trains.
    small = ["monocular_depth", "posed_video_pretrain", "static-low", "motion", "dynamic"]
    is_small = name in ("small", "distil")
    middle = small if is_small else ["static-low", "static-high", "dynamic"]
    small_last = ["motion_diffusion", "object_mask", "image_classifier", "object_shadow"]
    last = small_last if is_small else ["joint"]
    last += ["video_distillation"] if name == "distil" else []
    assert names == ["vae", *middle, "video_diffusion", *last]


def test_the_paper_recipe_is_the_papers() -> None:
    recipe = recipe_by_name("paper")
    low, high, dynamic = (recipe.stage(n) for n in ("static-low", "static-high", "dynamic"))
    assert (low.steps, high.steps, dynamic.steps) == (40_000, 40_000, 20_000)
    assert (low.data.size_px, high.data.size_px) == ((256, 256), (512, 512))
    assert (low.optimizer.learning_rate, low.optimizer.weight_decay) == (1e-5, 1e-4)
    weights, motion = dynamic.losses.reconstruction, dynamic.losses.motion
    assert (weights.photometric, weights.perceptual) == (1.0, 0.5)
    assert (weights.depth, motion.weight, motion.distance) == (0.5, 2.0, 2.0)
    assert "deformation" not in low.trained + high.trained
    assert recipe.trainer.precision == "bfloat16"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("stages.vae", "expected key=value, got 'stages.vae'"),
        (
            "nothing=1",
            "expected one of model, name, removed_stages, seed, stages, trainer, got 'nothing'",
        ),
        ("stages.first.steps=1", "expected one of vae, static-low, .* got 'first'"),
        ("stages.vae.lr=1", "got 'lr'"),
        ("stages.vae.steps=many", "steps: expected int, got 'many'"),
        ("stages.vae.steps=true", "steps: expected int, got True"),
        ("stages.vae.steps=0", "expected steps above 0"),
        ("stages.vae.data.size_px=[1]", "expected 2 values, got"),
        ("stages.vae.data.sources=3", "expected a list, got 3"),
        ("stages.vae.steps.more=1", "expected one of no keys below it, got 'more'"),
        ("trainer.precision=half", "expected one of float32, bfloat16, got 'half'"),
        ("model.ldrm.width=7", "LdrmConfig.heads"),
    ],
)
def test_changes_that_cannot_be_meant_are_refused(change: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        override(recipe_by_name("test"), [change])


def test_changes_reach_their_field() -> None:
    recipe = override(
        recipe_by_name("test"),
        ["stages.vae.steps=7", "trainer.parallel=ddp", "seed=3", "stages.vae.losses.kl=0"],
    )
    vae = recipe.stage("vae")
    assert (vae.steps, vae.losses.kl, recipe.seed) == (7, 0.0, 3)
    assert recipe.trainer.parallel == "ddp"


@pytest.mark.parametrize("text", ["", "[]", "{", "[" * 100_000, '{"name": 1}'])
def test_other_json_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="recipe"):
        recipe_from_json(text)


def test_unknown_and_missing_keys_are_named() -> None:
    data = json.loads(recipe_to_json(recipe_by_name("test")))
    with pytest.raises(ConfigError, match=r"expected the keys .* got 'extra'"):
        recipe_from_json(json.dumps(data | {"extra": 1}))
    del data["seed"]
    with pytest.raises(ConfigError, match="expected the key 'seed', got none"):
        recipe_from_json(json.dumps(data))


def test_the_fingerprint_follows_what_decides_the_weights_of_its_stage() -> None:
    recipe = recipe_by_name("test")
    before = fingerprint(recipe, "vae")
    for same in (
        "trainer.precision=bfloat16",
        "stages.dynamic.steps=3",
        "stages.vae.micro_batch=2",
        "stages.vae.data.workers=2",
        "stages.vae.data.in_memory=true",
        "trainer.compile=true",
    ):
        assert fingerprint(override(recipe, [same]), "vae") == before
    for other in ("stages.vae.steps=3", "seed=1", "model.vae.latent_channels=5"):
        assert fingerprint(override(recipe, [other]), "vae") != before


def test_runs_from_before_single_events_go_on() -> None:
    recipe, name = recipe_by_name("small"), "motion_diffusion"
    data = recipe_to_dict(recipe)
    (stage,) = (one for one in data["stages"] if one["name"] == name)
    assert stage["data"].pop("single_event_share") == 0
    assert fingerprint_of(data, name, "") == fingerprint(recipe, name)
    share = f"stages.{name}.data.single_event_share=0.5"
    assert fingerprint(override(recipe, [share]), name) != fingerprint(recipe, name)


@pytest.mark.parametrize("name", ["monocular_depth", "object_mask"])
def test_runs_from_before_sizes_of_the_backbone_go_on(name: str) -> None:
    recipe = recipe_by_name("small")
    size = f"model.{name}.backbone_size="
    first, larger = (override(recipe, [f"{size}{one}"]) for one in ("lite0", "lite2"))
    data = recipe_to_dict(first)
    del data["model"][name]["backbone_size"]
    assert fingerprint_of(data, name, "") == fingerprint(first, name)
    assert fingerprint(larger, name) != fingerprint(first, name)


def test_stages_that_do_not_exist_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"--stage: expected one of vae, .* got 'last'"):
        recipe_by_name("small").stage("last")
    with pytest.raises(ConfigError, match="--config: expected one of test, small, paper"):
        recipe_by_name("large")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("stages.vae.data.crop_px=[64,0]", r"data.crop_px: expected 0, or sides that size_px"),
        ("stages.vae.data.crop_px=[64,256]", r"data.crop_px: expected .* got \(64, 256\)"),
        ("stages.vae.data.input_stride=0", "data.input_stride: expected at least 1, got 0"),
        (
            "stages.posed_video_pretrain.use_ground_truth_frames=false",
            "stage posed_video_pretrain: expected a refinement decoder",
        ),
        (
            "stages.video_diffusion.data.augment=true",
            "data.augment: expected false",
        ),
        (
            "stages.dynamic.data.keyframe_stride=1",
            "dynamic: .* expected 4 with a refinement",
        ),
        (
            "model.refinement.channels=0 model.refinement.depth_prior=false",
            "stage posed_video_pretrain: expected a refinement decoder",
        ),
        (
            "stages.monocular_depth.data.view_sides_px=[64,80]",
            r"data.view_sides_px or size_px: expected multiples of 32 .*\(64, 80\)",
        ),
        (
            "stages.monocular_depth.data.size_px=[64,72]",
            r"data.view_sides_px or size_px: expected multiples of 32 .*\(64, 72\)",
        ),
    ],
)
def test_stages_require_data_and_networks_that_fit(change: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        override(recipe_by_name("small"), change.split())


def test_clips_reach_from_the_first_input_frame_to_the_last() -> None:
    data = recipe_by_name("small").stage("dynamic").data
    assert (data.frames, data.input_stride, data.clip_frames) == (9, 2, 17)


@pytest.mark.parametrize("name", ["motion_diffusion", "object_mask"])
def test_only_stages_of_single_images_may_read_keyframes_alone(name: str) -> None:
    branch = recipe_by_name("small").stage(name)
    data = replace(branch.data, keyframes_only=True)
    assert (data.clip_frames, data.keyframe_spacing) == (3, 8)
    assert replace(branch, data=data).data.keyframes_only
    with pytest.raises(ConfigError, match=r"dynamic: data\.keyframes_only: expected false but"):
        override(recipe_by_name("small"), ["stages.dynamic.data.keyframes_only=true"])


@pytest.mark.parametrize("name", ["video_diffusion", "motion_diffusion"])
def test_stages_that_read_motion_have_tracks(name: str) -> None:
    assert recipe_by_name("small").stage(name).data.tracks > 0


def test_a_global_batch_is_made_of_micro_batches() -> None:
    with pytest.raises(ConfigError, match=r"stage vae: expected .* got 100, 3 and 2"):
        replace(recipe_by_name("test").stage("vae"), global_batch=3, micro_batch=2)
