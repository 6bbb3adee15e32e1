"""Which frames of a clip a stage receives as input."""

from dataclasses import dataclass

import torch

from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.stages.randomness import StageRandom


@dataclass(frozen=True, slots=True, kw_only=True)
class InputSelection:
    """Whole videos, or in some training steps their first images."""

    random: StageRandom
    single_image_probability: float

    def select(self, batch: ClipBatch, training: bool) -> ClipBatch:
        """The batch with its input frames; evaluation always receives whole videos."""
        draw = torch.rand((), generator=self.random.per_step(batch, "single"))
        first_alone = training and bool(draw < self.single_image_probability)
        return batch.first_image() if first_alone else batch
