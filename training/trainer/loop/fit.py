"""``fit_stage``: train one stage, from wherever its folder left off, until something says stop."""

import math
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from functools import partial
from pathlib import Path

from diff4splat.io.locks import sole_writer
from diff4splat.progress.phases import Phases
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.stage import Stage
from diff4splat.training.trainer.distributed.processes import Processes, open_processes
from diff4splat.training.trainer.gates import StoredResult, write_result
from diff4splat.training.trainer.loading.samples import Samples
from diff4splat.training.trainer.loop.loop import finish_step, must_roll_back, take_step
from diff4splat.training.trainer.loop.signals import StopRequest, stop_request
from diff4splat.training.trainer.loop.state import TrainingState, assemble
from diff4splat.training.trainer.settings import Outcome, RunSettings, StageResult


def fit_stage(stage: Stage, samples: Samples, recipe: StageRecipe, run: RunSettings) -> StageResult:
    """Train a stage in one process or as one of ``torchrun``'s; call again to go on.

    The stage is changed in place. Wherever it stops, a checkpoint of that step is written, and
    ``result.json`` says how far it came.

    Raises:
        ConfigError: settings do not fit together, or not the number of processes.
        CheckpointError: the folder belongs to another stage or configuration.
        DivergenceError: the stage does not learn any more.
        InputError: the source of samples is broken.
        OutputError: nothing can be written, or another run trains in the folder; the checkpoints
            so far stay.
    """
    trainer = run.trainer
    with (
        open_processes(
            trainer.parallel, run.device, run.timeout_s, trainer.context_parallel
        ) as processes,
        _sole_run(run.folder, processes),
        stop_request(run) as stop,
    ):
        training = assemble(stage, samples, recipe, run, processes)
        processes.first_does(run.begin)
        with closing(training.logger):
            return _conclude(training, _train(training, stop))


@contextmanager
def _sole_run(folder: Path, processes: Processes) -> Iterator[None]:
    """The processes of one run share the folder; other runs may not."""
    with ExitStack() as stack:
        processes.first_does(lambda: stack.enter_context(sole_writer(folder)))
        yield


def _train(training: TrainingState, stop: StopRequest) -> Outcome:
    """Step until the stage is over or somebody asks to stop; a step that was undone counts too."""
    steps, taken = training.recipe.steps, 0
    training.parallel.module.set_training(True)
    phases = training.run.phases if training.processes.first else Phases()
    batches = training.batches()
    with phases.phase(training.recipe.name, steps - training.progress.step) as advance:
        while training.progress.step < steps:
            taken += 1
            report = take_step(training, batches, partial(stop.reason, taken))
            if must_roll_back(training):
                batches = training.batches()
            else:
                finish_step(training)
                advance()
            if report.stop and training.progress.step < steps:
                return report.stop
    return "finished"


def _conclude(training: TrainingState, outcome: Outcome) -> StageResult:
    checkpoint, progress = training.save(), training.progress
    stored = StoredResult(
        stage=training.recipe.name,
        finished=outcome == "finished",
        step=progress.step,
        checkpoint=checkpoint.name,
        measures=progress.measures,
    )
    training.processes.first_does(lambda: write_result(training.run.folder, stored))
    return StageResult(
        stage=training.recipe.name,
        outcome=outcome,
        step=progress.step,
        measures={k: math.nan if v is None else v for k, v in progress.measures.items()},
        checkpoint=checkpoint,
    )
