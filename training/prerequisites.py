"""Which earlier stages a stage builds on, and the networks it starts with.

    RUN/<stage>/{recipe.json, checkpoints, result.json, log.jsonl, panels}
    RUN/model/ (for pipelines)

A part comes from the last earlier stage that trained it, with averaged weights. The parts that the
stage goes on training from the latest such stage are then taken over by the trainer with raw
weights beside their averages; older ones go on from their averages. Parts nobody trained yet come
from the model that the run starts from, where they are trained, and are random otherwise.
"""

from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

import torch
from torch import Tensor, nn

from diff4splat.errors import CheckpointError, ConfigError, FileFormatError
from diff4splat.models.adapters.lora import merged
from diff4splat.models.factory import create_networks, plan_networks
from diff4splat.models.hub.mapped_weights import mapped_parts
from diff4splat.models.hub.model import Model, with_parts
from diff4splat.models.hub.weight_files import is_version_1, part_file
from diff4splat.models.networks import PARTS, Networks
from diff4splat.training.latent_statistics import has_statistics, read_statistics
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.stages.factory import STAGES
from diff4splat.training.starting_weights import StartingWeights
from diff4splat.training.trainer.checkpoints.export import load_parts
from diff4splat.training.trainer.checkpoints.files import read_checkpoint
from diff4splat.training.trainer.distributed.processes import Processes
from diff4splat.training.trainer.gates import read_result, stage_may_start
from diff4splat.training.trainer.logs.run_files import CHECKPOINTS, RESULT_FILE


def sources_of_parts(recipe: Recipe, stage: StageRecipe) -> dict[str, StageRecipe]:
    """For each part the stage runs, the last stage before it that trains the part."""
    before = recipe.stages[: recipe.stages.index(stage)]
    return {
        part: earlier
        for earlier in before
        for part in earlier.trained
        if part in STAGES[stage.kind].needed(recipe.model)
    }


def stages_before(
    recipe: Recipe, stage: StageRecipe, folder: Path, start: Model | None = None
) -> dict[str, StageRecipe]:
    """``sources_of_parts`` without parts that come from ``start`` because no stage was begun."""
    ready = frozenset() if start is None else start.trained
    return {
        part: earlier
        for part, earlier in sources_of_parts(recipe, stage).items()
        if part not in ready or _has_weights(earlier, folder / earlier.name)
    }


def parts_left_random(
    stage: StageRecipe, sources: Mapping[str, StageRecipe], start: Model | None
) -> list[str]:
    """Parts whose weights in ``start`` are not used, because they are not trained to the end."""
    if start is None or start.folder is None:
        return []
    unready = [part for part in stage.trained if part not in start.trained and part not in sources]
    return [part for part in unready if part_file(start.folder, part).is_file()]


def require_prerequisites(
    recipe: Recipe, sources: Mapping[str, StageRecipe], folder: Path, ignore_gates: bool
) -> None:
    """All stages that one builds on, its ``stages_before``, are over and good enough.

    Raises:
        ConfigError: one is not; says which measure is short by how much.
    """
    for earlier in _in_order(recipe, sources):
        stage_may_start(earlier, folder / earlier.name, ignore_gates)


def continued_stage(
    recipe: Recipe, stage: StageRecipe, sources: Mapping[str, StageRecipe]
) -> StageRecipe | None:
    """The last of ``sources`` that trained something the stage goes on training."""
    learnt = {part: sources[part] for part in stage.trained if part in sources}
    return (_in_order(recipe, learnt) or [None])[-1]


def starting_networks(
    recipe: Recipe, stage: StageRecipe, folder: Path, start: Model | None = None
) -> Networks:
    """Random networks, with the averaged weights of every part that was trained before.

    Parts that the stage does not run are not built: in the ``paper`` recipe they would not fit.

    Raises:
        CheckpointError, FileFormatError: a checkpoint is missing, damaged or of other networks.
    """
    needed = STAGES[stage.kind].needed(recipe.model)
    return _started(recipe, stage, folder, start, frozenset(needed))


def sharded_networks(
    recipe: Recipe, stage: StageRecipe, folder: Path, start: Model | None = None
) -> tuple[Networks, StartingWeights]:
    """The same with trained parts on the meta device, and where their weights come from.

    Raises:
        CheckpointError, FileFormatError, ConfigError: as ``starting_networks``, or weights that
            cannot be shared out.
    """
    needed = frozenset(STAGES[stage.kind].needed(recipe.model))
    trained = needed.intersection(stage.trained)
    frozen = _started(recipe, stage, folder, start, needed - trained)
    planned, initial = plan_networks(recipe.model, trained, seed=recipe.seed)
    before = stages_before(recipe, stage, folder, start)
    earlier = {part: folder / before[part].name for part in trained if part in before}
    weights = StartingWeights(
        seed=recipe.seed,
        initial=initial,
        files=_weight_files(start, trained),
        checkpoints={part: last_checkpoint(place) for part, place in earlier.items()},
        vae_statistics=earlier.get("vae"),
    )
    return replace(frozen, **dict(planned.parts())), weights


def _started(
    recipe: Recipe, stage: StageRecipe, folder: Path, start: Model | None, parts: frozenset[str]
) -> Networks:
    """Some of the parts that the stage runs, whole; those with public weights stay mapped."""
    mapped = kept_parts(recipe, folder, start).intersection(parts) - set(stage.trained)
    made = parts - mapped
    networks = create_networks(recipe.model, seed=recipe.seed, parts=made)
    _take(networks, start, made)
    before = stages_before(recipe, stage, folder, start)
    networks = _filled(networks, {part: before[part] for part in before if part in made}, folder)
    if not mapped:
        return networks
    loaded = with_parts(start, mapped).networks
    return replace(networks, **{part: getattr(loaded, part) for part in mapped})


def _weight_files(start: Model | None, parts: Collection[str]) -> dict[str, Path]:
    if start is None or start.folder is None:
        return {}
    ready = start.trained.intersection(parts)
    if ready and is_version_1(start.folder):
        raise ConfigError(
            f"{start.folder}: expected a model folder of this release for sharded weights, got an "
            "older one; write it anew with diff4splat pack"
        )
    return {part: part_file(start.folder, part) for part in ready}


def trained_networks(
    recipe: Recipe, folder: Path, start: Model | None = None
) -> tuple[Networks, frozenset[str]]:
    """Networks with the newest averaged weights of all stages begun, and the parts that are done.

    Those of ``kept_parts`` are not built.

    Raises:
        CheckpointError, FileFormatError: as ``starting_networks``.
    """
    begun = [stage for stage in recipe.stages if _has_weights(stage, folder / stage.name)]
    finished = [stage for stage in begun if read_result(folder / stage.name).finished]
    sources = {part: stage for stage in begun for part in stage.trained}
    kept = kept_parts(recipe, folder, start)
    networks = create_networks(recipe.model, seed=recipe.seed, parts=set(PARTS) - kept)
    _take(networks, start, set(PARTS) - kept)
    done = frozenset(part for stage in finished for part in stage.trained)
    present = kept.union(dict(networks.parts()))
    ready = frozenset() if start is None else start.trained & present
    return _filled(networks, sources, folder), done | (ready - sources.keys())


def kept_parts(recipe: Recipe, folder: Path, start: Model | None) -> frozenset[str]:
    """Parts with public weights that no stage has trained: they stay mapped in their files."""
    if start is None or start.folder is None:
        return frozenset()
    begun = [stage for stage in recipe.stages if _has_weights(stage, folder / stage.name)]
    learnt = {part for stage in begun for part in stage.trained}
    return (mapped_parts(recipe.model) & start.trained) - learnt


def _take(networks: Networks, start: Model | None, parts: Collection[str]) -> None:
    """What ``start`` has trained of these parts."""
    if start is None:
        return
    start = with_parts(start, start.trained.intersection(parts))
    for part, network in networks.parts():
        if part in start.trained and part in parts:
            stored = getattr(start.networks, part).state_dict()
            _fill(network, stored, f"{start.folder}: {part}")


def _has_weights(stage: StageRecipe, place: Path) -> bool:
    """Whether a stage came so far that others can use what it has learnt.

    An autoencoder that learns beside another stage has no statistics yet.
    """
    usable = "vae" not in stage.trained or has_statistics(place)
    return usable and (place / RESULT_FILE).is_file()


def _filled(networks: Networks, sources: Mapping[str, StageRecipe], folder: Path) -> Networks:
    for earlier in dict.fromkeys(sources.values()):
        place = folder / earlier.name
        stored = load_parts(last_checkpoint(place))
        for part in (part for part, source in sources.items() if source == earlier):
            weights = merged(stored.get(part, {}))
            _fill(getattr(networks, part), weights, f"{place}: {part}")
            if part == "vae":
                networks.vae.set_statistics(*read_statistics(place))
    return networks


def _fill(network: nn.Module, stored: Mapping[str, Tensor], what: str) -> None:
    wanted = {key: value.shape for key, value in network.state_dict().items()}
    if wanted != {key: value.shape for key, value in stored.items()}:
        raise CheckpointError(
            f"{what}: expected the weights of the recipe's model, got others; "
            "go on with the recipe that the run began with"
        )
    network.load_state_dict(stored)


def last_checkpoint(folder: Path) -> Path:
    """The checkpoint that a stage's result speaks of, every byte compared with its digest.

    Raises:
        ConfigError: the stage was never begun there.
        FileFormatError: the checkpoint is missing or damaged.
    """
    checkpoint = folder / CHECKPOINTS / read_result(folder).checkpoint
    try:
        read_checkpoint(checkpoint, Processes(rank=0, count=1, device=torch.device("cpu")))
    except FileFormatError as error:
        raise FileFormatError(
            f"{error}; run stage {folder.name} again: it goes on from the checkpoint before"
        ) from error
    return checkpoint


def _in_order(recipe: Recipe, sources: dict[str, StageRecipe]) -> list[StageRecipe]:
    return [stage for stage in recipe.stages if stage in sources.values()]
