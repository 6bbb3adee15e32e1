"""Which streamed blocks keep their weights on a GPU: as many as it has room for."""

from collections.abc import Iterable

import torch
from torch import nn

from diff4splat.models.blocks.streamed_block import StreamedBlock

SHARE = 0.6
"""Of the free memory; activations and the autoencoder's frames need the rest."""


def keep_blocks(parts: Iterable[nn.Module], device: torch.device) -> int:
    """Keep blocks of the parts on a CUDA device, in their order; returns how many are kept.

    Elsewhere mapped weights are as near as they can be, and nothing is kept.
    """
    if device.type != "cuda":
        return 0
    free, _ = torch.cuda.mem_get_info(device)
    return keep_within(parts, int(SHARE * free))


def keep_within(parts: Iterable[nn.Module], budget_bytes: int) -> int:
    """The same for a number of bytes, of which one block's copy must stay free."""
    blocks = [one for part in parts for one in part.modules() if isinstance(one, StreamedBlock)]
    left = budget_bytes - max((one.largest_copy_bytes for one in blocks), default=0)
    kept = 0
    for block in blocks:
        size = 0 if block.kept is not None else block.stored_bytes
        if size > left:
            break
        if block.kept is None:
            block.keep()
        left, kept = left - size, kept + 1
    return kept
