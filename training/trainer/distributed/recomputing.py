"""Activation checkpointing: blocks keep their inputs alone and run again on the way back.

Results are the same to the bit; a step computes every block's forward pass twice, and memory holds
the activations of one block. Causal layers with a history run once: a second run would extend it.
"""

from functools import partial
from typing import Any

import torch
from torch import nn
from torch.utils.checkpoint import checkpoint

from diff4splat.models.blocks.causal_conv import FrameMemory
from diff4splat.models.wan.history import History
from diff4splat.training.stage import Stage
from diff4splat.training.trainer.distributed.blocks import outer_blocks


def recompute_blocks(stage: Stage) -> None:
    """Make the blocks of the trained parts run again in the backward pass, in place.

    Their names and weights stay. Hooks of wrappers run around both passes.
    """
    for block in outer_blocks(stage):
        block.forward = partial(_recomputed, block, type(block).forward)


def _recomputed(block: nn.Module, forward: Any, *inputs: Any, **options: Any) -> Any:
    history = any(isinstance(value, FrameMemory | History) for value in inputs)
    if history or not torch.is_grad_enabled():
        return forward(block, *inputs, **options)
    return checkpoint(forward, block, *inputs, use_reentrant=False, **options)
