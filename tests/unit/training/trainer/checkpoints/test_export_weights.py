"""Weights that leave the trainer."""

import pytest
import torch
from toy_training import Toy, ToySamples, ToyStage, toy_run, weights

from diff4splat.errors import CheckpointError
from diff4splat.training.trainer.checkpoints.export import load_parts
from diff4splat.training.trainer.loop.fit import fit_stage


class WithBuffer(ToyStage):
    """A buffer has no average."""

    def __init__(self) -> None:
        super().__init__()
        self.body.register_buffer("count", torch.tensor([7.0]))


@pytest.fixture
def trained(tmp_path):
    stage = WithBuffer()
    result = fit_stage(stage, ToySamples(), Toy().recipe(), toy_run(tmp_path / "run"))
    return stage, result.checkpoint


def test_raw_weights_are_those_of_the_stage(trained) -> None:
    stage, checkpoint = trained
    parts = load_parts(checkpoint, "raw")
    assert sorted(parts) == ["body", "head"]
    found = parts["body"]
    assert set(found) == set(stage.body.state_dict())
    for key, value in found.items():
        assert torch.equal(value, weights(stage)[f"body.{key}"]), key


def test_averaged_weights_differ_and_load_strictly(trained) -> None:
    stage, checkpoint = trained
    parts = load_parts(checkpoint)
    assert not torch.equal(parts["head"]["weight"], stage.head.weight)
    assert parts["body"]["count"].tolist() == [7.0]
    stage.body.load_state_dict(parts["body"])
    stage.head.load_state_dict(parts["head"])


def test_a_folder_without_weights_is_refused(tmp_path) -> None:
    with pytest.raises(CheckpointError, match="expected a checkpoint with weights, got none"):
        load_parts(tmp_path)
