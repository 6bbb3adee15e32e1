"""One stage on one or many processes: alone, replicated (DDP) or sharded (FSDP2).

FSDP2 shards every element of every ``nn.ModuleList`` inside the trained parts and then what is left
of them; frozen parts stay whole on every process and never travel. In bfloat16 the weights of list
elements travel in bfloat16 and are computed with there; all others stay float32, because geometry
and heads may ask for them outside autocast. Master weights and reduced gradients are float32.
"""

import warnings
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.distributed.device_mesh import init_device_mesh
from torch.distributed.fsdp import (
    MixedPrecisionPolicy,
    fully_shard,
    register_fsdp_forward_method,
)
from torch.nn.parallel import DistributedDataParallel

from diff4splat.errors import ConfigError, ShapeError
from diff4splat.models.adapters.tuning import learns
from diff4splat.training.recipe.trainer import Precision, TrainerSettings
from diff4splat.training.stage import TOTAL, Batch, Stage
from diff4splat.training.trainer.distributed.compiling import compile_networks
from diff4splat.training.trainer.distributed.processes import Processes


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


def parallelise(stage: Stage, processes: Processes, settings: TrainerSettings) -> ParallelStage:
    """Freeze what does not learn, move the stage to its device, and wrap it.

    Raises:
        ConfigError: a trained part does not exist, or compiling needs a compiler that is not there.
        ShapeError: master weights are not float32.
    """
    freeze(stage)
    stage.to(processes.device)
    if settings.compile:
        compile_networks(stage)
    module = StageModule(stage, processes.device, settings.precision)
    losses: nn.Module = module
    if settings.parallel == "ddp":
        losses = _replicate(module, processes.device)
    elif settings.parallel == "fsdp2":
        _shard(module, processes, settings.precision)
    return ParallelStage(module=module, losses=losses)


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


def _shard(module: StageModule, processes: Processes, precision: Precision) -> None:
    mesh = init_device_mesh(processes.device.type, (processes.count,))
    # Inputs keep their type: positions and times must not be rounded on their way in.
    half = MixedPrecisionPolicy(
        param_dtype=torch.bfloat16 if precision == "bfloat16" else None,
        reduce_dtype=torch.float32,
        cast_forward_inputs=False,
    )
    for block in _blocks(module.stage):
        fully_shard(block, mesh=mesh, mp_policy=half, reshard_after_forward=True)
    frozen = {parameter for parameter in module.parameters() if not parameter.requires_grad}
    # Kept whole after a forward pass, the root would not notice that averages are swapped in.
    fully_shard(module, mesh=mesh, ignored_params=frozen, reshard_after_forward=True)
    for method in ("measure", "panel"):
        register_fsdp_forward_method(module, method)


def _blocks(stage: Stage) -> Iterator[nn.Module]:
    """List elements inside trained parts that can be called and have weights, inner ones first."""
    for part in stage.trained:
        for owner in reversed(list(stage.get_submodule(part).modules())):
            if isinstance(owner, nn.ModuleList):
                for block in owner:
                    callable_ = not isinstance(block, nn.ModuleList | nn.ModuleDict)
                    if callable_ and any(True for _ in block.parameters()):
                        yield block
