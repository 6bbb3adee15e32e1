"""From noise to video latents: the flow solver drives the video model.

Axes: ``b`` batch, ``c`` latent channels, ``t h w`` latent grid, ``f`` video frames, ``s d`` text.
The first latent frame is the image's own, clean at every step: it has level 0 and velocity 0
(Wan 2.2 TI2V), so the solver carries it through unchanged. A model that takes the image as channels
of its own (image-to-video weights) makes the first frame like all others.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.flow.guidance import DEFAULT_GUIDANCE, UNGUIDED, CallCount, Guidance, guided
from diff4splat.flow.samplers import VelocityFn
from diff4splat.flow.solve import solve
from diff4splat.generation.settings import GenerationSettings
from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.models.protocols import VideoVelocity
from diff4splat.models.video_dit.conditions import (
    DitConditions,
    ImageCondition,
    RenderCondition,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """What the video is generated from."""

    image_latent: Float[Tensor, "b c 1 h w"]
    plucker: Float[Tensor, "b 6 f height width"]
    text: Float[Tensor, "b s d"] | None
    """None without a prompt: then neither the text encoder nor the guidance pass exists."""
    text_mask: Bool[Tensor, "b s"] | None = None
    """True where a token is real; None when all are."""
    render: RenderCondition | None = None
    """For a model that takes one."""
    negative_text: Float[Tensor, "b s2 d"] | None = None
    """What guidance leads away from, or all text without a prompt; None: no text at all."""
    image: ImageCondition | None = None
    """For a model that takes the image as channels."""

    @property
    def first_frame_is_given(self) -> bool:
        """Whether the first latent frame is the image's and stays so."""
        return self.image is None


@dataclass(frozen=True, slots=True, kw_only=True)
class VideoSample:
    """Clean video latents and the network calls they took."""

    latent: Float[Tensor, "b c t h w"]
    calls: CallCount


def sample_video(
    dit: VideoVelocity,
    conditions: Conditions,
    settings: GenerationSettings,
    seed: int,
    advance: Callable[[], None] | None = None,
) -> VideoSample:
    """Video latents for ``conditions``; one seed gives one video.

    Raises:
        ConfigError: an unknown sampler or schedule.
    """
    calls = CallCount()
    latent = solve(
        settings.sampler,
        video_velocity(dit, conditions, settings.guidance or DEFAULT_GUIDANCE, calls),
        initial_noise(conditions, seed),
        settings.solver_path,
        advance,
    )
    frames = 1 + (conditions.plucker.shape[2] - 1) // TIME_STRIDE
    return VideoSample(latent=latent[:, :, -frames:], calls=calls)


def initial_noise(conditions: Conditions, seed: int) -> Float[Tensor, "b c t h w"]:
    """Seeded noise after the clean first frame; drawn on the CPU, so every device starts alike.

    Channels of the image may have frames before the video (CogVideoX 1.5), which are noise too.
    """
    image = conditions.image_latent
    given = conditions.first_frame_is_given
    frames = (conditions.plucker.shape[2] - 1) // TIME_STRIDE + (0 if given else 1)
    if not given and conditions.image.channels is not None:
        frames = conditions.image.channels.shape[2]
    generator = torch.Generator().manual_seed(seed)
    noise = torch.randn(*image.shape[:2], frames, *image.shape[3:], generator=generator).to(image)
    return torch.cat([image, noise], 2) if given else noise


def video_velocity(
    dit: VideoVelocity, conditions: Conditions, guidance: Guidance, calls: CallCount
) -> VelocityFn:
    """The velocity that the solver follows, with guidance; ``calls`` counts network evaluations."""
    # Cameras and text are embedded once: they are the same at every level.
    embedded = _prepare(dit, conditions, conditions.text, conditions.text_mask)
    negative = conditions.negative_text
    without = embedded.with_text_of(
        None if negative is None else _prepare(dit, conditions, negative)
    )
    first_is_given = conditions.first_frame_is_given
    unconditional = _branch(dit, without, first_is_given)
    if conditions.text is None:
        return guided(None, unconditional, UNGUIDED, calls)
    return guided(_branch(dit, embedded, first_is_given), unconditional, guidance, calls)


def _prepare(
    dit: VideoVelocity, conditions: Conditions, text: Tensor | None, mask: Tensor | None = None
) -> DitConditions:
    image = {} if conditions.image is None else {"image": conditions.image}
    return dit.prepare(conditions.plucker, text, mask, conditions.render, **image)


def _branch(dit: VideoVelocity, embedded: DitConditions, first_is_given: bool) -> VelocityFn:
    def call(state: Tensor, level: float) -> Tensor:
        levels = state.new_full((state.shape[0], state.shape[2]), level)
        if not first_is_given:
            return dit.velocity(state, levels, embedded)
        levels[:, 0] = 0
        velocity = dit.velocity(state, levels, embedded)
        return torch.cat([torch.zeros_like(velocity[:, :, :1]), velocity[:, :, 1:]], 2)

    return call
