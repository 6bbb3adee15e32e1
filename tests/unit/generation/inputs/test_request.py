"""A prepared request: what the model decides where the user does not."""

from dataclasses import replace

import pytest
import torch
from image_layers import input_image, random_rgb

from diff4splat.flow.guidance import DEFAULT_GUIDANCE, UNGUIDED, Guidance
from diff4splat.generation.inputs.input_cameras import to_camera_path
from diff4splat.generation.inputs.request import (
    Request,
    UserInput,
    prepare_request,
    sized_to_depth,
)
from diff4splat.generation.settings import GenerationSettings
from diff4splat.models.config.sizes import small_size
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.hub.model import Model
from diff4splat.models.networks import Networks
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.preset_path import PresetPath
from diff4splat.paths.settings import PathSettings


def guidance_of(own: float, asked: Guidance | None) -> Guidance:
    model = Model(config=replace(tiny_size(), default_guidance=own), networks=Networks())
    user = UserInput(
        image=input_image(random_rgb(32, 32)),
        path="static",
        prompt="a red box moves to the left",
        seed=0,
        settings=GenerationSettings(fill="video", guidance=asked),
    )
    return prepare_request(model, user, torch.device("cpu")).settings.guidance


@pytest.mark.parametrize("weight", [1.0, 7.0])
def test_guidance_is_the_models_own_unless_asked_for(weight: float) -> None:
    assert guidance_of(weight, None) == replace(DEFAULT_GUIDANCE, weight=weight)
    assert guidance_of(weight, Guidance(weight=3.0)) == Guidance(weight=3.0)
    assert guidance_of(weight, UNGUIDED) == UNGUIDED


def request_along(path: CameraPath | PresetPath | str) -> Request:
    model = Model(config=tiny_size(), networks=Networks())
    user = UserInput(
        image=input_image(random_rgb(32, 32)),
        path=path,
        prompt=None,
        seed=0,
        settings=GenerationSettings(),
    )
    return prepare_request(model, user, torch.device("cpu"))


def depths(near: float, focus: float) -> torch.Tensor:
    """A tenth of the pixels near, then a third at the focus depth, the rest far."""
    share = torch.arange(32 * 32).view(32, 32) / 32**2
    return torch.where(share < 0.1, near, torch.where(share < 0.4, focus, 50.0))


@pytest.mark.parametrize("unit", [0.01, 1.0, 100.0])
def test_presets_are_sized_to_the_depth_of_the_image(unit: float) -> None:
    request = sized_to_depth(request_along("forward:0.5"), unit * depths(2.0, 3.0))
    assert float(request.path.cameras.position[-1, 2]) == pytest.approx(unit)
    assert float(request.small_path.cameras.position[-1, 2]) == pytest.approx(unit)


def test_an_orbit_goes_around_the_nearest_quarter() -> None:
    request = sized_to_depth(request_along("orbit:0.5"), depths(2.0, 3.0))
    want = torch.tensor([0.0, 0.0, 6.0])
    torch.testing.assert_close(request.path.cameras.position[-1], want, atol=1e-5, rtol=0)


def test_presets_keep_their_timing() -> None:
    preset = PresetPath(text="forward", settings=PathSettings(frames=7, fps=3.0))
    request = request_along(preset)
    sized = sized_to_depth(request, depths(2.0, 3.0))
    assert len(preset) == len(sized.path) == 7
    assert torch.equal(sized.path.times_s, request.path.times_s)
    assert torch.equal(sized.key_times_s, request.key_times_s)
    assert len(sized.small_path) == len(request.small_path)


def test_given_cameras_stay_as_they_are() -> None:
    path = to_camera_path("forward:0.5", input_image(random_rgb(32, 32)).camera)
    request = request_along(path)
    assert sized_to_depth(request, depths(2.0, 3.0)) is request


def test_the_bundled_video_model_runs_without_guidance() -> None:
    assert small_size().default_guidance == 1
