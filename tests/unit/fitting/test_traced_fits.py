"""Small scenes fitted by rays: cameras are recovered, stops are no loss, unseen pixels no error."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
import torch
from small_fits import Images, ball_capture
from traced_fits import COUNT, flight, gaussians, photographed, said, scene

from diff4splat.data.capture.capture import Capture
from diff4splat.errors import ConfigError
from diff4splat.fitting.evaluator import Evaluator
from diff4splat.fitting.fit import fit_scene
from diff4splat.fitting.fit_types import FitRequest
from diff4splat.fitting.frames import frame_renderer
from diff4splat.fitting.frames.frame_renderer import FrameRenderer
from diff4splat.fitting.frames.frame_schedule import FrameSchedule
from diff4splat.fitting.frames.frame_store import FrameStore
from diff4splat.fitting.model.canonical import params_from_gaussians
from diff4splat.fitting.model.model_init import field_bounds
from diff4splat.fitting.model.scene_model import SceneModel
from diff4splat.fitting.model.static_detection import error_variation
from diff4splat.fitting.motions.hexplane import HexPlaneField
from diff4splat.fitting.motions.protocol import LearnedMotion
from diff4splat.fitting.motions.spacetime import SpacetimeGaussians
from diff4splat.fitting.motions.static import NoMotion
from diff4splat.fitting.objective.gradient_statistics import ndc_scale, pinhole_ndc_scale
from diff4splat.fitting.objective.step_objective import Objective
from diff4splat.fitting.optics.learned import LearnedOptics
from diff4splat.fitting.settings import (
    CameraSettings,
    FitSettings,
    LearningRates,
    LossWeights,
    StaticDetectionSettings,
)
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.optics import Aperture, Optics, Shutter
from diff4splat.render.settings import RenderOutput
from diff4splat.scene.gaussians import Gaussians

FISHEYE = Optics(lens=OpenCVFisheye(coefficients=torch.zeros(4), max_angle_rad=0.45))
READOUT_S = 0.2
SETTINGS = FitSettings(
    coarse_steps=10, fine_steps=20, harmonics=0, stillness=StaticDetectionSettings(min_score=0.0),
    camera=CameraSettings(samples=2, shown_samples=2, start=2), checkpoint_every=100,
)  # fmt: skip


@cache
def fisheye() -> Capture:
    return photographed(scene(), FISHEYE)


def rolling(optics: Optics | None = None) -> Capture:
    capture = photographed(scene(flight()), Optics(shutter=Shutter(readout_s=READOUT_S)))
    return said(capture, optics) if optics else capture


def motions() -> dict[str, LearnedMotion]:
    field = HexPlaneField(
        (SETTINGS.planes, SETTINGS.decoder), field_bounds(gaussians().means), (0.0, 1.0), 0
    )
    return {
        "still": NoMotion((0.0, 1.0)),
        "pulses": SpacetimeGaussians((0.0, 1.0), 0.1),
        "field": field,
    }


def model_of(motion: LearnedMotion, optics: LearnedOptics | None = None) -> SceneModel:
    rows = params_from_gaussians(gaussians(), 0)
    moves = torch.full((COUNT,), not isinstance(motion, NoMotion))
    return SceneModel(rows, motion, moves, optics)


def objective(capture: Capture, **camera) -> Objective:
    settings = replace(SETTINGS, camera=replace(SETTINGS.camera, **camera), weights=LossWeights())
    renderer = FrameRenderer(capture=capture, settings=settings.camera)
    return Objective(renderer=renderer, store=FrameStore(capture), settings=settings)


@pytest.mark.parametrize("name", ["still", "pulses", "field"])
def test_every_motion_learns_from_rows_that_have_times_of_their_own(name: str):
    made = model_of(motions()[name])
    loss, means, lengths = objective(rolling()).loss(made, 0.4, [0, 2], 0)
    loss.backward()
    assert float(loss.detach()) > 0 and bool((means.grad.norm(dim=-1) > 0).any())
    assert lengths.shape == (COUNT,) and bool((lengths > 0).all())
    learned = {"pulses": "velocities", "field": "position.1.bias"}.get(name)
    if learned is not None:
        wanted = [one for one in made.table.names if one.startswith(learned[:10])]
        assert any(
            made.table[one].grad is not None and bool(made.table[one].grad.any()) for one in wanted
        )


def test_the_read_out_is_recovered_while_the_scene_is_known():
    capture = rolling(Optics(shutter=Shutter(readout_s=0.5 * READOUT_S)))
    parts = LearnedOptics(capture, ("readout",))
    made, goal = model_of(motions()["pulses"], parts), objective(capture, learn=("readout",))
    with torch.no_grad():
        made.table["velocities"].copy_(flight().velocities)
    schedule = FrameSchedule(capture, 1, 0)
    for number in range(4, 34):
        goal.loss(made, *schedule.frames(number), 0, number).loss.backward()
        made.table.step({"camera_readout": LearningRates().readout.at(number / 34) * 4})
        made.clamp_params()
    found = parts.report(made.table)["readout"]
    assert found["start"] == pytest.approx(0.5 * READOUT_S)
    assert found["recovered"] == pytest.approx(READOUT_S, rel=0.1)


def test_cameras_wait_until_the_scene_is_there():
    capture = rolling()
    made = model_of(motions()["pulses"], LearnedOptics(capture, ("readout",)))
    goal = objective(capture, learn=("readout",), start=7)
    with torch.no_grad():
        made.table["velocities"].copy_(flight().velocities + 0.3)
    goal.loss(made, 0.4, [0], 0, number=6).loss.backward()
    assert made.table["camera_readout"].grad is None
    goal.loss(made, 0.4, [0], 0, number=7).loss.backward()
    assert float(made.table["camera_readout"].grad.abs()) > 0


@pytest.mark.slow
def test_a_stopped_fit_that_learns_cameras_goes_on_exactly(tmp_path: Path, monkeypatch):
    optics = Optics(
        lens=OpenCVFisheye(coefficients=torch.zeros(4)),
        aperture=Aperture(radius=0.05, focus_distance=2.0),
        shutter=Shutter(readout_s=0.1),
    )
    camera = replace(SETTINGS.camera, learn=("lens", "focus", "readout", "focal"))
    settings = replace(SETTINGS, motion="spacetime", camera=camera, coarse_steps=5, fine_steps=5)
    capture = photographed(scene(flight()), optics)

    def run(folder: str):
        return fit_scene(FitRequest(capture=capture, settings=settings, folder=tmp_path / folder))

    whole = run("whole")
    for stage, step in (("coarse", 3), ("fine", 3)):
        interrupt_at(monkeypatch, stage, step)
        with pytest.raises(KeyboardInterrupt):
            run("parts")
        monkeypatch.undo()
    parts = run("parts")
    assert torch.equal(parts.gaussians.means, whole.gaussians.means)
    assert parts.learned == whole.learned
    for name, found in whole.learned.items():
        assert found["recovered"] != found["start"], name


def interrupt_at(monkeypatch, stage: str, step: int) -> None:
    from diff4splat.fitting.stage_loop import StageLoop

    original = StageLoop._take_step

    def stopping(self) -> None:
        if self.stage.name == stage and self.step == step:
            raise KeyboardInterrupt
        original(self)

    monkeypatch.setattr(StageLoop, "_take_step", stopping)


def test_pixels_that_the_lens_does_not_see_have_no_part():
    capture = fisheye()
    goal, made = objective(capture), model_of(NoMotion((0.0, 1.0)))
    loss = goal.loss(made, 0.4, [0], 0).loss.detach()
    evaluator = Evaluator(renderer=goal.renderer, store=goal.store)
    quality = evaluator.frames(made.scene(0, goal.renderer.path), None, [0])[0]
    seen = evaluator.image(made.scene(0, goal.renderer.path), None, 0)[1]
    assert 0 < int((~seen).sum()) < seen.numel()
    spoilt = [
        replace(frame, rgb=torch.where(seen[..., None], frame.rgb, 1.0))
        for frame in capture.frames.shown
    ]
    other = objective(replace(capture, frames=Images(shown=spoilt)))
    assert float(other.loss(made, 0.4, [0], 0).loss.detach()) == float(loss) < 0.01
    evaluator = Evaluator(renderer=other.renderer, store=other.store)
    assert (
        evaluator.frames(made.scene(0, goal.renderer.path), None, [0])[0].psnr_db == quality.psnr_db
    )


def test_samples_differ_from_step_to_step_and_not_from_run_to_run():
    aperture = Aperture(radius=0.3, focus_distance=1.0)
    goal, made = objective(photographed(scene(), Optics(aperture=aperture))), None
    made = model_of(NoMotion((0.0, 1.0)))
    losses = [goal.loss(made, 0.4, [0], 0, step).loss.detach() for step in (1, 1, 2)]
    first, again, other = map(float, losses)
    assert first == again != other


def test_half_an_image_is_as_long_for_rays_as_for_the_rasteriser():
    capture = ball_capture(views=1, times=1, held=())
    pose = capture.cameras.world_from_camera[0].float()
    ahead = pose[:3, 3] + pose[:3, 2] * torch.tensor([[1.0], [3.0], [-2.0]])
    flat = pinhole_ndc_scale(ahead, capture.cameras)
    torch.testing.assert_close(
        ndc_scale(ahead, [capture.physical_camera(0)], 0.0), flat, rtol=1e-3, atol=0
    )


def test_who_moves_is_found_through_a_lens_too():
    lens = Optics(lens=OpenCVFisheye(coefficients=torch.zeros(4)))
    motion = replace(
        flight(), moving_index=torch.tensor([3]), velocities=flight().velocities[:1],
        time_centers_s=torch.tensor([0.5]), time_deviations_s=torch.tensor([10.0]),
    )  # fmt: skip
    capture = photographed(scene(motion), lens, views=4, times_s=(0.0, 0.5, 1.0))
    renderer = FrameRenderer(capture=capture)
    varies = error_variation(
        scene(motion).state_at(0.5), renderer, FrameStore(capture), FrameSchedule(capture, 2, 0)
    )
    assert int(varies.argmax()) == 3


@pytest.mark.parametrize("backend", ["raster", "reference", "gsplat"])
def test_a_rasteriser_is_refused_for_cameras_with_effects(backend: str):
    with pytest.raises(ConfigError, match="expected 'trace' or 'auto'"):
        FrameRenderer(capture=fisheye(), backend=backend)
    plain = said(fisheye(), None)
    assert not FrameRenderer(capture=plain, backend=backend).traced
    with pytest.raises(ConfigError, match="to learn focal"):
        FrameRenderer(capture=plain, backend=backend, settings=CameraSettings(learn=("focal",)))


def test_rays_are_followed_where_they_are_needed_or_asked_for():
    capture = fisheye()
    assert FrameRenderer(capture=capture).traced
    plain = said(capture, None)
    assert not FrameRenderer(capture=plain).traced
    assert FrameRenderer(capture=plain, backend="trace").traced
    shut = said(capture, Optics(shutter=Shutter(readout_s=0.0)))
    assert not FrameRenderer(capture=shut).traced


def test_flow_is_refused_through_optics():
    capture = fisheye()
    settings = replace(SETTINGS, weights=LossWeights(flow=1.0))
    with pytest.raises(ConfigError, match="flow is that of pinholes"):
        Objective(
            renderer=FrameRenderer(capture=capture), store=FrameStore(capture), settings=settings
        )


def test_residuals_come_from_other_samples_than_gradients(monkeypatch: pytest.MonkeyPatch):
    aperture = Aperture(radius=0.2, focus_distance=1.5)
    capture, seeds, learn = (
        photographed(scene(), Optics(aperture=aperture)),
        [],
        FrameRenderer.learn,
    )

    def noted(self, scene, camera, index, outputs, seed):
        seeds.append((seed, torch.is_grad_enabled()))
        return learn(self, scene, camera, index, outputs, seed)

    monkeypatch.setattr(FrameRenderer, "learn", noted)
    loss = objective(capture, samples=2).loss
    for number in (0, 1):
        loss(model_of(motions()["still"]), 0.0, [0, 1], 0, number)
    assert len({seed for seed, _ in seeds}) == len(seeds) == 8
    assert [learning for _, learning in seeds] == [True, False] * 4


def test_one_ray_per_pixel_is_its_own_residual(monkeypatch: pytest.MonkeyPatch):
    calls, learn = [], FrameRenderer.learn
    monkeypatch.setattr(FrameRenderer, "learn", lambda *given: calls.append(1) or learn(*given))
    objective(fisheye()).loss(model_of(motions()["still"]), 0.0, [0], 0)
    assert calls == [1]


def test_frames_are_rasterised_where_they_are_asked_to_be(monkeypatch: pytest.MonkeyPatch) -> None:
    """Gaussians go to the device and images come back; a fake renderer stands on the device."""
    asked = []

    def fake(state: Gaussians, camera: Camera, **_: object) -> RenderOutput:
        asked.append(state.means.device.type)
        return RenderOutput(rgb=torch.ones(*camera.size_px, 3))

    monkeypatch.setattr(frame_renderer, "render", fake)
    renderer = FrameRenderer(capture=fisheye(), device="meta")
    output = renderer.rasterize(gaussians(), 0)
    assert asked == ["meta"] and output.rgb.device.type == "cpu"
