"""Fits in float64: the reference that float32 is held against, from parameters to checkpoint."""

from dataclasses import fields, replace
from pathlib import Path

import pytest
import torch
from small_fits import ball_capture, balls
from torch import Tensor

from diff4splat.errors import CheckpointError
from diff4splat.fitting.evaluator import mean_psnr_db
from diff4splat.fitting.fit import fit_scene
from diff4splat.fitting.fit_types import FitRequest, FitResult
from diff4splat.fitting.frames.frame_renderer import FrameRenderer
from diff4splat.fitting.frames.frame_store import FrameStore
from diff4splat.fitting.model.canonical import params_from_gaussians
from diff4splat.fitting.model.scene_model import SceneModel
from diff4splat.fitting.motions.spacetime import SpacetimeGaussians
from diff4splat.fitting.objective.step_objective import Objective
from diff4splat.fitting.settings import FitSettings, StaticDetectionSettings
from diff4splat.scene.motion.hexplane.decoder import DecoderSize
from diff4splat.scene.motion.hexplane.planes import HexPlaneSize

SETTINGS = FitSettings(
    dtype="float64",
    coarse_steps=12,
    fine_steps=12,
    views_per_step=1,
    harmonics=0,
    stillness=StaticDetectionSettings(min_score=0.0),
    planes=HexPlaneSize(space=(4, 4, 4), time=3, channels=2, multipliers=(1,)),
    decoder=DecoderSize(width=4),
    time_slices=2,
    judge_every=6,
)
MOVING = [pytest.param(motion, marks=pytest.mark.slow) for motion in ("hexplane", "spacetime")]


def fitted(folder: Path, **changes) -> FitResult:
    """A fit of the balls with changed settings."""
    settings = replace(SETTINGS, **changes)
    return fit_scene(FitRequest(capture=ball_capture(), settings=settings, folder=folder))


@pytest.mark.parametrize("motion", ["static", *MOVING])
def test_both_precisions_fit_alike(motion: str, tmp_path: Path) -> None:
    exact = fitted(tmp_path / "exact", motion=motion)
    usual = fitted(tmp_path / "usual", motion=motion, dtype="float32")
    for result, dtype in ((exact, torch.float64), (usual, torch.float32)):
        state = result.motion.state_at(result.gaussians, 0.3)
        assert {getattr(state, field.name).dtype for field in fields(state)} == {dtype}
    assert mean_psnr_db(usual.held_out) == pytest.approx(mean_psnr_db(exact.held_out), abs=0.05)
    largest = (usual.gaussians.means - exact.gaussians.means).abs().max()
    assert 0 < largest < 1e-2


@pytest.mark.parametrize("motion", ["static", *MOVING])
def test_a_checkpoint_keeps_every_bit(motion: str, tmp_path: Path) -> None:
    whole = fitted(tmp_path / "whole", motion=motion)
    settings = replace(SETTINGS, motion=motion)
    request = FitRequest(capture=ball_capture(), settings=settings, folder=tmp_path / "parts")
    fit_scene(replace(request, stop_after_s=0.0))
    with pytest.raises(CheckpointError, match="another --out"):
        fit_scene(replace(request, settings=replace(settings, dtype="float32")))
    parts = fit_scene(request)
    assert torch.equal(parts.gaussians.means, whole.gaussians.means)


@pytest.mark.parametrize(
    "name",
    [
        "means",
        "velocities",
        *(
            pytest.param(n, marks=pytest.mark.slow)
            for n in ("log_scales", "quats", "opacity_logits")
        ),
    ],
)
def test_gradients_of_a_step_are_those_of_its_loss(name: str) -> None:
    capture = ball_capture(views=2, times=2, held=())
    settings = replace(SETTINGS, motion="spacetime")
    shifted = balls(0.1)
    # At the truth itself, absolute errors have no derivative.
    rows = params_from_gaussians(replace(shifted, means=shifted.means + 0.013), 0)
    moving = torch.ones(5, dtype=torch.bool)
    motion = SpacetimeGaussians((0.0, 1.0), 0.1)
    model = SceneModel(rows, motion, moving, dtype=torch.float64)
    objective = Objective(
        renderer=FrameRenderer(capture=capture),
        store=FrameStore(capture, dtype=torch.float64),
        settings=settings,
    )

    def loss(value: Tensor) -> Tensor:
        model.table._leaves[name] = value
        return objective.loss(model, 1.0, [1, 3], 0).loss

    start = model.table[name].detach().clone().requires_grad_()
    assert torch.autograd.gradcheck(loss, (start,), eps=1e-7, atol=1e-5, rtol=1e-3)
