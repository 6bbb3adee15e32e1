"""All six stages in one folder, two steps each, on exact clips."""

import json
import math
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
import torch
from clip_shards import reading, write_shards
from safetensors.torch import load_file

from diff4splat.errors import CheckpointError, ConfigError, InputError
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import load_model
from diff4splat.models.video_vae.vae import VideoVae
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.latent_statistics import read_statistics
from diff4splat.training.latents import video_latents
from diff4splat.training.prerequisites import last_checkpoint
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.recipe_json import recipe_from_json
from diff4splat.training.recipe.stage import Gate
from diff4splat.training.train_stage import (
    MODEL_FOLDER,
    RECIPE_FILE,
    StageRequest,
    is_main_process,
    train_stage,
)
from diff4splat.training.trainer.checkpoints.export import load_parts
from diff4splat.training.trainer.loop.evaluation import _means

STAGES = ("vae", "static-low", "static-high", "dynamic", "video_diffusion", "joint")


@dataclass(frozen=True)
class Run:
    """A whole course, and what the model folder said after every stage."""

    recipe: Recipe
    folder: Path
    untrained: tuple[bool, ...]
    trained: tuple[frozenset[str], ...]
    notes: tuple[str, ...]
    vae: tuple[dict[str, torch.Tensor], ...]


@pytest.fixture(scope="module")
def shards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_shards(tmp_path_factory.mktemp("shards"))


@pytest.fixture(scope="module")
def course(shards: Path, tmp_path_factory: pytest.TempPathFactory) -> Run:
    recipe, folder = reading(shards), tmp_path_factory.mktemp("run")
    untrained, trained, notes, vae = [], [], [], []
    for stage in STAGES:
        train_stage(StageRequest(recipe=recipe, stage=stage, folder=folder, note=notes.append))
        model = load_model(folder / MODEL_FOLDER)
        untrained.append(bool(set(model.parts) - model.trained))
        trained.append(model.trained)
        vae.append(load_file(folder / MODEL_FOLDER / "vae.safetensors"))
    return Run(recipe, folder, tuple(untrained), tuple(trained), tuple(notes), tuple(vae))


def stored(course: Run, stage: str, kind: str = "averaged") -> dict[str, dict[str, torch.Tensor]]:
    return load_parts(last_checkpoint(course.folder / stage), kind)


def test_the_model_counts_as_untrained_until_every_part_is_trained(course: Run) -> None:
    assert course.untrained == (True, True, True, True, False, False)
    wrote = [note for note in course.notes if note.startswith("wrote ")]
    assert wrote[0].endswith("text_encoder, dit, ldrm, deformation")
    assert wrote[3].endswith("text_encoder, dit")
    assert all(note.endswith("every part is trained") for note in wrote[4:])


def test_the_model_says_which_parts_are_trained(course: Run) -> None:
    static, generator = {"vae", "ldrm"}, {"dit", "text_encoder"}
    moving = static | {"deformation"}
    everything = moving | generator
    assert course.trained == ({"vae"}, static, static, moving, everything, everything)


def test_later_stages_say_what_they_took_over(course: Run) -> None:
    taken = [note for note in course.notes if "taken over" in note]
    assert taken == [
        "ldrm: taken over from stage static-low",
        "ldrm: taken over from stage static-high",
        "text_encoder, dit: taken over from stage video_diffusion",
    ]


def test_the_frozen_autoencoder_is_the_same_before_and_after(course: Run) -> None:
    for later in course.vae[1:]:
        assert later.keys() == course.vae[0].keys()
        for key, value in later.items():
            assert torch.equal(value, course.vae[0][key]), key
    trained = stored(course, "vae")["vae"]
    for key, value in trained.items():
        assert torch.equal(course.vae[0][key], value) or "latent" in key
    random = create_networks(course.recipe.model).vae.state_dict()
    assert any(not torch.equal(course.vae[0][key], random[key]) for key in random)


def test_averaged_weights_are_handed_on(course: Run) -> None:
    networks = load_model(course.folder / MODEL_FOLDER).networks
    averaged, raw = stored(course, "joint"), stored(course, "joint", "raw")
    for part in ("dit", "ldrm", "deformation"):
        found = getattr(networks, part).state_dict()
        assert all(torch.equal(found[key], value) for key, value in averaged[part].items())
        assert any(not torch.equal(found[key], value) for key, value in raw[part].items())


def test_only_what_a_stage_trains_is_in_its_checkpoints(course: Run) -> None:
    for stage in course.recipe.stages:
        assert set(stored(course, stage.name)) == set(stage.trained)


def test_the_model_folder_loads_and_makes_a_scene(course: Run) -> None:
    from diff4splat.generation.inputs.input_image import InputImage
    from diff4splat.generation.settings import GenerationSettings
    from diff4splat.geometry.camera import pinhole

    pipeline = Diff4SplatPipeline.from_pretrained(course.folder / MODEL_FOLDER)
    side = course.recipe.model.size_px[0]
    image = InputImage(
        rgb=torch.rand(*course.recipe.model.size_px, 3),
        camera=pinhole(float(side), course.recipe.model.size_px),
        focal_source="test",
    )
    scene = pipeline(image, "spiral", "a ball", settings=GenerationSettings(steps=1))
    assert not scene.provenance.untrained
    assert bool(torch.isfinite(scene.gaussians.means).all())


def test_the_model_folder_has_the_statistics_of_the_latents(course: Run) -> None:
    mean, std = read_statistics(course.folder / "vae")
    buffers = dict(load_model(course.folder / MODEL_FOLDER).networks.vae.named_buffers())
    flat = [value.flatten() for value in buffers.values()]
    assert any(torch.equal(value, mean) for value in flat)
    assert any(torch.equal(value, std) for value in flat)


def test_the_recipe_lies_beside_every_stage(course: Run) -> None:
    for stage in STAGES:
        text = (course.folder / stage / RECIPE_FILE).read_text()
        assert recipe_from_json(text) == course.recipe


def test_later_stages_see_standardised_latents(
    course: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[torch.Tensor] = []
    encode = video_latents.encode_video

    def listen(vae: VideoVae, batch: ClipBatch) -> torch.Tensor:
        seen.append(encode(vae, batch))
        return seen[-1]

    monkeypatch.setattr(video_latents, "encode_video", listen)
    for stage in ("vae", "static-low"):
        (tmp_path / stage).symlink_to(course.folder / stage)
    recipe = course.recipe
    longer = replace(recipe.stage("video_diffusion"), steps=4)
    stages = [longer if one.name == longer.name else one for one in recipe.stages]
    recipe = replace(recipe, stages=tuple(stages))
    train_stage(StageRequest(recipe=recipe, stage="video_diffusion", folder=tmp_path))
    latents = torch.cat(seen).transpose(0, 1).flatten(1)
    # Other clips than the sixteen that were measured: near 0 and 1, not exactly.
    assert latents.mean(1).abs().max() < 1.0
    assert 0.4 < float(latents.std(1).mean()) < 2.0


def test_again_changes_nothing(course: Run, tmp_path: Path) -> None:
    shutil.copytree(course.folder, tmp_path / "run")
    run, before = tmp_path / "run", load_file(course.folder / MODEL_FOLDER / "ldrm.safetensors")
    result = train_stage(StageRequest(recipe=course.recipe, stage="static-low", folder=run))
    assert (result.outcome, result.step) == ("finished", 2)
    after = load_file(run / MODEL_FOLDER / "ldrm.safetensors")
    assert all(torch.equal(before[key], after[key]) for key in before)


def gated(recipe: Recipe, stage: str, gate: Gate) -> Recipe:
    stages = [replace(one, gates=(gate,)) if one.name == stage else one for one in recipe.stages]
    return replace(recipe, stages=tuple(stages))


def test_gates_hold_the_next_stage_back(course: Run, tmp_path: Path) -> None:
    (tmp_path / "vae").symlink_to(course.folder / "vae")
    recipe = gated(course.recipe, "vae", Gate(measure="psnr", bound=90.0))
    asked = StageRequest(recipe=recipe, stage="static-low", folder=tmp_path)
    with pytest.raises(ConfigError, match=r"expected psnr at least 90, got .* short; .*--ignore"):
        train_stage(asked)
    assert not (tmp_path / "static-low").exists()
    result = train_stage(replace(asked, ignore_gates=True, stop_after_steps=1))
    assert result.outcome == "step_limit"


def test_means_leave_out_clips_to_which_a_measure_does_not_apply(course: Run) -> None:
    rows = {0: {"psnr": 20.0, "track_share": math.nan}, 1: {"psnr": 24.0, "track_share": 0.5}}
    assert _means([rows]) == {"psnr": 22.0, "track_share": 0.5}
    assert math.isnan(_means([{0: rows[0]}])["track_share"])
    measured = json.loads((course.folder / "dynamic" / "result.json").read_text())["measures"]
    assert set(measured) == {"psnr", "depth_correlation", "track_error", "track_share"}


def test_gates_may_be_ignored_before_the_stage_before_is_over(course: Run, tmp_path: Path) -> None:
    (tmp_path / "vae").symlink_to(course.folder / "vae")
    low = StageRequest(
        recipe=course.recipe, stage="static-low", folder=tmp_path, stop_after_steps=1
    )
    assert train_stage(low).outcome == "step_limit"
    high = replace(low, stage="static-high", ignore_gates=True)
    assert train_stage(high).step == 1
    averaged = load_parts(last_checkpoint(tmp_path / "static-low"))["ldrm"]
    first = load_parts(last_checkpoint(tmp_path / "static-high"), "raw")["ldrm"]
    gap = max(float((first[key] - value).abs().max()) for key, value in averaged.items())
    assert 0 < gap < 0.02  # one step away from what was handed on, not from random weights


def test_another_configuration_leaves_the_folder_as_it_was(course: Run, tmp_path: Path) -> None:
    shutil.copytree(course.folder / "vae", tmp_path / "vae")
    before = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    other = replace(course.recipe, seed=course.recipe.seed + 1)
    with pytest.raises(CheckpointError, match="expected a checkpoint of stage vae with finger"):
        train_stage(StageRequest(recipe=other, stage="vae", folder=tmp_path))
    after = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    assert {file.name for file in after} - {file.name for file in before} <= {
        file.name for file in after if "tfevents" in file.name
    }
    assert all(after[file] == content for file, content in before.items())


def test_a_source_that_is_broken_leaves_no_folder(course: Run, tmp_path: Path) -> None:
    recipe = reading(write_shards(tmp_path / "shards", still=0, moving=2), still_share=1.0)
    with pytest.raises(InputError, match="expected still clips"):
        train_stage(StageRequest(recipe=recipe, stage="vae", folder=tmp_path / "run"))
    assert not (tmp_path / "run").exists()


def test_only_the_first_process_hands_over(monkeypatch: pytest.MonkeyPatch) -> None:
    assert is_main_process()
    monkeypatch.setenv("RANK", "1")
    assert not is_main_process()


def test_weights_that_are_not_fully_trained_are_named(course: Run, tmp_path: Path) -> None:
    folder = tmp_path / "model"
    shutil.copytree(course.folder / MODEL_FOLDER, folder)
    file = folder / "provenance.json"
    known = json.loads(file.read_text())
    known["trained"] = [part for part in known["trained"] if part != "vae"]
    file.write_text(json.dumps(known))
    notes: list[str] = []
    asked = StageRequest(
        recipe=course.recipe,
        stage="vae",
        folder=tmp_path / "run",
        start=load_model(folder, parts=()),
        stop_after_steps=1,
        note=notes.append,
    )
    train_stage(asked)
    message = f"vae starts from random weights: those in {folder} are not fully trained"
    assert notes.count(message) == 1
    train_stage(asked)
    assert notes.count(message) == 1
