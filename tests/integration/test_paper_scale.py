"""``train --config paper`` at toy width: the same commands on two processes and on one."""

import json
from dataclasses import asdict
from pathlib import Path

import pytest
import torch
from several_processes import free_port, launch

from diff4splat.cli.main import run
from diff4splat.configs.paper import paper_recipe
from diff4splat.configs.test import test_recipe as tiny_recipe
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model, load_model, save_model
from diff4splat.models.networks import PARTS
from diff4splat.training.prerequisites import last_checkpoint
from diff4splat.training.trainer.checkpoints.export import load_parts

pytestmark = pytest.mark.slow
STEPS = 2
FLOAT32 = "trainer.precision=float32"
ALONE = ("trainer.parallel=none", "trainer.recompute=false", "trainer.defer_renders=false")
"""The same training by other means: whole weights, whole graphs."""


def toy_settings() -> list[str]:
    """Overrides that make the recipe small and leave how it is carried out as it is."""
    small = tiny_recipe()
    changes = {"model": asdict(small.model), "trainer.evaluation_samples": 1}
    data = {stage.name: stage.data for stage in small.stages}
    for stage in paper_recipe().stages:
        own = {"steps": STEPS, "global_batch": 2, "micro_batch": 1, "gates": []}
        own["data"] = asdict(data[stage.name])
        own["optimizer.warmup_steps"] = 1
        own["optimizer.learning_rate"] = 1e-3
        changes |= {f"stages.{stage.name}.{key}": value for key, value in own.items()}
    return [
        part for key, value in changes.items() for part in ("--set", f"{key}={json.dumps(value)}")
    ]


def command(root: Path, stage: str, folder: str, *changes: str) -> list[str]:
    more = [part for change in (FLOAT32, *changes) for part in ("--set", change)]
    start = ["train", "--config", "paper", "--stage", stage, "--out", str(root / folder)]
    start += ["--device", "cpu", "--ignore-gates", *toy_settings(), *more]
    # The autoencoder begins with drawn weights, everything else with those of a model.
    return start if stage == "vae" else [*start, "--from-model", str(root / "model")]


def write_model(folder: Path) -> None:
    """No weight is zero, so that every weight has a gradient."""
    config = tiny_recipe().model
    networks = create_networks(config, seed=5)
    draw = torch.Generator().manual_seed(5)
    with torch.no_grad():
        for _, part in networks.parts():
            for weight in part.parameters():
                weight.add_(0.02 * torch.randn(weight.shape, generator=draw))
    save_model(Model(config=config, networks=networks, trained=frozenset(PARTS[:5])), folder)


STAGES = ("vae", "dynamic", "joint")
"""Each in a folder of its own: none begins with what rounding made of another."""


def weights(root: Path, folder: str, stage: str) -> dict[str, torch.Tensor]:
    parts = load_parts(last_checkpoint(root / folder / stage), "raw")
    return {f"{part}.{key}": value for part, found in parts.items() for key, value in found.items()}


def losses(root: Path, folder: str, stage: str) -> list[float]:
    lines = (root / folder / stage / "log.jsonl").read_text().splitlines()
    rows = [json.loads(line) for line in lines]
    return [row["loss/total"] for row in rows if row["event"] == "step"]


@pytest.fixture(scope="module")
def done(tmp_path_factory) -> Path:
    """Folder of every run: on two processes in one launch, then on this one."""
    root = tmp_path_factory.mktemp("paper")
    write_model(root / "model")
    assert run([*command(root, "dynamic", "parts", *ALONE), "--steps", "1"]) == 0
    commands = [
        *(command(root, stage, f"two-{stage}") for stage in STAGES),
        command(root, "joint", "shared", "trainer.context_parallel=2"),
        command(root, "dynamic", "parts"),
        command(root, "dynamic", "half", "trainer.precision=bfloat16"),
    ]
    pairs = [(free_port(), one) for one in commands]
    (root / "commands.json").write_text(json.dumps(pairs))
    codes = launch("paper_process.py", root / "commands.json", root / "errors.txt")
    assert codes == [0, 0], (root / "errors.txt").read_text()[-3000:]
    for stage in STAGES:
        assert run(command(root, stage, f"one-{stage}", *ALONE)) == 0
    return root


@pytest.mark.parametrize("stage", STAGES)
def test_two_processes_learn_what_one_learns(done: Path, stage: str) -> None:
    one, two = (weights(done, f"{who}-{stage}", stage) for who in ("one", "two"))
    torch.testing.assert_close(two, one, rtol=1e-5, atol=1e-5)
    first, second = (losses(done, f"{who}-{stage}", stage) for who in ("one", "two"))
    assert second == pytest.approx(first, rel=1e-5)


def test_processes_that_share_tokens_learn_the_same(done: Path) -> None:
    one, shared = weights(done, "one-joint", "joint"), weights(done, "shared", "joint")
    torch.testing.assert_close(shared, one, rtol=1e-5, atol=1e-5)
    assert losses(done, "shared", "joint") == pytest.approx(
        losses(done, "one-joint", "joint"), rel=1e-5
    )


def test_two_processes_go_on_where_one_stopped(done: Path) -> None:
    one, parts = weights(done, "one-dynamic", "dynamic"), weights(done, "parts", "dynamic")
    torch.testing.assert_close(parts, one, rtol=1e-5, atol=1e-5)


def test_half_precision_stays_close(done: Path) -> None:
    whole, half = losses(done, "two-dynamic", "dynamic"), losses(done, "half", "dynamic")
    assert half == pytest.approx(whole, rel=0.05)
    assert half != whole


def test_the_model_folder_is_whole(done: Path) -> None:
    model = load_model(done / "two-joint" / "model")
    assert model.trained >= {"dit", "ldrm", "deformation", "text_encoder"}
