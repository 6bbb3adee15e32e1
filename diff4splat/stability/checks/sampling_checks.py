"""The trained video and motion networks under strong guidance, float32 against float64.

Axes: ``c t h w`` latents, ``f`` video frames. A network that predicts clean latents gives the
velocity (noisy - clean) / level, which is where a low level could amplify an error.
"""

from collections.abc import Callable, Iterator
from functools import cache, partial

import torch
from torch import Tensor

from diff4splat.flow.guidance import Guidance
from diff4splat.generation.inputs.input_cameras import to_camera_path
from diff4splat.generation.motion.sampling import MotionRequest, sample_motion
from diff4splat.generation.settings import GenerationSettings, MotionSettings
from diff4splat.generation.video.video_sampling import Conditions, sample_video
from diff4splat.geometry.rays import plucker_map, relative_to_first
from diff4splat.models.networks import Networks
from diff4splat.models.video_dit.conditions import RenderCondition
from diff4splat.stability.check import Check, Outcome
from diff4splat.stability.checks.network_checks import model_of
from diff4splat.stability.compare import all_finite, relative_error
from diff4splat.stability.plots import HeatMap
from diff4splat.stability.subjects.casting import cast_networks
from diff4splat.stability.subjects.drawn_images import objects
from diff4splat.stability.subjects.generated_scenes import CAMERA_PATH, PROMPT, as_file

GROUP = "sampling"
WEIGHTS, STEPS = (1.0, 5.0, 10.0, 30.0), (1, 4, 16)
LIMIT = 1e-3
FRAMES = 9


def sampling_checks(model: str) -> Iterator[Check]:
    """One check per network."""
    for name, sample in (("video network", sample_latents), ("motion network", sample_field)):
        yield Check(
            group=GROUP,
            name=name,
            run=partial(measure_sampling, name, model, sample),
            limit=LIMIT,
            error_unit="largest difference over largest value, worst cell",
        )


Sample = Callable[[str, torch.dtype, int, float], Tensor]


@torch.no_grad()
def measure_sampling(name: str, model: str, sample: Sample) -> Outcome:
    """Errors over guidance and steps, and how the latents grow with guidance."""
    rows, growth, finite = [], {}, True
    for weight in WEIGHTS:
        row = []
        for steps in STEPS:
            got, exact = (
                sample(model, dtype, steps, weight) for dtype in (torch.float32, torch.float64)
            )
            finite = finite and all_finite([got])
            row.append(relative_error(got, exact))
            growth[weight] = float(got.double().std())
        rows.append(tuple(row))
    sizes = ", ".join(f"{growth[weight]:.2g} at {weight:g}" for weight in WEIGHTS)
    return Outcome(
        error=max(max(row) for row in rows),
        value_finite=finite,
        note=f"deviation of the samples after {STEPS[-1]} steps, by guidance: {sizes}",
        plots=(
            HeatMap(
                title=name,
                row_label="guidance",
                rows=tuple(f"{weight:g}" for weight in WEIGHTS),
                column_label="steps",
                columns=tuple(map(str, STEPS)),
                values=tuple(rows),
                within_limit=tuple(tuple(value <= LIMIT for value in row) for row in rows),
            ),
        ),
    )


def sample_latents(model: str, dtype: torch.dtype, steps: int, weight: float) -> Tensor:
    """Video latents of a drawn image."""
    settings = GenerationSettings(steps=steps, guidance=Guidance(weight=weight))
    return sample_video(_networks(model, dtype).dit, _conditions(model), settings, seed=0).latent


def sample_field(model: str, dtype: torch.dtype, steps: int, weight: float) -> Tensor:
    """Motion of a drawn image."""
    motion = MotionSettings(steps=steps, guidance=Guidance(weight=weight))
    networks = _networks(model, dtype)
    request = MotionRequest(
        text=networks.text_encoder.encode_prompt(PROMPT),
        seed=0,
        settings=GenerationSettings(motion=motion),
    )
    return sample_motion(networks.motion_unet, as_file(objects()), 3, request).field


@cache
def _networks(model: str, dtype: torch.dtype) -> Networks:
    return cast_networks(model_of(model).networks, dtype)


@cache
def _conditions(model: str) -> Conditions:
    """An image that is repeated; half of it is valid."""
    config, networks = model_of(model).config, model_of(model).networks
    image = as_file(objects())
    video = image.rgb.movedim(-1, 0)[None, :, None].expand(-1, -1, FRAMES, -1, -1) * 2 - 1
    path = to_camera_path(CAMERA_PATH, image.camera).cameras[:FRAMES]
    validity = torch.ones_like(video[:, :1])
    validity[..., 1:, :, : video.shape[-1] // 2] = 0
    latent = networks.vae.encode(video).mean
    rendered = config.dit.render_condition
    return Conditions(
        image_latent=latent[:, :, :1],
        plucker=plucker_map(relative_to_first(path)).movedim(0, 1)[None],
        text=networks.text_encoder.encode_prompt(PROMPT),
        render=RenderCondition(latent=latent, validity=validity) if rendered else None,
    )
