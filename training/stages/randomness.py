"""Random draws of a stage, which depend on samples and steps alone, so that runs resume exactly.

Axes: ``b`` batch.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.training.stage import Batch, SampleKey
from diff4splat.training.trainer.loading.samples import training_index


@dataclass(frozen=True, slots=True, kw_only=True)
class StageRandom:
    """Generators of one stage, the same on any number of processes."""

    seed: int
    stage: str
    global_batch: int

    def per_sample(self, batch: Batch, purpose: str) -> list[torch.Generator]:
        """One generator per sample."""
        return [self._key(sample, purpose).generator() for sample in batch.sample_index.tolist()]

    def per_step(self, batch: Batch, purpose: str) -> torch.Generator:
        """One generator for all samples of a step, equal on every process."""
        step = training_index(int(batch.sample_index[0])) // self.global_batch
        return self._key(step, purpose).generator()

    def uniform(self, batch: Batch, purpose: str) -> Float[Tensor, " b"]:
        """One number per sample in [0, 1)."""
        draws = [torch.rand(1, generator=own) for own in self.per_sample(batch, purpose)]
        return torch.cat(draws)

    def normal(self, batch: Batch, like: Tensor, purpose: str) -> Tensor:
        """Standard normal numbers in the shape of ``like``."""
        generators = self.per_sample(batch, purpose)
        rows = [torch.randn(like.shape[1:], generator=own) for own in generators]
        return torch.stack(rows).to(like)

    def _key(self, sample: int, purpose: str) -> SampleKey:
        return SampleKey(self.seed, self.stage, sample, purpose)
