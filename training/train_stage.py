"""One stage of a recipe in the folder of its run: check, build, train, hand over.

prerequisites ─ networks ─ stage + samples ─ trainer ─ statistics of latents ─ model folder
"""

import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from diff4splat.io.atomic import write_text
from diff4splat.metrics.features.load import load_features
from diff4splat.models.adapters.adapter_file import write_adapter
from diff4splat.models.hub.model import Model, save_model
from diff4splat.models.hub.weight_files import part_file
from diff4splat.models.networks import Networks, model_parts
from diff4splat.models.wan.tokenizer import TOKENIZER_FILE
from diff4splat.progress.phases import Phases
from diff4splat.training.backbone_init import start_from_public_backbones
from diff4splat.training.batches.samples import ClipSamples
from diff4splat.training.batches.sources import unused_sources
from diff4splat.training.earlier_release import earlier_fingerprint
from diff4splat.training.latent_statistics import CLIPS, measure_statistics, write_statistics
from diff4splat.training.latents.samples import LatentSamples, open_samples
from diff4splat.training.pca_init import init_from_principal_components
from diff4splat.training.prerequisites import (
    continued_stage,
    kept_parts,
    last_checkpoint,
    parts_left_random,
    require_prerequisites,
    sharded_networks,
    stages_before,
    starting_networks,
    trained_networks,
)
from diff4splat.training.recipe.fingerprint import fingerprint
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.recipe_json import recipe_to_json
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.stage import Stage
from diff4splat.training.stages.factory import create_stage
from diff4splat.training.stages.model_stage import StagePlan
from diff4splat.training.trainer.checkpoints.export import load_parts
from diff4splat.training.trainer.gates import read_result
from diff4splat.training.trainer.loop.fit import fit_stage
from diff4splat.training.trainer.settings import RunSettings, StageResult, silent

MODEL_FOLDER, RECIPE_FILE, ADAPTER_FOLDER = "model", "recipe.json", "adapter"


@dataclass(frozen=True, slots=True, kw_only=True)
class StageRequest:
    """One call of ``train_stage``."""

    recipe: Recipe
    stage: str
    folder: Path
    """Of the whole run; each stage has a folder in it."""
    features: str | None = None
    """Weights of the perceptual distance; None is the stand-in."""
    ignore_gates: bool = False
    start: Model | None = None
    """Has the parts that no stage of this run has trained."""
    stop_after_steps: int | None = None
    stop_after_s: float | None = None
    device: str | None = None
    phases: Phases = field(default_factory=Phases)
    note: Callable[[str], None] = silent


def train_stage(request: StageRequest) -> StageResult:
    """Train until the stage is over or something says stop; call again to go on.

    Raises:
        ConfigError: the stage may not start yet, or settings do not fit together.
        CheckpointError: the folder belongs to another configuration.
        InputError, FileFormatError, OutputError: clips cannot be read, or nothing be written.
    """
    recipe, stage_recipe = request.recipe, request.recipe.stage(request.stage)
    sources = stages_before(recipe, stage_recipe, request.folder, request.start)
    require_prerequisites(recipe, sources, request.folder, request.ignore_gates)
    if is_main_process():
        _note_start(request, stage_recipe)
    samples = open_samples(stage_recipe, recipe.seed)
    networks, fill = _networks(request, stage_recipe)
    plan = StagePlan(
        model=recipe.model,
        recipe=stage_recipe,
        seed=recipe.seed,
        features=load_features(request.features),
        defer_renders=recipe.trainer.defer_renders,
    )
    if _starts_from_components(recipe, stage_recipe):
        init_from_principal_components(networks.vae, samples, request.phases)
    if stage_recipe.public_backbone:
        # As above, a run that is taken up again computes what it then overwrites.
        ready = sources.keys() | (frozenset() if request.start is None else request.start.trained)
        fresh = [part for part in stage_recipe.trained if part not in ready]
        start_from_public_backbones(networks, fresh)
    stage = create_stage(networks, plan)
    settings = replace(_settings(request, plan), fill=fill)
    result = fit_stage(stage, samples, stage_recipe, settings)
    if is_main_process():
        _hand_over(request, stage_recipe, samples)
    return result


def _note_start(request: StageRequest, stage: StageRecipe) -> None:
    """What a user might not expect of the recipe and of the first weights."""
    recipe, start = request.recipe, request.start
    if recipe.removed_stages:
        removed = ", ".join(recipe.removed_stages)
        request.note(f"stages {removed} are left out: their kinds no longer exist")
    if (request.folder / stage.name / RECIPE_FILE).exists():
        return
    for line in unused_sources(stage.data):
        request.note(line)
    sources = stages_before(recipe, stage, request.folder, start)
    for part in parts_left_random(stage, sources, start):
        request.note(
            f"{part} starts from random weights: those in {start.folder} are not fully trained"
        )


def _networks(
    request: StageRequest, stage: StageRecipe
) -> tuple[Networks, Callable[[Stage], None] | None]:
    """Networks to begin with; where weights are sharded, without values until they are."""
    recipe = request.recipe
    changed = _starts_from_components(recipe, stage) or stage.public_backbone
    if recipe.trainer.parallel != "fsdp2" or changed:
        return starting_networks(recipe, stage, request.folder, request.start), None
    networks, weights = sharded_networks(recipe, stage, request.folder, request.start)
    return networks, weights.fill


def _starts_from_components(recipe: Recipe, stage: StageRecipe) -> bool:
    return "vae" in stage.trained and recipe.model.vae.pca_shortcut


def _settings(request: StageRequest, plan: StagePlan) -> RunSettings:
    recipe, folder = request.recipe, request.folder / request.stage
    sources = stages_before(recipe, plan.recipe, request.folder, request.start)
    before = continued_stage(recipe, plan.recipe, sources)
    # Gates ignored, the stage before may be unfinished: its averages are all there is to take.
    over = before is not None and read_result(request.folder / before.name).finished
    file, features = folder / RECIPE_FILE, plan.features.name
    earlier = earlier_fingerprint(recipe, request.stage, file, features)
    return RunSettings(
        folder=folder,
        seed=recipe.seed,
        fingerprint=fingerprint(recipe, request.stage, features),
        earlier_fingerprint=earlier,
        trainer=recipe.trainer,
        start_from=request.folder / before.name if over else None,
        stop_after_steps=request.stop_after_steps,
        stop_after_s=request.stop_after_s,
        device=request.device,
        phases=request.phases,
        note=request.note,
        begin=lambda: _write_recipe(recipe, file, keep=earlier is not None),
    )


def _write_recipe(recipe: Recipe, file: Path, keep: bool) -> None:
    """An earlier release's file of the same recipe is kept: its checkpoints need it."""
    if not keep:
        write_text(file, recipe_to_json(recipe))


def _hand_over(
    request: StageRequest, stage: StageRecipe, samples: ClipSamples | LatentSamples
) -> None:
    """Statistics of the latents if the autoencoder learns here, and a folder for pipelines."""
    if isinstance(samples, ClipSamples) and "vae" in stage.trained:
        _measure_latents(request, stage, samples)
    networks, trained = trained_networks(request.recipe, request.folder, request.start)
    model = Model(config=request.recipe.model, networks=networks, trained=trained)
    save_model(model, request.folder / MODEL_FOLDER, _kept_files(request))
    if stage.tuning != "full" and "dit" in stage.trained:
        _write_adapter(request, stage)
    missing = ", ".join(part for part in model_parts(request.recipe.model) if part not in trained)
    state = f"not trained to the end: {missing}" if missing else "every part is trained"
    request.note(f"wrote {request.folder / MODEL_FOLDER}; {state}")


def _write_adapter(request: StageRequest, stage: StageRecipe) -> None:
    """What the video model learnt beside its own weights, averaged, for ``generate --lora``."""
    folder = request.folder / stage.name
    file = write_adapter(load_parts(last_checkpoint(folder))["dit"], folder / ADAPTER_FOLDER)
    request.note(f"wrote {file}")


def _kept_files(request: StageRequest) -> dict[str, Path]:
    """Files of public weights, and of the vocabulary that belongs to them."""
    start = request.start
    kept = kept_parts(request.recipe, request.folder, start)
    names = [part_file(Path(), part).name for part in sorted(kept)]
    if "text_encoder" in kept:
        names.append(TOKENIZER_FILE)
    return {name: start.folder / name for name in names}


def _measure_latents(request: StageRequest, stage: StageRecipe, samples: ClipSamples) -> None:
    folder = request.folder / stage.name
    vae = starting_networks(request.recipe, stage, request.folder, request.start).vae
    vae.load_state_dict(load_parts(last_checkpoint(folder))["vae"])
    with request.phases.phase("measure latents", CLIPS) as advance:
        write_statistics(measure_statistics(vae, samples, advance), folder)


def is_main_process() -> bool:
    """The one that writes: torchrun numbers its processes; alone, there is no number."""
    return os.environ.get("RANK", "0") == "0"
