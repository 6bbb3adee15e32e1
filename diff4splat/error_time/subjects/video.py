"""The shipped video model on the eight inputs: noise to latents, and the video that they decode to.

Axes: ``b`` the inputs, ``c t h w`` latents, ``f hh ww`` images. The first latent frame is given,
and counts in no error.

    latent    RMS distance of the latents over their deviation, mean over inputs
    image     PSNR between both decoded videos, dB
"""

from collections.abc import Sequence
from functools import cache, lru_cache

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.error_time.subjects.errors import mean_psnr_db
from diff4splat.error_time.subjects.inputs import Inputs
from diff4splat.error_time.subjects.model import request, shipped_model
from diff4splat.flow.guidance import DEFAULT_GUIDANCE, CallCount, Guidance
from diff4splat.flow.sampler_types import VelocityFn
from diff4splat.flow.solve import ADAPTIVE, solve
from diff4splat.generation.layered_image.build import build_layered_image
from diff4splat.generation.layered_image.pixel_maps.image_maps import ImageMaps
from diff4splat.generation.priors import image_depth
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.video.render_condition import encode_condition, render_layered_image
from diff4splat.generation.video.video_sampling import Conditions, initial_noise, video_velocity
from diff4splat.geometry.rays import plucker_map, relative_to_first
from diff4splat.models.protocols import VideoVelocity
from diff4splat.models.video_dit.conditions import RenderCondition

Latents = Float[Tensor, "b c t h w"]


@torch.no_grad()
def run(settings: GenerationSettings, inputs: Inputs) -> Latents:
    """Latents of the inputs, each from its own noise of seed 0, as one batch.

    An adaptive step size is each input's own, so there it is one after the other.
    """
    every = [(conditions(index), 0) for index in inputs]
    if settings.sampler == ADAPTIVE:
        return torch.cat([sampled([one], settings) for one in every])
    return sampled(every, settings)


def sampled(
    every: Sequence[tuple[Conditions, int]],
    settings: GenerationSettings,
    dit: VideoVelocity | None = None,
) -> Latents:
    """Latents of conditions and seeds, as one batch; by the shipped network, or by ``dit``."""
    velocity, noise = batch(every, settings.guidance or DEFAULT_GUIDANCE, dit)
    return solve(settings.sampler, velocity, noise, settings.solver_path)


def batch(
    every: Sequence[tuple[Conditions, int]], guidance: Guidance, dit: VideoVelocity | None = None
) -> tuple[VelocityFn, Latents]:
    """Velocity and noise of conditions and seeds; prompts are padded, and masked there."""
    parts = [one for one, _ in every]
    text = torch.nn.utils.rnn.pad_sequence([one.text[0] for one in parts], batch_first=True)
    lengths = torch.tensor([one.text.shape[1] for one in parts])
    render = RenderCondition(
        latent=torch.cat([one.render.latent for one in parts]),
        validity=torch.cat([one.render.validity for one in parts]),
    )
    joined = Conditions(
        image_latent=torch.cat([one.image_latent for one in parts]),
        plucker=torch.cat([one.plucker for one in parts]),
        text=text,
        text_mask=torch.arange(text.shape[1]) < lengths[:, None],
        render=render,
    )
    noise = torch.cat([initial_noise(one, seed) for one, seed in every])
    dit = dit or shipped_model().networks.dit
    return video_velocity(dit, joined, guidance, CallCount()), noise


def error(latents: Latents, reference: Latents) -> float:
    """RMS distance over the deviation of the reference, mean over inputs."""
    wrong, true = (latents - reference)[:, :, 1:].flatten(1), reference[:, :, 1:].flatten(1)
    relative = wrong.square().mean(1).sqrt() / true.std(1).clamp_min(1e-12)
    return float(relative.mean())


@torch.no_grad()
def more_errors(latents: Latents, reference: Latents) -> dict[str, float]:
    """The same latents decoded."""
    return {"image [dB]": mean_psnr_db(_decoded(latents), _decoded_reference(reference))}


def _decoded(latents: Latents) -> Tensor:
    return shipped_model().networks.vae.decode(latents) / 2 + 0.5


@lru_cache(maxsize=1)
def _decoded_reference(reference: Latents) -> Tensor:
    """Every setting is compared with the same one."""
    return _decoded(reference)


@cache
@torch.no_grad()
def conditions(index: int) -> Conditions:
    """What the video of an input is generated from: depth prior, layered image, its render."""
    model, asked = shipped_model(), request(index)
    maps = ImageMaps(depth=image_depth(model, asked.small), displacement=None)
    border_cells = model.config.refinement.border_cells
    layered = build_layered_image(asked.small, asked.small, maps, border_cells)
    path = asked.small_path
    rendered = render_layered_image(layered, path, path.times_s)
    image = asked.small.rgb.movedim(-1, 0)[None, :, None] * 2 - 1
    return Conditions(
        image_latent=model.networks.vae.encode(image).mean,
        plucker=plucker_map(relative_to_first(path.cameras)).movedim(0, 1)[None],
        text=model.networks.text_encoder.encode_prompt(asked.prompt),
        render=encode_condition(model, rendered),
    )
