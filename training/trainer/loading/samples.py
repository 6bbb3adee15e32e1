"""What the trainer asks of data: any sample by its index, for ever.

A sample is a function of its index alone: the same index gives the same sample in every process,
on every machine and after every restart. Training counts up from 0; evaluation uses indices from
``EVALUATION_START`` on, which training never reaches, so the two never meet. What takes the place
of an unusable sample lies a multiple of ``REPLACEMENT_STRIDE`` behind it, so that its index still
says which sample was asked for, and so to which step it belongs.
"""

from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

from diff4splat.training.stage import Batch

EVALUATION_START = 1 << 40
"""First index of the samples that are only ever looked at."""
REPLACEMENT_STRIDE = 1 << 32
"""More samples than any stage takes."""


def replacement(sample_index: int, attempt: int) -> int:
    """The index to try when a sample and ``attempt − 1`` in its place were unusable."""
    return sample_index + attempt * REPLACEMENT_STRIDE


def training_index(sample_index: int) -> int:
    """The position in training that a sample or its replacement was asked for."""
    return sample_index % REPLACEMENT_STRIDE


@runtime_checkable
class Samples(Protocol):
    """Source of samples; it travels to worker processes, so it must survive pickling."""

    def __getitem__(self, sample_index: int) -> Any:
        """One sample.

        Raises:
            Diff4SplatError: this one is not usable; another is taken in its place and counted.
        """
        ...

    def collate(self, samples: Sequence[Any]) -> Batch:
        """Put samples together; called in the process that made them."""
        ...
