"""One stage on one or many processes: alone, replicated (DDP) or sharded (FSDP2).

With FSDP2 trained parts may lie on the meta device: they get memory once they are sharded, and
their values by ``fill``.
"""

import warnings
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.parallel import DistributedDataParallel

from diff4splat.errors import ConfigError, ShapeError
from diff4splat.models.adapters.tuning import learns
from diff4splat.training.recipe.trainer import Precision, TrainerSettings
from diff4splat.training.stage import TOTAL, Batch, Stage
from diff4splat.training.trainer.distributed.compiling import compile_networks
from diff4splat.training.trainer.distributed.processes import Processes
from diff4splat.training.trainer.distributed.recomputing import recompute_blocks
from diff4splat.training.trainer.distributed.sharding import shard


class StageModule(nn.Module):
    """A stage as wrappers need it: a plain dict comes back, and only the total has a gradient."""

    def __init__(self, stage: Stage, device: torch.device, precision: Precision) -> None:
        super().__init__()
        self.stage, self.device, self.half = stage, device, precision == "bfloat16"

    def forward(self, batch: Batch) -> dict[str, Float[Tensor, " b"]]:
        """Loss terms; DDP would wait for weights that only feed terms nobody differentiates."""
        with self._precision():
            terms = self.stage(batch)
        return {k: v if k == TOTAL else v.detach() for k, v in terms.items()}

    def measure(self, batch: Batch) -> dict[str, Float[Tensor, " b"]]:
        """What evaluation looks at."""
        with torch.no_grad(), self._precision():
            return dict(self.stage.measure(batch))

    def panel(self, batch: Batch) -> Float[Tensor, "h w 3"]:
        """An image for people."""
        with torch.no_grad(), self._precision():
            return self.stage.panel(batch).float().cpu().clamp(0, 1)

    def set_training(self, training: bool) -> None:
        """The stage and its trained parts learn or are evaluated; frozen parts are evaluated."""
        self.stage.train(training)
        for name, part in self.stage.named_children():
            if name not in self.stage.trained:
                part.eval()

    def _precision(self) -> AbstractContextManager:
        return torch.autocast(self.device.type, torch.bfloat16, enabled=self.half)


@dataclass(frozen=True, slots=True, kw_only=True)
class ParallelStage:
    """What steps call."""

    module: StageModule
    """For evaluation."""
    losses: nn.Module
    """For training: the module, perhaps wrapped."""

    @property
    def stage(self) -> Stage:
        """The networks."""
        return self.module.stage

    def accumulating(self, last: bool) -> AbstractContextManager:
        """Around forward and backward of a micro batch; gradients of the last one are shared.

        FSDP2 shares at every micro batch: whole gradients would cost the memory it saves.
        """
        if last or not isinstance(self.losses, DistributedDataParallel):
            return nullcontext()
        return self.losses.no_sync()


Fill = Callable[[Stage], None]
"""Gives values to weights that had none."""


def parallelise(
    stage: Stage, processes: Processes, settings: TrainerSettings, fill: Fill | None = None
) -> ParallelStage:
    """Freeze what does not learn, move the stage to its device, and wrap it.

    Raises:
        ConfigError: a trained part does not exist, or compiling needs a compiler that is not there.
        ShapeError: master weights are not float32.
    """
    freeze(stage)
    for name, part in stage.named_children():
        if not _is_meta(part):
            part.to(processes.device)
        elif settings.parallel != "fsdp2" or name not in stage.trained:
            raise ConfigError(f"{name}: expected weights, got none; only fsdp2 makes them sharded")
    for part in stage.children():
        if hasattr(part, "share_tokens"):
            part.share_tokens(processes.sharing)
    if settings.recompute:
        recompute_blocks(stage)
    if settings.compile:
        compile_networks(stage)
    module = StageModule(stage, processes.device, settings.precision)
    losses: nn.Module = module
    if settings.parallel == "ddp":
        losses = _replicate(module, processes.device)
    elif settings.parallel == "fsdp2":
        shard(module, processes, settings.precision)
        _allocate(stage, processes.device)
    if fill is not None:
        fill(stage)
    return ParallelStage(module=module, losses=losses)


def _is_meta(part: nn.Module) -> bool:
    return any(weight.is_meta for weight in part.parameters())


def _allocate(stage: Stage, device: torch.device) -> None:
    """Memory for this process's shards of parts on the meta device."""
    for part in stage.children():
        if _is_meta(part):
            part.to_empty(device=device)


def freeze(stage: Stage) -> None:
    """Only the trained parts take gradients."""
    missing = [name for name in stage.trained if name not in dict(stage.named_children())]
    if missing or not stage.trained:
        known = ", ".join(name for name, _ in stage.named_children())
        raise ConfigError(
            f"trained: expected parts of the stage ({known}), got "
            f"{', '.join(missing) or 'none'}; correct the recipe"
        )
    stage.requires_grad_(False)
    for name, parameter in trained_parameters(stage).items():
        if parameter.dtype != torch.float32:
            raise ShapeError(f"{name}: expected float32 master weights, got {parameter.dtype}")
        parameter.requires_grad_(True)


def trained_parameters(stage: Stage) -> Mapping[str, nn.Parameter]:
    """Name, beginning with the part, to weight; in a fixed order."""
    return {
        f"{part}.{name}": parameter
        for part in stage.trained
        for name, parameter in stage.get_submodule(part).named_parameters()
        if learns(stage.get_submodule(part), name)
    }


def _replicate(module: StageModule, device: torch.device) -> DistributedDataParallel:
    """Weights that a batch does not need are allowed: scenes without motion leave some out."""
    with warnings.catch_warnings():
        # Newer releases want another name for what older ones call ``broadcast_buffers``.
        warnings.simplefilter("ignore", FutureWarning)
        return DistributedDataParallel(
            module,
            device_ids=None if device.index is None else [device.index],
            broadcast_buffers=False,
            find_unused_parameters=True,
        )
