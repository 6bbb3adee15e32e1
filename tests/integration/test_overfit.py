"""Every stage overfits one clip through the real trainer: its loss falls to a tenth.

The tests that always run take fewer steps, with a looser limit. Noise, levels and targets differ at
every step; only the clip is the same. In stages with motion the paper's pull to zero motion is off:
its minimum is far above zero by design (see the last test).
"""

import json
import statistics
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from oracles_clips import make_clip
from stage_fixtures import STAGES, make_stage, stage_recipe

from diff4splat.data.clip import Clip
from diff4splat.training.batches.samples import ClipSamples
from diff4splat.training.losses.motion import track_motion
from diff4splat.training.recipe.optimizer import OptimizerSettings
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.recipe.trainer import TrainerSettings
from diff4splat.training.stage import TOTAL
from diff4splat.training.trainer.loop.fit import fit_stage
from diff4splat.training.trainer.settings import RunSettings

STEPS = {"vae": 600, "dynamic": 400, "video_diffusion": 300, "joint": 400}
USUAL_STEPS = 150
SHORT_STEPS = {
    "vae": (50, 0.45),
    "static-low": (40, 0.12),
    "static-high": (40, 0.12),
    "dynamic": (190, 0.28),
    "video_diffusion": (100, 0.45),
    "joint": (80, 0.5),
}
"""Steps and the share of the first loss that may remain.

More remains when cameras are exchanged, when motion is not rendered or when the noise is not that
of the target.
"""
SHORT_STAGES = [
    name if name in ("vae", "static-low") else pytest.param(name, marks=pytest.mark.slow)
    for name in STAGES
]
"""``dynamic`` and ``joint``, in which deformation learns, and diffusion are slow."""
TARGET_FRAMES = 4
"""Views and times per step: with fewer, the loss of a step says more of them than of the scene."""


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    """Images this small are not worth waking a second thread for: it costs several times more."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


class OneClip:
    """The same clip for every index."""

    def __init__(self, recipe: StageRecipe) -> None:
        data, static = recipe.data, recipe.kind == "static"
        self.made = make_clip(
            frames=data.frames, size_px=data.size_px, views=data.views, static=static, tracks=24
        )

    def clip(self, index: int) -> Clip:
        del index
        return self.made


def overfit(name: str, steps: int, folder: Path) -> list[float]:
    """The total loss of every step."""
    recipe = stage_recipe(name)
    if name in ("dynamic", "joint"):
        motion = replace(recipe.losses.motion, displacement_l1=0.0)
        recipe = replace(recipe, losses=replace(recipe.losses, motion=motion))
    recipe = replace(
        recipe,
        data=replace(recipe.data, target_frames=TARGET_FRAMES),
        steps=steps,
        global_batch=1,
        optimizer=OptimizerSettings(learning_rate=7e-3, warmup_steps=10, weight_decay=0.0),
    )
    trainer = TrainerSettings(evaluation_samples=0, checkpoint_every=10_000, spike_factor=0.0)
    settings = RunSettings(
        folder=folder, seed=0, fingerprint="overfit", trainer=trainer, device="cpu"
    )
    samples = ClipSamples(recipe, 0, [OneClip(recipe)])
    fit_stage(make_stage(recipe), samples, recipe, settings)
    rows = [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]
    return [row[f"loss/{TOTAL}"] for row in rows if row["event"] == "step"]


def remaining(losses: list[float], last: int) -> float:
    """The mean loss of the last steps over that of the first five."""
    return statistics.mean(losses[-last:]) / statistics.mean(losses[:5])


@pytest.mark.usefixtures("as_shipped")
@pytest.mark.parametrize("name", SHORT_STAGES)
def test_the_loss_of_one_clip_falls(name: str, tmp_path: Path) -> None:
    steps, limit = SHORT_STEPS[name]
    losses = overfit(name, steps, tmp_path)
    assert len(losses) == steps
    assert remaining(losses, last=10) <= limit


@pytest.mark.slow
@pytest.mark.usefixtures("as_shipped")
@pytest.mark.parametrize("name", STAGES)
def test_one_clip_is_learnt_by_heart(name: str, tmp_path: Path) -> None:
    losses = overfit(name, STEPS.get(name, USUAL_STEPS), tmp_path)
    assert remaining(losses, last=20) <= 0.1


def test_the_papers_motion_loss_cannot_fall_to_a_tenth() -> None:
    """At the truth it is still ‖Δx‖₁ of the 2 ‖Δx‖₂ that standing still costs: at least half."""
    truth = torch.randn(1, 64, 3, generator=torch.Generator().manual_seed(0))
    valid = torch.ones(1, 64, dtype=torch.bool)
    reached = track_motion(truth, truth, valid)
    still = track_motion(torch.zeros_like(truth), truth, valid)
    assert float(reached / still) > 0.5
