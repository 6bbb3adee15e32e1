"""A stage of a few weights, and samples that are a formula: everything the trainer needs, in ms."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.distributed.tensor import DTensor

from diff4splat.errors import InputError
from diff4splat.training.recipe.data import DataSettings
from diff4splat.training.recipe.losses import AutoencoderLosses
from diff4splat.training.recipe.optimizer import OptimizerSettings
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.recipe.trainer import TrainerSettings
from diff4splat.training.stage import TOTAL, Stage
from diff4splat.training.trainer.settings import RunSettings


@dataclass(frozen=True)
class ToyBatch:
    sample_index: Tensor
    x: Tensor
    y: Tensor
    source: tuple[str, ...]

    def to(self, device: torch.device) -> "ToyBatch":
        x, y = self.x.to(device), self.y.to(device)
        return replace(self, sample_index=self.sample_index.to(device), x=x, y=y)


@dataclass(frozen=True)
class ToySamples:
    """y is a smooth function of x; the sample at an index never changes."""

    unusable: frozenset[int] = frozenset()
    nan_at: frozenset[int] = frozenset()
    far_at: frozenset[int] = frozenset()
    all_unusable: bool = False

    def __getitem__(self, sample_index: int) -> tuple[int, Tensor, Tensor]:
        if self.all_unusable or sample_index in self.unusable:
            raise InputError(f"clip {sample_index}: expected some depth, got none; skip it")
        x = torch.randn(4, generator=torch.Generator().manual_seed(sample_index))
        y = torch.stack([x.sin().sum(), x.square().sum()])
        if sample_index in self.nan_at:
            y = y * torch.nan
        return sample_index, x, y + 1000 * (sample_index in self.far_at)

    def collate(self, samples: Sequence[tuple[int, Tensor, Tensor]]) -> ToyBatch:
        indices, x, y = zip(*samples, strict=True)
        return ToyBatch(
            torch.tensor(indices),
            torch.stack(x),
            torch.stack(y),
            tuple("even" if index % 2 == 0 else "odd" for index in indices),
        )


class Body(nn.Module):
    """Blocks in a list, as networks have, and odd sizes that do not divide by two."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Linear(3, 5)
        self.blocks = nn.ModuleList([nn.Linear(5, 5) for _ in range(2)])
        self.norm = nn.LayerNorm(5)

    def forward(self, x: Tensor) -> Tensor:
        x = self.stem(x)
        for block in self.blocks:
            x = x + torch.tanh(block(x))
        return self.norm(x)


class ToyStage(Stage):
    """A frozen part, two trained ones, and one that this stage does not use at all."""

    trained = ("body", "head")

    def __init__(self, seed: int = 0) -> None:
        super().__init__()
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.eyes = nn.Sequential(nn.Linear(4, 3), nn.Dropout(0.5))
            self.body, self.head, self.unused = Body(), nn.Linear(5, 2), nn.Linear(2, 2)

    def predict(self, batch: ToyBatch) -> Tensor:
        return self.head(self.body(self.eyes(batch.x)))

    def forward(self, batch: ToyBatch) -> Mapping[str, Tensor]:
        squared = (self.predict(batch).float() - batch.y).square()
        return {TOTAL: squared.mean(1), "second": squared[:, 1]}

    def measure(self, batch: ToyBatch) -> Mapping[str, Tensor]:
        return {"psnr": -10 * (self.predict(batch).float() - batch.y).square().mean(1).log10()}

    def panel(self, batch: ToyBatch) -> Tensor:
        return self.predict(batch).float().sigmoid()[0, :1].expand(4, 6, 3)


@dataclass(frozen=True, kw_only=True)
class Toy:
    """Arguments of a run with short names; everything else as users get it."""

    steps: int = 6
    global_batch: int = 4
    micro_batch: int = 2
    workers: int = 0
    optimizer: OptimizerSettings = field(
        default_factory=lambda: OptimizerSettings(learning_rate=1e-2, warmup_steps=2)
    )
    name: str = "toy"

    def recipe(self) -> StageRecipe:
        return StageRecipe(
            name=self.name,
            kind="vae",
            steps=self.steps,
            global_batch=self.global_batch,
            micro_batch=self.micro_batch,
            trained=("body", "head"),
            losses=AutoencoderLosses(),
            optimizer=self.optimizer,
            data=DataSettings(workers=self.workers),
        )


def toy_run(folder: Path, **changes: object) -> RunSettings:
    """Settings of a call; trainer settings and run settings may be mixed."""
    trainer = TrainerSettings(evaluation_samples=3)
    own = {key: changes.pop(key) for key in list(changes) if hasattr(trainer, key)}
    settings = RunSettings(
        folder=folder, seed=0, fingerprint="f", trainer=replace(trainer, **own), timeout_s=60.0
    )
    return replace(settings, **changes)


def weights(stage: Stage) -> dict[str, Tensor]:
    """Everything in the stage, copied."""
    return {key: whole(value.detach()).clone() for key, value in stage.state_dict().items()}


def whole(tensor: Tensor) -> Tensor:
    """A sharded tensor put together."""
    return tensor.full_tensor() if isinstance(tensor, DTensor) else tensor
