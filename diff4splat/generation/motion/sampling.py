"""Displacement of what one image shows, from noise, text and the mask of what moves.

Axes: ``s d`` text, ``t`` latent frames after the first, ``hc wc`` cells of 4 pixels,
``hh ww`` pixels of the copy that the networks see.

    noise, image, text, mask ─ flow solver × motion U-Net ─ field
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.flow.guidance import UNGUIDED, CallCount, guided
from diff4splat.flow.path import velocity_from_clean
from diff4splat.flow.samplers import VelocityFn
from diff4splat.flow.solve import ADAPTIVE, FITTED, FIXED_DEFAULT, SolverPath, solve
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.settings import GenerationSettings
from diff4splat.models.config.networks import MOTION_CELL_PX
from diff4splat.models.protocols import MotionPrior


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionRequest:
    """What decides about a motion beside the image."""

    text: Float[Tensor, "1 s d"] | None
    """None without a prompt."""
    seed: int
    settings: GenerationSettings
    classes: tuple[int, ...] = ()
    """Of the prompt's nouns (``captions.image_classes``)."""
    local_motion: str = ""
    """Of the object about itself (``captions.events.local_motion``); empty for none."""
    in_place: bool = False
    """Whether the object is where it was after the motion."""
    key_times_s: tuple[float, ...] = (0.0, 1.0)
    """At which the scene keeps motion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionSample:
    """Displacement of every cell if it moves, and the network calls."""

    field: Float[Tensor, "3 t hc wc"]
    """Relative displacement until the last time of each latent frame (``motion_field``)."""
    mean_field: Float[Tensor, "3 t hc wc"]
    """The mean over all samples, which decides whether an object moves at all."""
    calls: CallCount


@dataclass(frozen=True, slots=True, kw_only=True)
class _Inputs:
    """What the network is shown beside motion and noise level."""

    rgb: Float[Tensor, "1 3 hh ww"]
    mask: Float[Tensor, "1 hh ww"] | None

    def clean(
        self, network: MotionPrior, noisy: Tensor, level: Tensor, text: Tensor | None
    ) -> Tensor:
        """The clean motion."""
        given = (self.rgb, noisy, level, text, None)
        return network(*given) if self.mask is None else network(*given, self.mask)


def sample_motion(
    network: MotionPrior,
    image: InputImage,
    frames: int,
    request: MotionRequest,
    mask: Bool[Tensor, "hh ww"] | None = None,
    advance: Callable[[], None] | None = None,
) -> MotionSample:
    """Motion over ``frames`` latent frames, 0 at the first; of what ``mask`` shows, if it is given.

    Raises:
        ConfigError: an unknown sampler or schedule.
    """
    calls, settings = CallCount(), request.settings
    rgb = image.rgb.movedim(-1, 0)[None]
    inputs = _Inputs(rgb=rgb, mask=None if mask is None else mask[None].to(rgb))
    noise = initial_noise(image, frames, request.seed)
    field = solve(
        _sampler(settings),
        _velocity(network, inputs, request, calls),
        noise,
        SolverPath(levels=settings.motion.levels, control=settings.step_control),
        advance,
    )
    # One step gives the mean itself.
    is_mean = settings.motion.steps == 1
    mean = field if is_mean else inputs.clean(network, noise, noise.new_ones(1), request.text)
    return MotionSample(field=_from_first(field), mean_field=_from_first(mean), calls=calls)


def initial_noise(image: InputImage, frames: int, seed: int) -> Float[Tensor, "1 3 t hc wc"]:
    """Drawn on the CPU, so every device starts alike."""
    grid = tuple(side // MOTION_CELL_PX for side in image.camera.size_px)
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(1, 3, frames - 1, *grid, generator=generator).to(image.rgb)


def _sampler(settings: GenerationSettings) -> str:
    """Of the settings, where it says something about motion."""
    # One step is the mean of all samples, which no tolerance is asked about; fitted steps are those
    # of the video model.
    fixed = settings.sampler == ADAPTIVE and settings.motion.steps == 1
    return FIXED_DEFAULT if fixed or settings.sampler == FITTED else settings.sampler


def _from_first(field: Float[Tensor, "1 3 t hc wc"]) -> Float[Tensor, "3 t2 hc wc"]:
    """With the first latent frame, at which nothing has moved."""
    return torch.cat([torch.zeros_like(field[0, :, :1]), field[0]], 1)


def _velocity(
    network: MotionPrior,
    inputs: _Inputs,
    request: MotionRequest,
    calls: CallCount,
) -> VelocityFn:
    def conditioned(text: Tensor | None) -> VelocityFn:
        def call(state: Tensor, level: float) -> Tensor:
            levels = state.new_full((len(state),), level)
            clean = inputs.clean(network, state, levels, text)
            return velocity_from_clean(state, clean, levels[:, None, None, None, None])

        return call

    if request.text is None:
        return guided(None, conditioned(None), UNGUIDED, calls)
    return guided(
        conditioned(request.text), conditioned(None), request.settings.motion.guidance, calls
    )
