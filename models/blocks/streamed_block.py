"""A block whose weights stay where and as they are stored, until the block runs.

Public weights are larger than the memory of many machines. They are mapped from their file, often
in half precision. A block copies its own to the device and to the type of the computation, runs,
and lets the copies go: memory holds one block in full, whatever the number of blocks.
"""

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor, nn
from torch.func import functional_call


class StreamedBlock(nn.Module):
    """Runs ``block`` on copies of its weights; ``to`` moves the computation, not what is stored."""

    def __init__(self, block: nn.Module) -> None:
        super().__init__()
        self.block = block
        self.computes = torch.zeros(())
        """Its device and type are those of the computation."""

    def forward(self, *inputs: Any) -> Any:
        """The block's own output."""
        target = {"device": self.computes.device, "dtype": self.computes.dtype}
        weights = {name: value.to(**target) for name, value in self.block.named_parameters()}
        return functional_call(self.block, weights, inputs)

    def state_dict(self, *args: Any, **options: Any) -> dict[str, Any]:
        """The block's own, under the names that it has without streaming."""
        return self.block.state_dict(*args, **options)

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> "StreamedBlock":
        del recurse
        self.computes = fn(self.computes)
        return self


def stream_blocks(network: nn.Module) -> None:
    """Replace the blocks of a network by streamed ones, in place."""
    network.blocks = nn.ModuleList(StreamedBlock(block) for block in network.blocks)
