"""Means of a stage's measures over fixed samples that training never sees, with averaged weights.

NaN says that a measure does not apply to a sample, such as motion where nothing moves: means leave
it out, and are NaN only where it applies to no sample.

The samples are shared out over processes; sharded networks need all processes in every call, so
that whoever has fewer samples repeats one, and repeats do not count.
"""

import math
from dataclasses import dataclass, field

from jaxtyping import Float
from torch import Tensor

from diff4splat.training.stage import Batch
from diff4splat.training.trainer.distributed.parallel import StageModule
from diff4splat.training.trainer.distributed.processes import Processes
from diff4splat.training.trainer.loading.loader import load_batch, require_batch
from diff4splat.training.trainer.loading.samples import EVALUATION_START, Samples
from diff4splat.training.trainer.loop.ema import WeightAverages
from diff4splat.training.trainer.loop.step import exact_mean


@dataclass(slots=True, kw_only=True)
class Evaluation:
    """Keeps its samples in memory: they are the same every time."""

    samples: Samples
    count: int
    processes: Processes
    _batches: dict[int, Batch] = field(default_factory=dict)

    def measure(self, module: StageModule, averages: WeightAverages) -> dict[str, float]:
        """Mean of every measure, equal at all processes."""
        found: dict[int, dict[str, float]] = {}
        module.set_training(False)
        with averages.swapped():
            for position in self._mine():
                terms = module.measure(self._batch(position))
                found[position] = {name: float(v.float().mean()) for name, v in terms.items()}
        module.set_training(True)
        return _means(self.processes.gather(found))

    def panel(self, module: StageModule, averages: WeightAverages) -> Float[Tensor, "h w 3"]:
        """Image of the first sample; all processes draw it, because sharded networks must."""
        module.set_training(False)
        with averages.swapped():
            image = module.panel(self._batch(0))
        module.set_training(True)
        return image

    def _mine(self) -> list[int]:
        rank, ranks = self.processes.data_rank, self.processes.data_count
        return [min(start + rank, self.count - 1) for start in range(0, self.count, ranks)]

    def _batch(self, position: int) -> Batch:
        if position not in self._batches:
            loaded = load_batch(self.samples, [EVALUATION_START + position])
            self._batches[position] = require_batch(loaded).to(self.processes.device)
        return self._batches[position]


def _means(per_process: list[dict[int, dict[str, float]]]) -> dict[str, float]:
    merged = {position: row for found in per_process for position, row in found.items()}
    names = sorted({name for row in merged.values() for name in row})
    rows = [row for _, row in sorted(merged.items())]
    return {name: _mean([row[name] for row in rows if name in row]) for name in names}


def _mean(values: list[float]) -> float:
    applying = [value for value in values if not math.isnan(value)]
    return exact_mean(applying) if applying else math.nan
