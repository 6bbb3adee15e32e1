"""Everything a stage in training consists of, put together, saved and taken up again."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import torch

from diff4splat.errors import CheckpointError
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.stage import Stage
from diff4splat.training.trainer.checkpoints.files import Checkpoint, candidates, read_checkpoint
from diff4splat.training.trainer.checkpoints.state_dict import (
    frozen_tensors,
    run_tensors,
    take_over,
)
from diff4splat.training.trainer.checkpoints.store import CheckpointStore
from diff4splat.training.trainer.checkpoints.tensor_store import read_tensors
from diff4splat.training.trainer.distributed.parallel import (
    ParallelStage,
    parallelise,
    trained_parameters,
)
from diff4splat.training.trainer.distributed.processes import Processes
from diff4splat.training.trainer.loading.loader import Loaded, batches
from diff4splat.training.trainer.loading.sampler import BatchPlan, StepRange, plan_batches
from diff4splat.training.trainer.loading.samples import Samples
from diff4splat.training.trainer.logs.run_files import CHECKPOINTS
from diff4splat.training.trainer.logs.run_logger import RunLogger
from diff4splat.training.trainer.loop.ema import WeightAverages
from diff4splat.training.trainer.loop.evaluation import Evaluation
from diff4splat.training.trainer.loop.nan_policy import after_rollback
from diff4splat.training.trainer.loop.optim import create_optimizer
from diff4splat.training.trainer.loop.progress import Progress
from diff4splat.training.trainer.settings import RunSettings


@dataclass(slots=True, kw_only=True)
class TrainingState:
    """One process's share of a stage."""

    recipe: StageRecipe
    run: RunSettings
    processes: Processes
    plan: BatchPlan
    samples: Samples
    parallel: ParallelStage
    optimizer: torch.optim.Optimizer
    averages: WeightAverages
    checkpoints: CheckpointStore
    evaluation: Evaluation
    logger: RunLogger
    progress: Progress = field(default_factory=Progress)
    saved: Path | None = None
    """The newest checkpoint, if it says what memory says."""

    def save(self) -> Path:
        """Write a checkpoint, unless the newest one is of this very step."""
        if self.saved is None:
            stage = self.parallel.stage
            tensors = run_tensors(stage, self.averages, self.optimizer)
            tensors |= frozen_tensors(stage) if self.run.store_frozen else {}
            self.progress.average_updates = dict(self.averages.updates)
            self.saved = self.checkpoints.save(tensors, self.progress)
            self.logger.event("checkpoint", self.progress.step, {"name": self.saved.name})
        return self.saved

    def resume(self) -> None:
        """Take up the newest checkpoint of this folder, if there is one."""
        found = self.checkpoints.find()
        if found:
            self._load(found)
            self.progress, self.saved = found.progress, found.folder
            self.logger.note(f"{self.recipe.name}: resumed at step {found.progress.step}")

    def roll_back(self) -> bool:
        """Return to the last calm checkpoint and leave out the data since; False without one.

        Raises:
            DivergenceError: it does not help.
        """
        found = self.checkpoints.find(calm=True)
        if found is None:
            return False
        detour = self.progress
        progress = after_rollback(detour, found.progress, self.recipe.global_batch)
        self._load(found)
        self.progress, self.saved = progress, None
        row = {"from_step": detour.step, "first_sample": progress.first_sample}
        self.logger.event("rollback", progress.step, row)
        self.logger.note(f"loss spikes: back from step {detour.step} to {progress.step}")
        self.save()
        return True

    def batches(self) -> Iterator[Loaded]:
        """Micro batches from here to the end of the stage."""
        steps = StepRange(
            plan=self.plan,
            begin=self.progress.step,
            end=self.recipe.steps,
            first=self.progress.first_sample,
        )
        return batches(self.samples, steps, self.recipe.data.workers)

    def _load(self, found: Checkpoint) -> None:
        tensors = run_tensors(self.parallel.stage, self.averages, self.optimizer)
        read_tensors(found.folder, tensors)
        self.averages.updates = dict(found.progress.average_updates)


def assemble(
    stage: Stage, samples: Samples, recipe: StageRecipe, run: RunSettings, processes: Processes
) -> TrainingState:
    """A run at the point where its folder left off.

    Raises:
        ConfigError, CheckpointError: settings, stage and checkpoints do not belong together.
    """
    plan = plan_batches(recipe, processes.data_count, processes.data_rank)
    parallel = parallelise(stage, processes, run.trainer, run.fill)
    parameters = trained_parameters(stage)
    training = TrainingState(
        recipe=recipe,
        run=run,
        processes=processes,
        plan=plan,
        samples=samples,
        parallel=parallel,
        optimizer=create_optimizer(parameters, recipe.optimizer),
        averages=WeightAverages(parameters, run.trainer.ema_decay),
        checkpoints=CheckpointStore(recipe=recipe, run=run, processes=processes),
        evaluation=Evaluation(
            samples=samples, count=run.trainer.evaluation_samples, processes=processes
        ),
        logger=RunLogger(run, processes.first),
    )
    if run.start_from:
        _enter(training, run.start_from)
    training.resume()
    return training


def _enter(training: TrainingState, folder: Path) -> None:
    """Weights and averages of the finished stage before; also on resuming, for frozen parts."""
    before = find_finished(folder, training.processes)
    updates = before.progress.average_updates
    stage, averages = training.parallel.stage, training.averages
    parts = take_over(stage, averages, before.folder, updates)
    training.logger.note(f"{', '.join(parts)}: taken over from stage {before.stage}")


def find_finished(folder: Path, processes: Processes) -> Checkpoint:
    """The last checkpoint of a stage that is over.

    Raises:
        CheckpointError: there is none, or the stage is not over.
        FileFormatError: it is damaged.
    """
    names = processes.first_does(lambda: candidates(folder / CHECKPOINTS))
    if names:
        found = read_checkpoint(folder / CHECKPOINTS / names[0], processes)
        if found.finished:
            return found
    state = f"step {found.progress.step}" if names else "no checkpoint"
    raise CheckpointError(
        f"{folder}: expected the folder of a finished stage, got {state}; train that stage first"
    )
