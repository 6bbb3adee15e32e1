"""Weights of a checkpoint for networks with other low-rank corrections than it was made of.

Corrections that the network lacks, or has in another rank, are folded into the layers that they
correct, one layer at a time. Everything else is read straight into place, shards included.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from diff4splat.models.adapters.lora import BASE, DOWN, SCALE, UP, is_lora, merged
from diff4splat.training.trainer.checkpoints.tensor_store import read_tensors, stored_shapes
from diff4splat.training.trainer.distributed.sharding import put

MODEL, AVERAGE = "model.", "ema."
"""How names of weights and of their averages begin."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MergedCheckpoint:
    """A checkpoint read for other networks."""

    folder: Path
    shapes: Mapping[str, tuple[int, ...]]
    """Of everything stored, by its name there."""

    @classmethod
    def open(cls, folder: Path) -> "MergedCheckpoint":
        """The checkpoint with its headers read.

        Raises:
            FileFormatError: it is damaged.
        """
        return cls(folder=folder, shapes=stored_shapes(folder))

    def fits(self, targets: Mapping[str, Tensor]) -> bool:
        """Whether it has the very corrections that the networks of ``targets`` have."""
        parts = {key.partition(".")[0] for key in targets}
        theirs = {
            key.removeprefix(MODEL): shape
            for key, shape in self.shapes.items()
            if key.startswith(MODEL) and is_lora(key)
        }
        mine = {key: tuple(value.shape) for key, value in targets.items() if is_lora(key)}
        return {k: v for k, v in theirs.items() if k.partition(".")[0] in parts} == mine

    def read(self, targets: Mapping[str, Tensor], *, averaged: bool) -> None:
        """Fill weights by ``<part>.<key>``; corrections of the networks' own are left alone.

        Raises:
            CheckpointError: a weight is missing or has another shape.
            FileFormatError: a file is damaged.
        """
        wanted = {
            key.replace(BASE, "."): value for key, value in targets.items() if not is_lora(key)
        }
        corrected = dict(self._corrected(wanted))
        plain = {key: value for key, value in wanted.items() if key not in corrected}
        read_tensors(self.folder, {self._name(key, averaged): v for key, v in plain.items()})
        for key, stored in corrected.items():
            put(wanted[key], self._merged(key, stored, averaged))

    def _name(self, key: str, averaged: bool) -> str:
        """The stored name; what does not learn has no average."""
        return AVERAGE + key if averaged and AVERAGE + key in self.shapes else MODEL + key

    def _corrected(self, wanted: Mapping[str, Tensor]) -> Iterator[tuple[str, tuple[str, ...]]]:
        """Weights of corrected layers, and everything stored that they are made of."""
        for key in wanted:
            layer, _, kind = key.rpartition(".")
            if f"{MODEL}{layer}{BASE}{kind}" in self.shapes:
                base = f"{layer}{BASE}{kind}"
                corrections = tuple(layer + end for end in (DOWN, UP, SCALE))
                yield key, (base, *(corrections if kind == "weight" else ()))

    def _merged(self, key: str, stored: tuple[str, ...], averaged: bool) -> Tensor:
        names = {one: self._name(one, averaged) for one in stored}
        values = {one: torch.empty(self.shapes[MODEL + one]) for one in stored}
        read_tensors(self.folder, {names[one]: value for one, value in values.items()})
        return merged(values)[key] if len(stored) > 1 else values[stored[0]]
