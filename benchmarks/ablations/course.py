"""Trains a variant in its folder: OUT/<variant>/{vae, <stage>, model, plan-<stage>.json}.

The autoencoder is a link to the run it was trained in; a static or motion stage that learns the
very same as the full one's is a link to that. Seconds are made equal by steps: a few steps of the
variant and of the full one are timed one after the other, and the full one's steps times the ratio
are the variant's. So learning rates end when the time does. Steps once chosen are kept, for going
on after a stop.
"""

import json
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ablations.clock import StepClock, step_seconds, steps_for, typical_s
from ablations.variants import (
    AUTOENCODER,
    DYNAMIC,
    FULL,
    Variant,
    paid_by,
    recipe_of,
    trained_stages,
    with_steps,
)
from diff4splat.errors import ConfigError
from diff4splat.io.atomic import write_text
from diff4splat.training.latent_statistics import has_statistics
from diff4splat.training.recipe.fingerprint import fingerprint
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.recipe_json import recipe_from_json
from diff4splat.training.train_stage import RECIPE_FILE, StageRequest, train_stage
from diff4splat.training.trainer.gates import read_result
from diff4splat.training.trainer.logs.run_files import RESULT_FILE

WARM_UP, TIMED = 3, 8
"""Steps of a timing: those that do not count, and those that do."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StageCost:
    """What one stage of a variant took."""

    stage: str
    steps: int
    cpu_s: float
    shared: bool
    """Trained once, by the full variant."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lab:
    """What all variants have in common."""

    base: Recipe
    """Of the full variant."""
    autoencoder: Path
    """Stage folder of the trained autoencoder."""
    out: Path
    note: Callable[[str], None]


def train_variant(variant: Variant, lab: Lab) -> tuple[StageCost, ...]:
    """Train what is missing; the full variant must have been trained before any other.

    Raises:
        ConfigError: the folder belongs to another recipe or autoencoder.
        KeyboardInterrupt: somebody asked to stop; the same call goes on.
        Diff4SplatError: whatever training raises.
    """
    recipe, folder, costs = recipe_of(variant, lab.base), lab.out / variant.name, []
    link(lab.autoencoder, folder / AUTOENCODER)
    for stage in trained_stages(recipe):
        shared = variant != FULL and is_shared(recipe, stage, lab.base)
        if shared:
            link(lab.out / FULL.name / stage, folder / stage)
        elif variant != FULL:
            recipe = with_steps(recipe, stage, _planned_steps(recipe, stage, folder, lab))
        if not shared and not is_finished(folder / stage, recipe):
            lab.note(f"{variant.name}: {stage}, {recipe.stage(stage).steps} steps")
            _train(recipe, stage, folder, lab.note)
        seconds = step_seconds(folder / stage)
        costs.append(StageCost(stage=stage, steps=len(seconds), cpu_s=sum(seconds), shared=shared))
    return tuple(costs)


def require_autoencoder(run: Path) -> Path:
    """The folder of a run's autoencoder, which may have been stopped early.

    Raises:
        ConfigError: it never came to a stop.
    """
    folder = run / AUTOENCODER
    if not has_statistics(folder):
        raise ConfigError(
            f"{folder}: expected an autoencoder with statistics of its latents, got none; "
            "train it, or stop it once"
        )
    return folder


def is_shared(recipe: Recipe, stage: str, base: Recipe) -> bool:
    """Whether a variant's static or motion stage learns the very same as the full one's.

    The dynamic stage leaves the model behind, so every variant trains its own.
    """
    return stage != DYNAMIC and _course(recipe, stage) == _course(base, stage)


def is_finished(folder: Path, recipe: Recipe) -> bool:
    """Whether a stage is over, with this very recipe.

    Raises:
        ConfigError: it was begun with another one, or after other stages.
    """
    if (folder / RECIPE_FILE).is_file():
        begun = recipe_from_json((folder / RECIPE_FILE).read_text(encoding="utf-8"))
        if _course(begun, folder.name) != _course(recipe, folder.name):
            raise ConfigError(
                f"{folder}: expected a stage of the same recipe and steps, got another; "
                "choose another --out, or the options it was begun with"
            )
    return (folder / RESULT_FILE).is_file() and read_result(folder).finished


def link(target: Path, place: Path) -> None:
    """Make ``place`` stand for ``target``.

    Raises:
        ConfigError: something else stands there.
    """
    place.parent.mkdir(parents=True, exist_ok=True)
    if not place.is_symlink() and not place.exists():
        place.symlink_to(target.resolve(), target_is_directory=True)
    if place.resolve() != target.resolve():
        raise ConfigError(
            f"{place}: expected a link to {target}, got {place.resolve()}; choose another --out"
        )


def _course(recipe: Recipe, stage: str) -> list[str]:
    """Fingerprints of a stage and those before it: one alone does not say what it builds on."""
    names = trained_stages(recipe)
    return [fingerprint(recipe, name) for name in names[: names.index(stage) + 1]]


def _planned_steps(recipe: Recipe, stage: str, folder: Path, lab: Lab) -> int:
    """Steps that take as long as the full variant's; written down before the first one."""
    file = folder / f"plan-{stage}.json"
    if not file.is_file():
        lab.note(f"{folder}: timing steps of {stage}")
        paid = paid_by(recipe, stage)
        full_s = {name: _timed_s(lab.base, name, lab.out / FULL.name) for name in paid}
        own_s = _timed_s(recipe, stage, folder)
        budget = [(lab.base.stage(name).steps, full_s[name]) for name in paid]
        plan = {"steps": steps_for(own_s, budget), "own_step_s": own_s, "full_step_s": full_s}
        write_text(file, json.dumps(plan, indent=1) + "\n")
    return json.loads(file.read_text(encoding="utf-8"))["steps"]


def _timed_s(recipe: Recipe, stage: str, folder: Path) -> float:
    """Processor seconds of one step at the beginning of a stage, trained elsewhere."""
    count = WARM_UP + TIMED
    recipe = with_steps(recipe, stage, max(count, recipe.stage(stage).steps))
    names = [earlier.name for earlier in recipe.stages]
    with tempfile.TemporaryDirectory() as temporary:
        for name in names[: names.index(stage)]:
            link(folder / name, Path(temporary) / name)
        _train(recipe, stage, Path(temporary), lambda text: None, count)
        return typical_s(step_seconds(Path(temporary) / stage), WARM_UP)


def _train(
    recipe: Recipe, stage: str, folder: Path, note: Callable[[str], None], most: int | None = None
) -> None:
    request = StageRequest(
        recipe=recipe,
        stage=stage,
        folder=folder,
        ignore_gates=True,
        stop_after_steps=most,
        device="cpu",
        phases=StepClock(folder=folder / stage, stage=recipe.stage(stage), note=note),
        note=note,
    )
    if train_stage(request).outcome == "signalled":
        raise KeyboardInterrupt
