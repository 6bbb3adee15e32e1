"""Two processes share the tokens of a sample, and the weights of a network."""

import json
from pathlib import Path

import pytest
import torch
from several_processes import launch
from sharing_process import WIDE, outputs_and_gradients

from diff4splat.models.factory import parameter_counts

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("sharing")
    codes = launch("sharing_process.py", root, root / "errors.txt")
    assert codes == [0, 0], (root / "errors.txt").read_text()[-3000:]
    return root


@pytest.mark.parametrize("name", ["dit", "ldrm"])
def test_shared_tokens_give_the_outputs_and_gradients_of_one_process(done: Path, name: str) -> None:
    alone = outputs_and_gradients(None, name)
    for rank in range(2):
        shared = torch.load(done / f"{name}-{rank}.pt", weights_only=True)
        torch.testing.assert_close(shared, alone, rtol=1e-10, atol=1e-10)
    idle = [key for key, value in alone.items() if not value.any()]
    assert not idle, "every value counts"


@pytest.mark.parametrize("rank", [0, 1])
def test_no_process_ever_holds_all_weights(done: Path, rank: int) -> None:
    found = json.loads((done / f"memory-{rank}.json").read_text())
    whole = 4 * parameter_counts(WIDE)["dit"]
    block = whole / WIDE.dit.blocks
    assert found["held"] == pytest.approx(whole / 2, rel=0.01)
    assert found["peak"] < whole / 2 + block
    assert found["same"], "as drawn by one process, to the bit"
