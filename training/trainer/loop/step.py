"""One step: forward and backward over the micro batches, and what all processes make of it.

Losses are means over the global batch, summed exactly (``math.fsum``), so they do not depend on
how the batch was dealt out; gradients agree to rounding.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import torch

from diff4splat.training.stage import TOTAL, SampleKey
from diff4splat.training.trainer.distributed.parallel import ParallelStage
from diff4splat.training.trainer.loading.loader import Failure, Loaded, require_batch
from diff4splat.training.trainer.settings import Outcome


@dataclass(slots=True, kw_only=True)
class RankReport:
    """What one process saw in a step."""

    terms: dict[str, list[float]] = field(default_factory=dict)
    """Loss terms, one value per sample."""
    samples: list[int] = field(default_factory=list)
    sources: list[str] = field(default_factory=list)
    """Where each sample came from; empty when batches do not say."""
    failures: list[Failure] = field(default_factory=list)
    waited_s: float = 0.0
    stop: Outcome | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StepReport:
    """What all processes saw: the same at each of them."""

    losses: dict[str, float]
    """Mean of every term over the global batch."""
    source_losses: dict[str, float]
    """Mean total per source."""
    samples: list[int]
    bad_samples: list[int]
    """Those whose own loss was not finite."""
    failures: list[Failure]
    waited_s: float
    """Of the process that waited longest."""
    stop: Outcome | None

    @property
    def total(self) -> float:
        """What was differentiated."""
        return self.losses[TOTAL]


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomState:
    """Seeds PyTorch's global generators, for stages whose layers draw from them."""

    seed: int
    stage: str
    device: torch.device

    def begin(self, sample: int) -> None:
        """Draws after this depend on the first sample of a micro batch alone."""
        key = SampleKey(seed=self.seed, stage=self.stage, sample=sample, purpose="layers")
        torch.manual_seed(key.generator().initial_seed())


def run_micro_batches(
    parallel: ParallelStage, batches: Iterator[Loaded], count: int, random: RandomState
) -> RankReport:
    """Leave the mean gradient over the global batch in the weights.

    Raises:
        InputError: no usable samples.
    """
    report = RankReport()
    for turn in range(count):
        loaded = next(batches)
        batch = require_batch(loaded).to(random.device)
        samples = batch.sample_index.tolist()
        random.begin(samples[0])
        with parallel.accumulating(last=turn == count - 1):
            terms = parallel.losses(batch)
            (terms[TOTAL].float().mean() / count).backward()
        for name, values in terms.items():
            report.terms.setdefault(name, []).extend(values.detach().float().tolist())
        report.samples += samples
        report.sources += list(getattr(batch, "source", ()))
        report.failures += loaded.failures
        report.waited_s += loaded.waited_s
    return report


def merge(reports: list[RankReport], per_sample: int = 1) -> StepReport:
    """Put the processes' reports together, in the order of ranks; one for each share of samples."""
    stops = [report.stop for report in reports if report.stop]
    reports = reports[::per_sample]
    names = sorted({name for report in reports for name in report.terms})
    totals = [value for report in reports for value in report.terms[TOTAL]]
    samples = [sample for report in reports for sample in report.samples]
    sources = [source for report in reports for source in report.sources]
    by_source: dict[str, list[float]] = {}
    for source, value in zip(sources, totals, strict=False):
        by_source.setdefault(source, []).append(value)
    return StepReport(
        losses={
            name: exact_mean([v for report in reports for v in report.terms.get(name, [])])
            for name in names
        },
        source_losses={source: exact_mean(values) for source, values in by_source.items()},
        samples=samples,
        bad_samples=[s for s, v in zip(samples, totals, strict=True) if not math.isfinite(v)],
        failures=[failure for report in reports for failure in report.failures],
        waited_s=max(report.waited_s for report in reports),
        stop=stops[0] if stops else None,
    )


def exact_mean(values: list[float]) -> float:
    """Correctly rounded, so the order does not matter; NaN if any value is not finite."""
    if not all(map(math.isfinite, values)):
        return math.nan
    return math.fsum(values) / len(values)
