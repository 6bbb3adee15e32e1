"""The shipped model, loaded once, and the inputs as its networks see them."""

from functools import cache

import torch

from diff4splat.error_time.subjects.inputs import image_input
from diff4splat.generation.inputs.request import Request, UserInput, prepare_request
from diff4splat.generation.settings import GenerationSettings
from diff4splat.models.hub.model import Model, load_model

MODEL = "small"


@cache
def shipped_model() -> Model:
    """With all of its networks."""
    return load_model(MODEL)


@cache
def request(index: int) -> Request:
    """One input as a request to the shipped model, with the default settings."""
    one = image_input(index)
    user = UserInput(
        image=one.image,
        path=one.path,
        prompt=one.prompt,
        seed=0,
        settings=GenerationSettings(),
    )
    return prepare_request(shipped_model(), user, torch.device("cpu"))
