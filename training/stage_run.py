"""One stage of a recipe in the folder of its run: check, build, train, hand over.

prerequisites ─ networks ─ stage + samples ─ trainer ─ statistics of latents ─ model folder
"""

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from diff4splat.io.atomic import write_text
from diff4splat.metrics.features.load import load_features
from diff4splat.models.factory import PARTS
from diff4splat.models.hub.pretrained import Model, save_model
from diff4splat.progress.phases import Phases
from diff4splat.training.batches.samples import ClipSamples
from diff4splat.training.latent_statistics import CLIPS, measure_statistics, write_statistics
from diff4splat.training.latents.samples import LatentSamples, open_samples
from diff4splat.training.linear_start import start_from_components
from diff4splat.training.prerequisites import (
    continued_stage,
    last_checkpoint,
    require_prerequisites,
    stages_before,
    starting_networks,
    trained_networks,
)
from diff4splat.training.recipe import Recipe, StageRecipe
from diff4splat.training.recipe_json import fingerprint, recipe_to_json
from diff4splat.training.stages.factory import create_stage
from diff4splat.training.stages.model_stage import StagePlan
from diff4splat.training.trainer.export import load_parts
from diff4splat.training.trainer.gates import read_result
from diff4splat.training.trainer.run import run_stage
from diff4splat.training.trainer.settings import RunSettings, StageResult, silent

MODEL_FOLDER, RECIPE_FILE = "model", "recipe.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class StageRun:
    """What is asked for."""

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


def train_stage(asked: StageRun) -> StageResult:
    """Train until the stage is over or something says stop; call again to go on.

    Raises:
        ConfigError: the stage may not start yet, or settings do not fit together.
        CheckpointError: the folder belongs to another configuration.
        InputError, FileFormatError, OutputError: clips cannot be read, or nothing be written.
    """
    recipe, stage_recipe = asked.recipe, asked.recipe.stage(asked.stage)
    sources = stages_before(recipe, stage_recipe, asked.folder, asked.start)
    require_prerequisites(recipe, sources, asked.folder, asked.ignore_gates)
    samples = open_samples(stage_recipe, recipe.seed)
    networks = starting_networks(recipe, stage_recipe, asked.folder, asked.start)
    plan = StagePlan(
        model=recipe.model,
        recipe=stage_recipe,
        seed=recipe.seed,
        features=load_features(asked.features),
    )
    if "vae" in stage_recipe.trained and networks.vae.code is not None:
        start_from_components(networks.vae, samples, asked.phases)
    stage = create_stage(networks, plan)
    result = run_stage(stage, samples, stage_recipe, _settings(asked, plan))
    if is_first_process():
        _hand_over(asked, stage_recipe, samples)
    return result


def _settings(asked: StageRun, plan: StagePlan) -> RunSettings:
    recipe, folder = asked.recipe, asked.folder / asked.stage
    sources = stages_before(recipe, plan.recipe, asked.folder, asked.start)
    before = continued_stage(recipe, plan.recipe, sources)
    # Gates ignored, the stage before may be unfinished: its averages are all there is to take.
    over = before is not None and read_result(asked.folder / before.name).finished
    return RunSettings(
        folder=folder,
        seed=recipe.seed,
        fingerprint=fingerprint(recipe, asked.stage, plan.features.name),
        trainer=recipe.trainer,
        start_from=asked.folder / before.name if over else None,
        stop_after_steps=asked.stop_after_steps,
        stop_after_s=asked.stop_after_s,
        device=asked.device,
        phases=asked.phases,
        note=asked.note,
        begin=lambda: write_text(folder / RECIPE_FILE, recipe_to_json(recipe)),
    )


def _hand_over(asked: StageRun, stage: StageRecipe, samples: ClipSamples | LatentSamples) -> None:
    """Statistics of the latents if the autoencoder learns here, and a folder for pipelines."""
    if isinstance(samples, ClipSamples) and "vae" in stage.trained:
        _measure_latents(asked, stage, samples)
    networks, trained = trained_networks(asked.recipe, asked.folder, asked.start)
    model = Model(config=asked.recipe.model, networks=networks, trained=trained)
    save_model(model, asked.folder / MODEL_FOLDER)
    missing = ", ".join(part for part in PARTS if part not in trained)
    state = f"not trained to the end: {missing}" if missing else "every part is trained"
    asked.note(f"wrote {asked.folder / MODEL_FOLDER}; {state}")


def _measure_latents(asked: StageRun, stage: StageRecipe, samples: ClipSamples) -> None:
    folder = asked.folder / stage.name
    vae = starting_networks(asked.recipe, stage, asked.folder, asked.start).vae
    vae.load_state_dict(load_parts(last_checkpoint(folder))["vae"])
    with asked.phases.phase("measure latents", CLIPS) as advance:
        write_statistics(measure_statistics(vae, samples, advance), folder)


def is_first_process() -> bool:
    """The one that writes: torchrun numbers its processes; alone, there is no number."""
    return os.environ.get("RANK", "0") == "0"
