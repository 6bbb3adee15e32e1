"""A stage goes on from one with low-rank corrections, whatever it tunes itself."""

from pathlib import Path

import pytest
import torch
from oracles_models import randomised
from torch import nn

from diff4splat.models.adapters.lora import is_lora, merged
from diff4splat.models.adapters.tuning import prepare_tuning
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.config.tuning import Tuning
from diff4splat.models.video_dit.dit import VideoDiT
from diff4splat.training.recipe.optimizer import OptimizerSettings
from diff4splat.training.stage import Stage
from diff4splat.training.trainer.checkpoints.state_dict import run_tensors, take_over
from diff4splat.training.trainer.checkpoints.tensor_store import write_tensors
from diff4splat.training.trainer.distributed.parallel import freeze, trained_parameters
from diff4splat.training.trainer.loop.ema import WeightAverages
from diff4splat.training.trainer.loop.optim import create_optimizer

UPDATES = {"dit": 7}


class OnePart(Stage):
    trained = ("dit",)

    def __init__(self, tuning: Tuning, rank: int = 2) -> None:
        super().__init__()
        torch.manual_seed(0)
        self.dit: nn.Module = randomised(VideoDiT(tiny_size()))
        prepare_tuning(self.dit, tuning, rank)
        freeze(self)
        self.averages = WeightAverages(trained_parameters(self), 0.99)


@pytest.fixture
def checkpoint(tmp_path: Path) -> tuple[Path, dict, dict]:
    """A folder, and the merged weights, raw and averaged."""
    stage = OnePart("lora")
    with torch.no_grad():
        for number, weight in enumerate(trained_parameters(stage).values()):
            weight.normal_(0, 0.3, generator=torch.Generator().manual_seed(number))
        for average in stage.averages.averages.values():
            average.normal_(0, 0.2, generator=torch.Generator().manual_seed(99))
    optimizer = create_optimizer(trained_parameters(stage), OptimizerSettings())
    write_tensors(tmp_path / "run", run_tensors(stage, stage.averages, optimizer))
    raw = {key: value.clone() for key, value in stage.dit.state_dict().items()}
    averaged = raw | {
        key.removeprefix("dit."): value for key, value in stage.averages.averages.items()
    }
    return tmp_path / "run", raw, averaged


def entered(tuning: Tuning, rank: int, folder: Path) -> OnePart:
    stage = OnePart(tuning, rank)
    assert take_over(stage, stage.averages, folder, UPDATES) == ("dit",)
    return stage


def test_the_same_corrections_go_on(checkpoint) -> None:
    folder, raw, averaged = checkpoint
    stage = entered("lora", 2, folder)
    torch.testing.assert_close(dict(stage.dit.state_dict()), raw, rtol=0, atol=0)
    for key, value in stage.averages.averages.items():
        assert torch.equal(value, averaged[key.removeprefix("dit.")])
    assert stage.averages.updates == UPDATES


def test_full_training_goes_on_from_the_merged_weights(checkpoint) -> None:
    folder, raw, averaged = checkpoint
    stage = entered("full", 2, folder)
    torch.testing.assert_close(dict(stage.dit.state_dict()), merged(raw), rtol=0, atol=0)
    want = {f"dit.{key}": value for key, value in merged(averaged).items()}
    torch.testing.assert_close(dict(stage.averages.averages), want, rtol=0, atol=0)
    assert stage.averages.updates == UPDATES


@pytest.mark.parametrize(("tuning", "rank"), [("lora", 3), ("adapters", 2)])
def test_other_corrections_begin_on_the_merged_weights(checkpoint, tuning, rank) -> None:
    folder, raw, averaged = checkpoint
    stage = entered(tuning, rank, folder)
    found = merged(stage.dit.state_dict())
    learning = {name.removeprefix("dit.") for name in stage.averages.averages}
    for key, value in merged(averaged).items():
        want = merged(raw)[key] if key in learning else value
        torch.testing.assert_close(found[key], want, rtol=1e-6, atol=1e-6)
    corrections = [key for key in stage.dit.state_dict() if is_lora(key)]
    assert bool(corrections) == (tuning == "lora")
    ups = [stage.dit.state_dict()[key] for key in corrections if "lora_up" in key]
    assert not any(bool(up.any()) for up in ups), "fresh ones change nothing"
