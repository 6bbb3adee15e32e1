"""A prompt that asks an object to turn, grow or bend, from the words to the scene."""

import pytest
import torch
from torch import Tensor

from diff4splat.generation import text_states
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.motion.object_motion import ObjectMotion
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.settings import GenerationSettings
from diff4splat.geometry.camera import pinhole, project
from diff4splat.metrics.image import psnr
from diff4splat.progress.run_log import RunLog
from diff4splat.render.api import render
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

SIDE, COPY_SIDE = 64, 128


def disc(side: int, radius: float) -> Tensor:
    at = (torch.arange(side) + 0.5) / side - 0.5
    return at.square()[:, None] + at.square() < radius**2


@pytest.fixture
def image() -> InputImage:
    """A red disc before grey, with a shade from left to right."""
    rgb = torch.where(disc(SIDE, 0.25)[..., None], torch.tensor([0.8, 0.1, 0.1]), 0.5)
    shade = torch.linspace(0.8, 1.2, SIDE)[None, :, None]
    camera = pinhole(float(SIDE), (SIDE, SIDE))
    return InputImage(rgb=(rgb * shade).clamp(0, 1), camera=camera, focal_source="test")


@pytest.fixture(scope="module")
def pipeline() -> Diff4SplatPipeline:
    return Diff4SplatPipeline.from_pretrained("small")


@pytest.fixture(autouse=True)
def known_mask(monkeypatch: pytest.MonkeyPatch) -> None:
    """The disc is what the prompt names."""
    event = disc(COPY_SIDE, 0.25).long()
    monkeypatch.setattr(ObjectMotion, "_events", lambda *_: event)


def size_px(scene: Scene, image: InputImage, time_s: float) -> float:
    """Height of what moves, in the input view."""
    means = scene.state_at(time_s).means[scene.motion.moving_index]
    rows = project(image.camera, means)[0][:, 1]
    return float(torch.quantile(rows, 0.98) - torch.quantile(rows, 0.02))


def test_a_disc_grows_in_place(pipeline: Diff4SplatPipeline, image: InputImage) -> None:
    scene = pipeline(image, "arc:0.1", "the red ball grows")
    end_s = float(scene.path.times_s[-1])
    first, last = (size_px(scene, image, at) for at in (0.0, end_s))
    assert last == pytest.approx(1.6 * first, rel=0.1)


def test_without_local_motion_nothing_grows(
    pipeline: Diff4SplatPipeline, image: InputImage, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(text_states, "local_motion", lambda _: "")
    log = RunLog()
    scene = pipeline(image, "arc:0.1", "the red ball grows", log=log)
    assert isinstance(scene.motion, StaticMotion)
    assert "motion in place" in {one.what for one in log.skipped}


@pytest.mark.parametrize("fill", ["none", pytest.param("video", marks=pytest.mark.slow)])
def test_a_disc_that_spins_has_another_side(
    pipeline: Diff4SplatPipeline, image: InputImage, fill: str
) -> None:
    settings = GenerationSettings(fill=fill, steps=1)
    plain = pipeline(image, "arc:0.1", settings=settings)
    scene = pipeline(image, "arc:0.1", "the red ball spins", settings=settings)
    assert isinstance(scene.motion, KeyframeMotion)
    shown = scene.state_at(0.0).means[scene.motion.moving_index][:, 2]
    still = plain.gaussians.means[:, 2][: SIDE**2].view(SIDE, SIDE)[disc(SIDE, 0.2)]
    # As far behind the middle as its front is before it.
    assert float(shown.max() - shown.min()) > 0.3 * float(still.median())
    seen = render(scene, image.camera, 0.0).rgb.clamp(0, 1)
    assert float(psnr(seen, image.rgb)) >= 40


def test_a_small_disc_does_not_spin(
    pipeline: Diff4SplatPipeline, image: InputImage, monkeypatch: pytest.MonkeyPatch
) -> None:
    event = disc(COPY_SIDE, 0.1).long()
    monkeypatch.setattr(ObjectMotion, "_events", lambda *_: event)
    log, plain = RunLog(), pipeline(image, "arc:0.1")
    scene = pipeline(image, "arc:0.1", "the red ball spins", log=log)
    assert isinstance(scene.motion, StaticMotion)
    assert torch.equal(scene.gaussians.means, plain.gaussians.means)
    assert "motion in place" in {one.what for one in log.skipped}
