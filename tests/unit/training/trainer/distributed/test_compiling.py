"""Stages whose networks run through torch.compile."""

import subprocess
import sys
from pathlib import Path

import pytest
import torch
from depth_stages import MODEL, depth_recipe
from stage_fixtures import make_stage, stage_recipe

from diff4splat.errors import ConfigError
from diff4splat.training.recipe.trainer import TrainerSettings
from diff4splat.training.stage import Stage
from diff4splat.training.trainer.distributed import parallel
from diff4splat.training.trainer.distributed.compiling import compile_networks
from diff4splat.training.trainer.distributed.parallel import parallelise
from diff4splat.training.trainer.distributed.processes import Processes

SUPPORT = Path(__file__).parents[4] / "support"
PROGRAM = """
import torch
from depth_stages import MODEL, depth_recipe, with_sky
from stage_fixtures import make_batch, make_stage, shake_heads
from diff4splat.training.trainer.distributed.compiling import compile_networks

torch.set_num_threads(1)
recipe = depth_recipe()
stage, batch = make_stage(recipe, model=MODEL), with_sky(make_batch(recipe, (0, 1)))
shake_heads(stage)
trained = [parameter for parameter in stage.parameters() if parameter.requires_grad]

def learnt():
    total = stage(batch)["total"]
    return total, torch.autograd.grad(total.sum(), trained)

names, (wanted, gradients) = list(stage.state_dict()), learnt()
compile_networks(stage)
found, others = learnt()
assert torch._dynamo.utils.counters["stats"]["unique_graphs"] == 1
assert list(stage.state_dict()) == names
torch.testing.assert_close(found, wanted, rtol=1e-4, atol=1e-5)
torch.testing.assert_close(others, gradients, rtol=1e-3, atol=1e-5)
"""


@pytest.mark.slow
def test_a_compiled_network_tells_the_same_and_learns_the_same() -> None:
    # In a process of its own: here every call is checked against its annotations.
    header = f"import sys; sys.path.insert(0, {str(SUPPORT)!r})\n"
    done = subprocess.run(
        [sys.executable, "-c", header + PROGRAM], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_compiling_without_a_compiler_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CXX", "no-such-compiler")
    with pytest.raises(ConfigError, match="got no no-such-compiler; install one"):
        compile_networks(make_stage(depth_recipe(), model=MODEL))


def test_the_setting_compiles_before_training(monkeypatch: pytest.MonkeyPatch) -> None:
    compiled: list[Stage] = []
    monkeypatch.setattr(parallel, "compile_networks", compiled.append)
    stage, alone = (
        make_stage(depth_recipe(), model=MODEL),
        Processes(rank=0, count=1, device=torch.device("cpu")),
    )
    parallelise(stage, alone, TrainerSettings())
    assert not compiled
    parallelise(stage, alone, TrainerSettings(compile=True))
    assert compiled == [stage]


def test_a_stage_that_names_nothing_to_compile_runs_as_it_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("CXX", "no-such-compiler")
    compile_networks(make_stage(stage_recipe("dynamic")))
