"""What to do when losses or gradients go wrong; decided from values that all processes share.

Skip: without a finite loss and gradient norm, or with a loss of a different order, there is no
update and no averaging; the step still counts in schedule and data, so the run ends where it would
have. Spike: a loss far above its
running median. Several in a row: go back to the last good checkpoint and leave that data out.
"""

import json
import math
import statistics
from pathlib import Path

from diff4splat.errors import DivergenceError
from diff4splat.io.atomic import write_text
from diff4splat.training.recipe.trainer import TrainerSettings
from diff4splat.training.trainer.loop.progress import Progress

LEAST_HISTORY = 20
"""Losses before the first spike can be called one."""
MOST_ROLLBACKS = 3
"""Returns to one checkpoint before the run gives up: then it is not the data."""
SNAPSHOT_FILE = "skipped.json"


def skip_reason(loss: float, norm: float) -> str | None:
    """Why a step must not update anything; None when it may."""
    if not math.isfinite(loss):
        return "loss is not finite"
    return None if math.isfinite(norm) else "gradient is not finite"


def outlier_reason(progress: Progress, loss: float, settings: TrainerSettings) -> str | None:
    """Why a finite loss must not update anything either: no data is ``factor`` times as hard.

    Clipping bounds such a step but does not give it a direction. It counts as a spike: several in
    a row mean that the weights are spoilt, not the data.
    """
    if not is_spike(progress, loss, settings.outlier_factor):
        return None
    progress.spikes += 1
    progress.spikes_in_a_row += 1
    return "loss is an outlier"


def record_skip(progress: Progress, reason: str) -> None:
    """Count a step without an update."""
    progress.skips[reason] = progress.skips.get(reason, 0) + 1
    progress.skips_in_a_row += 1


def require_few_skips(progress: Progress, settings: TrainerSettings, snapshot: Path) -> None:
    """Give up when steps are skipped in a row, or more than a share of all and of that many.

    Raises:
        DivergenceError: too many.
    """
    row, share = settings.most_skips_in_a_row, settings.most_skips_share
    # A share of few steps means nothing yet.
    allowed = max(row, share * (progress.step + 1))
    if progress.skips_in_a_row < row and progress.skipped <= allowed:
        return
    reasons = ", ".join(f"{count} × {reason}" for reason, count in progress.skips.items())
    raise DivergenceError(
        f"training: expected fewer than {row} skipped steps in a row and at most {share:.1%} of "
        f"all, got {progress.skips_in_a_row} in a row and {progress.skipped} of "
        f"{progress.step + 1} ({reasons}); look at the samples in {snapshot}, or lower the "
        "learning rate"
    )


def write_snapshot(file: Path, rows: list[dict]) -> None:
    """The latest skipped steps with their samples."""
    write_text(file, json.dumps({"skipped_steps": rows}, indent=2) + "\n")


def is_spike(progress: Progress, loss: float, factor: float) -> bool:
    """Whether a loss is ``factor`` times the median of those before it; 0 switches it off.

    Likelihoods may be negative, so what counts is the distance from the median, in medians of the
    losses' size: the same for losses above 0.
    """
    if factor <= 0 or len(progress.recent_losses) < LEAST_HISTORY:
        return False
    size = statistics.median(abs(loss) for loss in progress.recent_losses)
    return size > 0 and loss - statistics.median(progress.recent_losses) > (factor - 1) * size


def record_loss(progress: Progress, loss: float, factor: float) -> bool:
    """Count a finite loss; True when it is a spike."""
    spike = is_spike(progress, loss, factor)
    progress.spikes += spike
    progress.spikes_in_a_row = progress.spikes_in_a_row + 1 if spike else 0
    progress.remember(loss)
    return spike


def after_rollback(now: Progress, then: Progress, global_batch: int) -> Progress:
    """Progress at the old checkpoint, with counters kept and the data of the detour left out.

    ``now.step`` is the index of the spiking step, so that the first new sample is the one that the
    next step would have taken.

    Raises:
        DivergenceError: the run keeps coming back to this checkpoint.
    """
    visits = now.rollbacks_to.get(str(then.step), 0) + 1
    if visits > MOST_ROLLBACKS:
        raise DivergenceError(
            f"training: expected a steady loss after step {then.step}, got spikes again after "
            f"{MOST_ROLLBACKS} roll-backs; lower the learning rate or raise spike_factor"
        )
    then.first_sample = now.first_sample + (now.step + 1 - then.step) * global_batch
    then.skips, then.replaced, then.skips_in_a_row = now.skips, now.replaced, 0
    then.spikes, then.rollbacks = now.spikes, now.rollbacks + 1
    then.rollbacks_to = now.rollbacks_to | {str(then.step): visits}
    return then
