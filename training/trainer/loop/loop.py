"""What happens in one step, and after it.

forward and backward ─ share losses ─ update or skip ─ watch spikes ─ evaluate ─ save
"""

import time
from collections.abc import Callable, Iterator

from diff4splat.training.trainer.distributed.parallel import trained_parameters
from diff4splat.training.trainer.loading.loader import Loaded
from diff4splat.training.trainer.logs.run_files import finite
from diff4splat.training.trainer.loop.nan_policy import (
    outlier_reason,
    record_loss,
    record_skip,
    require_few_skips,
    skip_reason,
)
from diff4splat.training.trainer.loop.optim import (
    clip_gradient,
    gradient_norm,
    schedule,
    set_learning_rate,
)
from diff4splat.training.trainer.loop.state import TrainingState
from diff4splat.training.trainer.loop.step import RandomState, StepReport, merge, run_micro_batches
from diff4splat.training.trainer.settings import Outcome

StopReason = Callable[[], Outcome | None]


def take_step(training: TrainingState, batches: Iterator[Loaded], stop: StopReason) -> StepReport:
    """Learn from one global batch, unless that would spoil the weights.

    Raises:
        DivergenceError: too many steps were skipped.
    """
    began, progress = time.perf_counter(), training.progress
    random = RandomState(
        seed=training.run.seed, stage=training.recipe.name, device=training.processes.device
    )
    mine = run_micro_batches(training.parallel, batches, training.plan.accumulation, random)
    norm = gradient_norm(trained_parameters(training.parallel.stage).values())
    mine.stop = stop()
    report = merge(training.processes.gather(mine), training.processes.per_sample)
    _learn(training, report, norm)
    training.optimizer.zero_grad(set_to_none=True)
    for failure in report.failures:
        progress.replaced[failure.reason] = progress.replaced.get(failure.reason, 0) + 1
    training.logger.step(
        progress.step, report, _figures(training, report, norm, time.perf_counter() - began)
    )
    require_few_skips(progress, training.run.trainer, training.logger.snapshot)
    return report


def must_roll_back(training: TrainingState) -> bool:
    """Whether spikes came in a row and there is something to return to; returns to it.

    Raises:
        DivergenceError: returning did not help before.
    """
    settings, progress = training.run.trainer, training.progress
    if settings.spike_factor <= 0 or progress.spikes_in_a_row < settings.spikes_before_rollback:
        return False
    if training.roll_back():
        return True
    training.logger.note("loss spikes, and no checkpoint to go back to: training goes on")
    progress.spikes_in_a_row = 0
    return False


def finish_step(training: TrainingState) -> None:
    """Count the step, then evaluate and save when it is time."""
    progress, settings = training.progress, training.run.trainer
    progress.step += 1
    training.saved = None
    last = progress.step == training.recipe.steps
    if settings.evaluation_samples and (last or progress.step % settings.evaluate_every == 0):
        _evaluate(training)
    # A checkpoint amid spikes is nothing to go back to.
    if progress.step % settings.checkpoint_every == 0 and not progress.spikes_in_a_row:
        training.save()


def _learn(training: TrainingState, report: StepReport, norm: float) -> None:
    """Update weights and averages, or count why not."""
    progress, parameters = training.progress, trained_parameters(training.parallel.stage).values()
    settings = training.run.trainer
    reason = skip_reason(report.total, norm) or outlier_reason(progress, report.total, settings)
    if reason:
        record_skip(progress, reason)
        training.logger.skip(progress.step, report, reason)
        return
    progress.skips_in_a_row = 0
    clip_gradient(parameters, norm, training.recipe.optimizer.clip_norm)
    set_learning_rate(training.optimizer, _learning_rate(training))
    training.optimizer.step()
    training.averages.update()
    if record_loss(progress, report.total, training.run.trainer.spike_factor):
        training.logger.spike(progress.step, report)


def _figures(
    training: TrainingState, report: StepReport, norm: float, seconds: float
) -> dict[str, float]:
    return {
        "gradient_norm": norm,
        "learning_rate": _learning_rate(training),
        "seconds": seconds,
        "waiting_share": report.waited_s / seconds,
        "samples_per_s": training.recipe.global_batch / seconds,
        "skipped": training.progress.skipped,
    }


def _learning_rate(training: TrainingState) -> float:
    settings, recipe = training.recipe.optimizer, training.recipe
    return settings.learning_rate * schedule(training.progress.step, recipe.steps, settings)


def _evaluate(training: TrainingState) -> None:
    module, averages = training.parallel.module, training.averages
    measures = training.evaluation.measure(module, averages)
    panel = training.evaluation.panel(module, averages)
    training.progress.measures = finite(measures)
    training.logger.evaluation(training.progress.step, measures, panel)
