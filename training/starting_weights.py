"""Values for the weights of a stage whose trained parts were made on the meta device.

Each part has one source: the checkpoint of an earlier stage, the file of a model, or its initial
values. No source is ever in memory as a whole: weights come one at a time, and each process keeps
its shard.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import torch
from safetensors import safe_open
from torch import Tensor

from diff4splat.errors import CheckpointError
from diff4splat.models.adapters.lora import BASE, initial_lora, is_lora, with_base
from diff4splat.models.placement.initial_weights import InitialWeights
from diff4splat.models.public_weights.merge import match_keys
from diff4splat.models.public_weights.shard_files import read_header
from diff4splat.training.latent_statistics import read_statistics
from diff4splat.training.stage import Stage
from diff4splat.training.trainer.checkpoints.merged import MergedCheckpoint
from diff4splat.training.trainer.distributed.sharding import put


@dataclass(frozen=True, slots=True, kw_only=True)
class StartingWeights:
    """The source of every part that lies on the meta device."""

    seed: int
    initial: Mapping[str, InitialWeights]
    """Of every part; the last resort."""
    files: Mapping[str, Path] = field(default_factory=dict)
    """Weight files of a model that the run starts from."""
    checkpoints: Mapping[str, Path] = field(default_factory=dict)
    """Of earlier stages, which come before the files."""
    vae_statistics: Path | None = None
    """Folder of the stage that measured the latents of a trained autoencoder."""

    def fill(self, stage: Stage) -> None:
        """Give every weight its value; all processes call.

        Raises:
            CheckpointError: a source belongs to another configuration.
            FileFormatError: it is damaged.
        """
        for part in self.initial:
            network = stage.get_submodule(part)
            targets = network.state_dict()
            for key, value in initial_lora(targets, self.seed):
                put(targets[key], value)
            if part in self.checkpoints:
                named = {f"{part}.{key}": value for key, value in targets.items()}
                MergedCheckpoint.open(self.checkpoints[part]).read(named, averaged=True)
            else:
                _put_each(targets, self._values(part, targets))
        if "vae" in self.initial and self.vae_statistics is not None:
            stage.get_submodule("vae").set_statistics(*read_statistics(self.vae_statistics))

    def _values(self, part: str, targets: Mapping[str, Tensor]) -> Iterator[tuple[str, Tensor]]:
        if part in self.files:
            plain = {
                key.replace(BASE, "."): tuple(value.shape)
                for key, value in targets.items()
                if not is_lora(key)
            }
            return _stored(part, self.files[part], plain)
        return self.initial[part].draw()


def _put_each(targets: Mapping[str, Tensor], values: Iterator[tuple[str, Tensor]]) -> None:
    for key, value in values:
        put(targets[key if key in targets else with_base(key)], value)


def _stored(
    part: str, file: Path, wanted: Mapping[str, tuple[int, ...]]
) -> Iterator[tuple[str, Tensor]]:
    """Mapped from the file, one weight after another."""
    match_keys(read_header(file), wanted, str, f"{file}: {part} weights")
    with safe_open(file, "pt") as opened:
        for key, shape in wanted.items():
            value = opened.get_tensor(key).to(torch.float32).reshape(shape)
            if not bool(value.isfinite().all()):
                raise CheckpointError(
                    f"{file}: expected finite numbers in {key}, got NaN or infinity"
                )
            yield key, value
