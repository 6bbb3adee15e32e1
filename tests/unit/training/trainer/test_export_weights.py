"""Weights that leave the trainer."""

import pytest
import safetensors.torch
import torch
from toy_training import Toy, ToySamples, ToyStage, toy_run, weights

from diff4splat.errors import CheckpointError
from diff4splat.training.trainer.export import export_weights, load_parts
from diff4splat.training.trainer.run import run_stage


class WithBuffer(ToyStage):
    """A buffer has no average."""

    def __init__(self) -> None:
        super().__init__()
        self.body.register_buffer("count", torch.tensor([7.0]))


@pytest.fixture
def trained(tmp_path):
    stage = WithBuffer()
    result = run_stage(stage, ToySamples(), Toy().recipe(), toy_run(tmp_path / "run"))
    return stage, result.checkpoint


def test_raw_weights_are_those_of_the_stage(trained, tmp_path) -> None:
    stage, checkpoint = trained
    files = export_weights(checkpoint, tmp_path / "out", "raw")
    assert [file.name for file in files] == ["body.safetensors", "head.safetensors"]
    found = safetensors.torch.load_file(files[0])
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


def test_half_precision(trained, tmp_path) -> None:
    _, checkpoint = trained
    file = export_weights(checkpoint, tmp_path / "half", dtype=torch.float16)[1]
    found = safetensors.torch.load_file(file)["weight"]
    assert found.dtype == torch.float16
    torch.testing.assert_close(
        found.float(), load_parts(checkpoint)["head"]["weight"], rtol=1e-3, atol=1e-3
    )


def test_weights_too_large_for_half_precision_are_refused(tmp_path) -> None:
    stage = ToyStage()
    with torch.no_grad():
        stage.head.weight.fill_(1e6)
    run = toy_run(tmp_path / "run", stop_after_steps=1)
    checkpoint = run_stage(stage, ToySamples(), Toy().recipe(), run).checkpoint
    with pytest.raises(CheckpointError, match=r"finite numbers in weight as torch\.float16"):
        export_weights(checkpoint, tmp_path / "out", dtype=torch.float16)
    assert not (tmp_path / "out" / "head.safetensors").exists()


def test_a_folder_without_weights_is_refused(tmp_path) -> None:
    with pytest.raises(CheckpointError, match="expected a checkpoint with weights, got none"):
        load_parts(tmp_path)
