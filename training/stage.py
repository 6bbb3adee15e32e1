"""What the trainer knows of a stage: a module that turns batches into losses.

Axes: ``b`` batch, ``h w`` image. Everything random inside a step is drawn from generators seeded
by ``SampleKey``, never from global state, so that a run resumes exactly on any number of processes.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

TOTAL = "total"
"""The term that is differentiated; all others are there to be looked at."""


@runtime_checkable
class Batch(Protocol):
    """What a stage takes; the trainer only moves it and reads which samples it holds."""

    @property
    def sample_index(self) -> Int[Tensor, " b"]:
        """Global index of each sample: all randomness inside a step derives from it."""
        ...

    def to(self, device: torch.device) -> "Batch":
        """Move every tensor."""
        ...


class Stage(nn.Module):
    """All networks that one stage needs, trained or frozen, as submodules named as model parts."""

    trained: tuple[str, ...]
    """Names of the submodules that learn; the others have ``requires_grad`` off and run in eval."""

    def forward(self, batch: Batch) -> Mapping[str, Float[Tensor, " b"]]:
        """Loss terms, one value per batch element, with ``TOTAL`` among them."""
        raise NotImplementedError

    def compilable(self) -> tuple[nn.Module, ...]:
        """Networks that ``torch.compile`` makes faster: few shapes, one call, most of a step."""
        return ()

    def measure(self, batch: Batch) -> Mapping[str, Float[Tensor, " b"]]:
        """What evaluation and gates look at, such as ``psnr``; without gradients."""
        raise NotImplementedError

    def panel(self, batch: Batch) -> Float[Tensor, "h w 3"]:
        """An image for people: input, prediction, truth, depth, motion; RGB in [0, 1]."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class SampleKey:
    """What a random draw depends on."""

    seed: int
    stage: str
    sample: int
    purpose: str

    def generator(self) -> torch.Generator:
        """A CPU generator that only this key has."""
        text = f"{self.seed}/{self.stage}/{self.sample}/{self.purpose}".encode()
        seed = int.from_bytes(hashlib.blake2b(text, digest_size=8).digest(), "big") >> 1
        return torch.Generator().manual_seed(seed)
