"""Weights shared out over processes by FSDP2.

Every block of the trained parts is sharded, and then what is left of them; frozen parts stay whole
on every process and never travel. In bfloat16 the weights of blocks travel in bfloat16 and are
computed with there; all others stay float32, because geometry and heads may ask for them outside
autocast. Master weights and reduced gradients are float32.
"""

import torch
from torch import Tensor, nn
from torch.distributed.device_mesh import init_device_mesh
from torch.distributed.fsdp import (
    MixedPrecisionPolicy,
    fully_shard,
    register_fsdp_forward_method,
)
from torch.distributed.tensor import DTensor, distribute_tensor

from diff4splat.training.recipe.trainer import Precision
from diff4splat.training.trainer.distributed.blocks import all_blocks
from diff4splat.training.trainer.distributed.processes import Processes
from diff4splat.training.trainer.loop.optim import local


def shard(module: nn.Module, processes: Processes, precision: Precision) -> None:
    """Shard the trained parts of ``module.stage`` in place; weights may lie on the meta device."""
    mesh = init_device_mesh(processes.device.type, (processes.count,))
    # Inputs keep their type: positions and times must not be rounded on their way in.
    half = MixedPrecisionPolicy(
        param_dtype=torch.bfloat16 if precision == "bfloat16" else None,
        reduce_dtype=torch.float32,
        cast_forward_inputs=False,
    )
    for block in all_blocks(module.stage):
        fully_shard(block, mesh=mesh, mp_policy=half, reshard_after_forward=True)
    frozen = {parameter for parameter in module.parameters() if not parameter.requires_grad}
    # Kept whole after a forward pass, the root would not notice that averages are swapped in.
    fully_shard(module, mesh=mesh, ignored_params=frozen, reshard_after_forward=True)
    for method in ("measure", "panel"):
        register_fsdp_forward_method(module, method)


@torch.no_grad()
def put(target: Tensor, value: Tensor) -> None:
    """Copy what this process holds of ``target`` from the whole ``value``; nothing travels."""
    if isinstance(target, DTensor):
        value = value.to(target.device, target.dtype)
        value = distribute_tensor(value, target.device_mesh, target.placements, src_data_rank=None)
    local(target.detach()).copy_(local(value))
