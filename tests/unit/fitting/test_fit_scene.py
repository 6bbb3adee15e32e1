"""Small scenes fitted from start to end: motion helps, stops are no loss, divergence is caught."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from small_fits import ball_capture, balls

from diff4splat.errors import CheckpointError, DivergenceError, InputError
from diff4splat.fitting.evaluator import mean_psnr_db
from diff4splat.fitting.fit import fit_scene
from diff4splat.fitting.fit_types import FitRequest, FitResult
from diff4splat.fitting.model.model_init import static_model
from diff4splat.fitting.model.scene_bounds import scene_bounds
from diff4splat.fitting.settings import (
    DensitySettings,
    FitSettings,
    LearningRates,
    LogLinearDecay,
    StaticDetectionSettings,
)
from diff4splat.paths.camera_path import CameraPath
from diff4splat.scene.motion.hexplane.decoder import DecoderSize
from diff4splat.scene.motion.hexplane.planes import HexPlaneSize
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Provenance, Scene

pytestmark = pytest.mark.usefixtures("module_as_shipped")
SLOW = pytest.mark.slow
SETTINGS = FitSettings(
    coarse_steps=40,
    fine_steps=80,
    harmonics=0,
    stillness=StaticDetectionSettings(min_score=0.01),
    rates=LearningRates(
        planes=LogLinearDecay(first=5e-2, last=1e-2), decoder=LogLinearDecay(first=1e-2, last=1e-3)
    ),
    planes=HexPlaneSize(space=(8, 8, 8), time=4, channels=4, multipliers=(1,)),
    decoder=DecoderSize(width=16),
    checkpoint_every=20,
    judge_every=60,
    time_slices=3,
)


def run(folder: Path, **changes) -> FitRequest:
    capture = changes.pop("capture", None) or ball_capture()
    options = {name: changes.pop(name) for name in ("init", "stop_after_s") if name in changes}
    return FitRequest(
        capture=capture, settings=replace(SETTINGS, **changes), folder=folder, **options
    )


@pytest.fixture(scope="module")
def stood(tmp_path_factory) -> FitResult:
    return fit_scene(run(tmp_path_factory.mktemp("stood"), motion="static"))


@pytest.fixture(scope="module", params=["spacetime", pytest.param("hexplane", marks=SLOW)])
def moved(request, tmp_path_factory) -> FitResult:
    return fit_scene(run(tmp_path_factory.mktemp("moved"), motion=request.param))


def test_a_motion_shows_held_out_views_better_than_a_standing_scene(
    moved: FitResult, stood: FitResult
):
    assert isinstance(stood.motion, StaticMotion)
    assert mean_psnr_db(moved.held_out) > mean_psnr_db(stood.held_out) + 1
    assert moved.finished and len(moved.held_out) == 4
    assert 0 < len(moved.motion.moving_index) <= len(moved.gaussians)


@pytest.mark.parametrize("motion", ["spacetime", pytest.param("hexplane", marks=SLOW)])
def test_a_stopped_fit_goes_on_to_the_same_scene(motion: str, tmp_path: Path, monkeypatch):
    steps = {"motion": motion, "coarse_steps": 20, "fine_steps": 30}
    whole = fit_scene(run(tmp_path / "whole", **steps))
    for stop in (("coarse", 13), ("fine", 7)):
        interrupt_at(monkeypatch, *stop)
        with pytest.raises(KeyboardInterrupt):
            fit_scene(run(tmp_path / "parts", **steps))
        monkeypatch.undo()
    parts = fit_scene(run(tmp_path / "parts", **steps))
    torch.testing.assert_close(parts.gaussians.means, whole.gaussians.means, rtol=0, atol=0)
    assert torch.equal(parts.motion.moving_index, whole.motion.moving_index)


def interrupt_at(monkeypatch, stage: str, step: int) -> None:
    from diff4splat.fitting.stage_loop import StageLoop

    original = StageLoop._take_step

    def stopping(self) -> None:
        if self.stage.name == stage and self.step == step:
            raise KeyboardInterrupt
        original(self)

    monkeypatch.setattr(StageLoop, "_take_step", stopping)


def test_time_up_saves_and_says_so(tmp_path: Path):
    steps = {"coarse_steps": 5, "fine_steps": 5}
    result = fit_scene(run(tmp_path, stop_after_s=0.0, **steps))
    assert not result.finished
    assert (tmp_path / "checkpoint.safetensors").exists()
    assert fit_scene(run(tmp_path, **steps)).finished


def test_another_fit_in_the_same_folder_is_refused(tmp_path: Path):
    fit_scene(run(tmp_path, coarse_steps=5, fine_steps=5))
    with pytest.raises(CheckpointError, match="another --out"):
        fit_scene(run(tmp_path, coarse_steps=5, fine_steps=6))


def test_divergence_keeps_the_last_good_state(tmp_path: Path, monkeypatch):
    from diff4splat.fitting.objective.step_objective import Objective

    original, calls = Objective.loss, [0]

    def breaking(self, *arguments):
        calls[0] += 1
        step = original(self, *arguments)
        return step._replace(loss=step.loss * float("nan")) if calls[0] > 130 else step

    monkeypatch.setattr(Objective, "loss", breaking)
    with pytest.raises(DivergenceError, match=r"state of step \d+ is kept"):
        fit_scene(run(tmp_path, coarse_steps=400))
    monkeypatch.undo()
    from diff4splat.fitting.checkpoints.checkpoint import load_checkpoint
    from diff4splat.fitting.checkpoints.fingerprint import fingerprint

    asked = run(tmp_path, coarse_steps=400)
    kept = load_checkpoint(tmp_path, fingerprint(asked.capture, asked.settings, None))
    assert kept.step == 100
    assert all(bool(torch.isfinite(value).all()) for value in kept.tensors.values())


def test_gradients_that_stay_broken_end_the_fit_too(tmp_path: Path, monkeypatch):
    from diff4splat.fitting.stage_loop import StageLoop

    monkeypatch.setattr(StageLoop, "_gradients_finite", lambda self: False)
    with pytest.raises(DivergenceError, match="steps in a row"):
        fit_scene(run(tmp_path, coarse_steps=40))


def test_without_checks_for_stillness_the_fine_stage_still_runs(tmp_path: Path):
    without = replace(SETTINGS.stillness, checks=())
    fit_scene(run(tmp_path, coarse_steps=5, fine_steps=20, judge_every=20, stillness=without))
    log = [json.loads(line) for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    assert [(line["stage"], line["step"]) for line in log] == [("fine", 20)]


def test_a_few_broken_images_cost_their_steps_only(tmp_path: Path):
    capture = ball_capture()
    capture.frames.shown[0].rgb[3, 3] = float("nan")
    result = fit_scene(run(tmp_path, capture=capture, coarse_steps=30, fine_steps=10))
    assert result.finished
    assert bool(torch.isfinite(result.gaussians.means).all())


def test_a_ready_scene_can_be_refined(tmp_path: Path):
    capture = ball_capture()
    first = int((~capture.held_out).nonzero()[0])
    pose = capture.cameras[first : first + 1]
    scene = Scene(
        gaussians=balls(0.5).to(torch.float32),
        motion=StaticMotion(time_range_s=(0.0, 1.0)),
        path=CameraPath(cameras=pose, times_s=torch.zeros(1).double()),
        provenance=Provenance(generator="test"),
    )
    result = fit_scene(run(tmp_path, init=scene, fine_steps=60))
    log = [json.loads(line) for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    assert {line["stage"] for line in log} == {"fine"}
    assert mean_psnr_db(result.held_out) > 24


def test_one_standing_camera_without_depth_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match="at least two places"):
        fit_scene(run(tmp_path, capture=ball_capture(views=1, held=(), with_depth=False)))


def test_nothing_held_out_is_said_and_fitted(tmp_path: Path):
    result = fit_scene(run(tmp_path, capture=ball_capture(held=()), coarse_steps=5, fine_steps=5))
    assert result.held_out == [] and str(result.split).endswith("nothing held out")


def test_a_fit_starts_within_its_budget() -> None:
    capture = ball_capture(views=3, times=1)
    few = replace(SETTINGS, density=DensitySettings(budget=17))
    assert len(static_model(capture, scene_bounds(capture), few)) <= 17
