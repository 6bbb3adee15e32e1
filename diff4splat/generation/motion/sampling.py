"""The motion prior: displacement and mask of what one image shows, from noise and text.

Axes: ``b`` = 1, ``s d`` text, ``t`` latent frames after the first, ``hc wc`` cells of 4 pixels,
``hh ww`` pixels of the copy that the networks see.

    noise ─ flow solver × motion U-Net ─ field ─┐
    image, text ─ object mask ─── probability ──┴─ mask ─ rigid components ─ displacement

Models without an object mask take the probability from the motion U-Net too.
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
from diff4splat.generation.layered_image.rigid_components import connected_components
from diff4splat.generation.motion.networks import (
    LEAST_PROBABILITY,
    LEAST_SHARE,
    MaskedMotion,
    ObjectMaps,
)
from diff4splat.generation.motion.object_pooling import LOW_SHARE, pooled_by_object
from diff4splat.generation.settings import GenerationSettings
from diff4splat.models.config.networks import MOTION_CELL_PX
from diff4splat.models.protocols import MotionPrior

WINDOW_PX, SIGMA_PX, COLOR_SIGMA, ROUNDS = 15, 5.0, 0.05, 2
"""Joint bilateral smoothing of probabilities: window and deviations in pixels and colour."""
HYSTERESIS_LOW = 0.1
"""A component of which no pixel is more probable to move is static."""
HYSTERESIS_HIGH = 0.4
"""A component of which no pixel is as probable to move is static, but for the most probable."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionRequest:
    """What decides about a motion beside the image."""

    text: Float[Tensor, "1 s d"] | None
    """None without a prompt."""
    seed: int
    settings: GenerationSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionSample:
    """Displacement of every cell if it moves, which pixels move, and the network calls."""

    field: Float[Tensor, "3 t hc wc"]
    """Relative displacement until the last time of each latent frame (``motion_field``)."""
    mean_field: Float[Tensor, "3 t hc wc"]
    """The mean over all samples, which decides with the image and text what moves at all."""
    probability: Float[Tensor, "hh ww"]
    """That a pixel moves."""
    calls: CallCount
    least_probability: float = 0.0
    """Of the most probable pixel, for anything to move."""
    least_share: float = 0.0
    """Of the highest probability, for a component to move beside the most probable one."""
    low_share: float = 0.0
    """Of the highest probability, for a pixel to move."""

    def mask(self, threshold: float) -> Bool[Tensor, "hh ww"]:
        """Pixels whose probability is above ``threshold``.

        Where none is, the most probable component moves if it has ``least_probability``: the prompt
        may ask for motion that the image does not suggest. Connected pixels are one component,
        which moves if some of it is probable enough (hysteresis, Canny 1986).
        """
        highest = float(self.probability.max())
        if highest < self.least_probability:
            return torch.zeros_like(self.probability, dtype=torch.bool)
        low = min(threshold, max(highest / 2, HYSTERESIS_LOW))
        low = max(low, self.low_share * highest)
        component = connected_components(self.probability > low)
        best = self.probability.new_zeros(int(component.max()) + 1)
        best = best.scatter_reduce(0, component.flatten(), self.probability.flatten(), "amax")
        needed = min(max(HYSTERESIS_HIGH, self.least_share * highest), highest)
        return (component > 0) & (best >= needed)[component]


def sample_motion(
    network: MotionPrior,
    image: InputImage,
    frames: int,
    request: MotionRequest,
    advance: Callable[[], None] | None = None,
) -> MotionSample:
    """Motion over ``frames`` latent frames, 0 at the first.

    Raises:
        ConfigError: an unknown sampler or schedule.
    """
    calls, rgb, settings = CallCount(), image.rgb.movedim(-1, 0)[None], request.settings
    noise = _noise(image, frames, request.seed)
    field = solve(
        _sampler(settings),
        _velocity(network, rgb, request, calls),
        noise,
        SolverPath(levels=settings.motion.levels, control=settings.step_control),
        advance,
    )
    # Which pixels move is not sampled: image and text decide.
    mean, logits = network.predict_motion_and_mask(rgb, noise, noise.new_ones(1), request.text)
    named = request.text is not None and isinstance(network, MaskedMotion)
    maps = ObjectMaps(logits=logits)
    if named:
        maps = network.object_maps(rgb, request.text)
    return MotionSample(
        field=_from_first(field),
        mean_field=_from_first(mean),
        probability=_probability(maps, rgb),
        calls=calls,
        least_probability=LEAST_PROBABILITY if named else 0.0,
        least_share=LEAST_SHARE if named else 0.0,
        low_share=0.0 if maps.instances is None else LOW_SHARE,
    )


def _noise(image: InputImage, frames: int, seed: int) -> Float[Tensor, "1 3 t hc wc"]:
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


def _probability(maps: ObjectMaps, rgb: Float[Tensor, "1 3 hh ww"]) -> Float[Tensor, "hh ww"]:
    """Of motion, smoothed, and shared among the pixels of one object where these are known."""
    smooth = bilateral_smooth(maps.logits.sigmoid(), rgb)[0]
    return smooth if maps.instances is None else pooled_by_object(smooth, maps.instances[0])


def bilateral_smooth(
    probability: Float[Tensor, "1 hh ww"], rgb: Float[Tensor, "1 3 hh ww"]
) -> Float[Tensor, "1 hh ww"]:
    """Probabilities averaged over near pixels of one colour, so that objects move up to their edge.

    On validation worlds this raises the overlap with what moves from 0.40 to 0.50.
    """
    # Kornia takes a second to load, which static scenes need not wait for.
    from kornia.filters import joint_bilateral_blur

    smooth = probability[:, None]
    for _ in range(ROUNDS):
        smooth = joint_bilateral_blur(smooth, rgb, (WINDOW_PX,) * 2, COLOR_SIGMA, (SIGMA_PX,) * 2)
    return smooth[:, 0]


def _velocity(
    network: MotionPrior,
    rgb: Float[Tensor, "1 3 hh ww"],
    request: MotionRequest,
    calls: CallCount,
) -> VelocityFn:
    def conditioned(text: Tensor | None) -> VelocityFn:
        def call(state: Tensor, level: float) -> Tensor:
            levels = state.new_full((len(state),), level)
            clean = network(rgb, state, levels, text, None)
            return velocity_from_clean(state, clean, levels[:, None, None, None, None])

        return call

    if request.text is None:
        return guided(None, conditioned(None), UNGUIDED, calls)
    return guided(
        conditioned(request.text), conditioned(None), request.settings.motion.guidance, calls
    )
