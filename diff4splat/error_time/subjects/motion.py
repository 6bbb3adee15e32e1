"""The shipped motion network on the eight inputs: displacement of every cell, before any mask.

latent    RMS distance of the fields over their deviation, mean over inputs
"""

from functools import cache

import torch
from torch import Tensor

from diff4splat.error_time.subjects.model import requests, shipped_model
from diff4splat.generation.motion_sampling import MotionRequest, sample_motion
from diff4splat.generation.settings import GenerationSettings


@torch.no_grad()
def run(settings: GenerationSettings) -> Tensor:
    """Fields of all inputs, ``b 3 t hc wc``."""
    model = shipped_model()
    fields = []
    for request, text in zip(requests(GenerationSettings()), prompts(), strict=True):
        frames = model.config.latent_grid(len(request.small_path), request.small.camera.size_px)[0]
        asked = MotionRequest(text=text, seed=0, settings=settings)
        sample = sample_motion(model.networks.motion_unet, request.small, frames, asked)
        fields.append(sample.field)
    return torch.stack(fields)


@cache
@torch.no_grad()
def prompts() -> tuple[Tensor, ...]:
    """The encoded prompt of every input."""
    encoder = shipped_model().networks.text_encoder
    return tuple(encoder.encode_prompt(one.prompt) for one in requests(GenerationSettings()))


def error(fields: Tensor, reference: Tensor) -> float:
    """RMS distance over the deviation of the reference, mean over inputs."""
    wrong, true = (fields - reference).flatten(1), reference.flatten(1)
    return float((wrong.square().mean(1).sqrt() / true.std(1).clamp_min(1e-12)).mean())
