"""A block whose weights stay where and as they are stored, until the block runs.

Public weights are larger than the memory of many machines. They are mapped from their file, often
in half precision. A block copies its own to the device and to the type of the computation, runs,
and lets the copies go: memory holds one block in full, whatever the number of blocks. On a GPU with
room for them, blocks keep their weights there, as they are stored.
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
        self.kept: dict[str, Tensor] | None = None
        """Weights on the device of the computation, in their stored type."""

    def forward(self, *inputs: Any) -> Any:
        """The block's own output."""
        target = {"device": self.computes.device, "dtype": self.computes.dtype}
        stored = dict(self.block.named_parameters()) if self.kept is None else self.kept
        weights = {name: value.to(**target) for name, value in stored.items()}
        return functional_call(self.block, weights, inputs)

    def keep(self) -> None:
        """Keep the weights where the computation is."""
        device = self.computes.device
        self.kept = {name: value.to(device) for name, value in self.block.named_parameters()}

    @property
    def stored_bytes(self) -> int:
        """What keeping takes."""
        return sum(value.nbytes for value in self.block.parameters())

    @property
    def largest_copy_bytes(self) -> int:
        """What one run takes."""
        return sum(map(torch.numel, self.block.parameters())) * self.computes.element_size()

    def state_dict(self, *args: Any, **options: Any) -> dict[str, Any]:
        """The block's own, under the names that it has without streaming."""
        return self.block.state_dict(*args, **options)

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> "StreamedBlock":
        del recurse
        before, self.computes = self.computes.device, fn(self.computes)
        if self.computes.device != before:
            self.kept = None
        return self


def stream_blocks(network: nn.Module) -> None:
    """Replace the blocks of a network by streamed ones, in place."""
    network.blocks = nn.ModuleList(StreamedBlock(block) for block in network.blocks)
