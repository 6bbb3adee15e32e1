"""The shipped video network with what its blocks add reused between steps.

The first block runs at every step. Where its output has changed little since the other blocks ran
last, what they added then is added again (TeaCache, arXiv 2411.19108, and first-block caching). The
inputs run as one batch, and decide together.
"""

from copy import deepcopy
from dataclasses import replace

import torch
from torch import Tensor, nn

from diff4splat.error_time.block_caching import BlockCaching
from diff4splat.error_time.subjects import video
from diff4splat.error_time.subjects.inputs import Inputs
from diff4splat.error_time.subjects.model import shipped_model
from diff4splat.generation.settings import PIECEWISE, GenerationSettings
from diff4splat.models.blocks.rope import RopeTables
from diff4splat.models.video_dit.conditions import DitConditions


class ReusedBlocks(nn.Module):
    """Blocks of the video model that are left out where their input has hardly changed."""

    def __init__(self, blocks: nn.ModuleList, largest_change: float) -> None:
        super().__init__()
        self.blocks, self.largest_change = blocks, largest_change
        self.last: dict[int, tuple[Tensor, Tensor]] = {}
        """Per branch of guidance: input of the last run, and what was added to it."""
        self.reused = 0

    def forward(
        self, tokens: Tensor, modulation: Tensor, rope: RopeTables, conditions: DitConditions
    ) -> Tensor:
        """Tokens after all blocks, or with what these added last."""
        seen, added = self.last.get(id(conditions), (None, None))
        if seen is not None and _change(tokens, seen) < self.largest_change:
            self.reused += 1
            return tokens + added
        result = tokens
        for block in self.blocks:
            result = block(result, modulation, rope, conditions)
        self.last[id(conditions)] = (tokens, result - tokens)
        return result


@torch.no_grad()
def run(caching: BlockCaching, inputs: Inputs) -> video.Latents:
    """Latents of the inputs."""
    dit = deepcopy(shipped_model().networks.dit)
    first, *others = dit.blocks
    rest = ReusedBlocks(nn.ModuleList(others), caching.largest_change)
    dit.blocks = nn.ModuleList([first, rest])
    settings = replace(GenerationSettings(), sampler=PIECEWISE, steps=caching.steps)
    return video.sampled([(video.conditions(index), 0) for index in inputs], settings, dit)


def _change(tokens: Tensor, before: Tensor) -> float:
    return float((tokens - before).norm() / before.norm().clamp_min(1e-12))
