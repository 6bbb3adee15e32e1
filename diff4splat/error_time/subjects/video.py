"""The shipped video model on the eight inputs: noise to latents, and the video that they decode to.

Axes: ``b`` the inputs, ``c t h w`` latents, ``f hh ww`` images. The first latent frame is given,
and counts in no error.

    latent    RMS distance of the latents over their deviation, mean over inputs
    image     PSNR between both decoded videos, dB
"""

from functools import cache

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.error_time.subjects.errors import mean_psnr_db
from diff4splat.error_time.subjects.inputs import Inputs
from diff4splat.error_time.subjects.model import request, shipped_model
from diff4splat.generation.layered_image.build import ImageMaps, build_layered_image
from diff4splat.generation.priors import image_depth
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.video.render_condition import encode_condition, render_layered_image
from diff4splat.generation.video.video_sampling import Conditions, sample_video
from diff4splat.geometry.rays import plucker_map, relative_to_first

Latents = Float[Tensor, "b c t h w"]


@torch.no_grad()
def run(settings: GenerationSettings, inputs: Inputs) -> Latents:
    """Latents of the inputs, one after the other, as a generation does it."""
    dit = shipped_model().networks.dit
    every = map(conditions, inputs)
    return torch.cat([sample_video(dit, one, settings, seed=0).latent for one in every])


def error(latents: Latents, reference: Latents) -> float:
    """RMS distance over the deviation of the reference, mean over inputs."""
    wrong, true = (latents - reference)[:, :, 1:].flatten(1), reference[:, :, 1:].flatten(1)
    relative = wrong.square().mean(1).sqrt() / true.std(1).clamp_min(1e-12)
    return float(relative.mean())


@torch.no_grad()
def more_errors(latents: Latents, reference: Latents) -> dict[str, float]:
    """The same latents decoded."""
    vae = shipped_model().networks.vae
    return {
        "image [dB]": mean_psnr_db(*(vae.decode(one) / 2 + 0.5 for one in (latents, reference)))
    }


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
