"""A prepared request: what the model decides where the user does not."""

from dataclasses import replace

import pytest
import torch
from image_layers import input_image, random_rgb

from diff4splat.flow.guidance import DEFAULT_GUIDANCE, UNGUIDED, Guidance
from diff4splat.generation.inputs.request import UserInput, prepare_request
from diff4splat.generation.settings import GenerationSettings
from diff4splat.models.config.sizes import small_size
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.hub.model import Model
from diff4splat.models.networks import Networks


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


def test_the_bundled_video_model_runs_without_guidance() -> None:
    assert small_size().default_guidance == 1
