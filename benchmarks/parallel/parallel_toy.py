"""The stage that ``parallel.py`` measures by default."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from diff4splat.training.recipe.losses import AutoencoderLosses
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.stage import TOTAL, Stage

WIDTH, BLOCKS = 1024, 12


@dataclass(frozen=True)
class ToyBatch:
    sample_index: Tensor
    noise: Tensor

    def to(self, device: torch.device) -> "ToyBatch":
        return ToyBatch(self.sample_index.to(device), self.noise.to(device))


class ToySamples:
    def __getitem__(self, sample_index: int) -> tuple[int, Tensor]:
        generator = torch.Generator().manual_seed(sample_index)
        return sample_index, torch.randn(64, WIDTH, generator=generator)

    def collate(self, samples: Sequence[tuple[int, Tensor]]) -> ToyBatch:
        indices, noise = zip(*samples, strict=True)
        return ToyBatch(torch.tensor(indices), torch.stack(noise))


class Block(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.mix = nn.Linear(WIDTH, WIDTH)

    def forward(self, x: Tensor) -> Tensor:
        return x + self.mix(x).tanh()


class Blocks(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.blocks = nn.ModuleList([Block() for _ in range(BLOCKS)])

    def forward(self, x: Tensor) -> Tensor:
        for block in self.blocks:
            x = block(x)
        return x


class ToyStage(Stage):
    trained = ("body",)

    def __init__(self) -> None:
        super().__init__()
        torch.manual_seed(0)
        self.body = Blocks()

    def forward(self, batch: ToyBatch) -> Mapping[str, Tensor]:
        return {TOTAL: (self.body(batch.noise) - batch.noise).square().mean((1, 2))}


def toy_recipe() -> StageRecipe:
    """Four samples per step, in micro batches of two."""
    return StageRecipe(
        name="toy",
        kind="vae",
        steps=10,
        global_batch=4,
        micro_batch=2,
        trained=("body",),
        losses=AutoencoderLosses(),
    )
