"""The shipped model, loaded once, and the inputs as its networks see them."""

from dataclasses import replace
from functools import cache

import torch

from diff4splat.error_time.subjects.inputs import ImageInput, image_inputs
from diff4splat.generation.inputs.request import Request, UserInput, prepare_request
from diff4splat.generation.settings import GenerationSettings
from diff4splat.models.hub.model import Model, load_model

MODEL = "small"


@cache
def shipped_model() -> Model:
    """With all of its networks."""
    return load_model(MODEL)


@cache
def requests(settings: GenerationSettings) -> tuple[Request, ...]:
    """Every input as a request to the shipped model."""
    return tuple(_request(one, settings) for one in image_inputs())


def _request(one: ImageInput, settings: GenerationSettings) -> Request:
    user = UserInput(image=one.image, path=one.path, prompt=one.prompt, seed=0, settings=settings)
    request = prepare_request(shipped_model(), user, torch.device("cpu"))
    return replace(request, settings=settings)
