"""The shipped motion network on the eight inputs: displacement of every cell, before any mask.

latent    RMS distance of the fields over their deviation, mean over inputs
"""

from functools import cache

import torch
from torch import Tensor

from diff4splat.error_time.subjects.inputs import Inputs
from diff4splat.error_time.subjects.model import request, shipped_model
from diff4splat.generation.inputs.copies import Copies, motion_copy
from diff4splat.generation.motion.networks import motion_prior
from diff4splat.generation.motion.sampling import MotionRequest, sample_motion
from diff4splat.generation.settings import GenerationSettings


@torch.no_grad()
def run(settings: GenerationSettings, inputs: Inputs) -> Tensor:
    """Fields of the inputs, ``b 3 t hc wc``."""
    model, fields = shipped_model(), []
    for index in inputs:
        asked = request(index)
        frames = model.config.latent_grid(len(asked.small_path), asked.small.camera.size_px)[0]
        motion = MotionRequest(text=prompt(index), seed=0, settings=settings)
        copies = Copies(image=asked.image, small=asked.small)
        image = motion_copy(copies, model.config.motion_unet.input_scale)
        sample = sample_motion(motion_prior(model.networks), image, frames, motion)
        fields.append(sample.field)
    return torch.stack(fields)


@cache
@torch.no_grad()
def prompt(index: int) -> Tensor:
    """The encoded prompt of an input."""
    return shipped_model().networks.text_encoder.encode_prompt(request(index).prompt)


def error(fields: Tensor, reference: Tensor) -> float:
    """RMS distance over the deviation of the reference, mean over inputs."""
    wrong, true = (fields - reference).flatten(1), reference.flatten(1)
    return float((wrong.square().mean(1).sqrt() / true.std(1).clamp_min(1e-12)).mean())
