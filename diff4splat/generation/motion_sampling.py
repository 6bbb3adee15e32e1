"""From noise to the motion of what one picture shows: the flow solver drives the motion branch.

Axes: ``b`` = 1, ``s d`` text, ``t`` latent frames after the first, ``hc wc`` cells of 4 pixels.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.flow.guidance import UNGUIDED, CallCount, guided
from diff4splat.flow.path import velocity_from_clean
from diff4splat.flow.samplers import VelocityFn, find_sampler, integrate
from diff4splat.generation.input_image import InputImage
from diff4splat.generation.layered_image.rigid_components import connected_components
from diff4splat.generation.settings import GenerationSettings
from diff4splat.models.config.networks import MOTION_CELL_PX
from diff4splat.models.motion_unet.unet import MotionUNet

AROUND_PX, NEAR_PX, ALIKE, ROUNDS = 15, 5.0, 0.05, 2
"""Window and standard deviations, in pixels and in colour, of sharing likelihoods."""
HYSTERESIS_LOW = 0.1
"""What does not even move with this probability stands."""
HYSTERESIS_HIGH = 0.4
"""A thing of which no pixel is as likely to move as this stands, but for the likeliest of all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionRequest:
    """What decides about a motion beside the picture."""

    text: Float[Tensor, "1 s d"] | None
    """None without a prompt."""
    seed: int
    settings: GenerationSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionSample:
    """Where things go, which things, and what it cost."""

    field: Float[Tensor, "3 t hc wc"]
    """How what is in a cell goes if it moves, until the last time of each latent frame."""
    moves: Float[Tensor, "hh ww"]
    """How likely a pixel moves at all."""
    calls: CallCount

    def moving(self, above: float) -> Bool[Tensor, "hh ww"]:
        """Pixels that are more likely to move than ``above``.

        Where none is as likely as that, the likeliest thing moves: the words may say that something
        does, and the picture not which. Below ``HYSTERESIS_LOW`` nothing does. Pixels that touch
        are one thing, which moves where some of it is likely to (Canny's two thresholds, 1986).
        """
        most = float(self.moves.max())
        thing = connected_components(self.moves > min(above, max(most / 2, HYSTERESIS_LOW)))
        likely = self.moves.new_zeros(int(thing.max()) + 1)
        likely = likely.scatter_reduce(0, thing.flatten(), self.moves.flatten(), "amax")
        return (thing > 0) & (likely >= min(HYSTERESIS_HIGH, most))[thing]


def sample_motion(
    branch: MotionUNet,
    picture: InputImage,
    frames: int,
    wish: MotionRequest,
    advance: Callable[[], None] | None = None,
) -> MotionSample:
    """Motion over ``frames`` latent frames, 0 at the first.

    Raises:
        ConfigError: an unknown sampler or schedule.
    """
    calls, rgb = CallCount(), picture.rgb.movedim(-1, 0)[None]
    grid = tuple(side // MOTION_CELL_PX for side in picture.camera.size_px)
    # Drawn on the CPU, so every device starts alike.
    generator = torch.Generator().manual_seed(wish.seed)
    noise = torch.randn(1, 3, frames - 1, *grid, generator=generator).to(rgb)
    made = integrate(
        find_sampler(wish.settings.sampler),
        _velocity(branch, rgb, wish, calls),
        noise,
        wish.settings.motion.levels,
        advance,
    )
    # Which things move is not drawn: picture and words decide.
    moves = branch.answers(rgb, noise, noise.new_ones(1), wish.text)[1].sigmoid()
    field = torch.cat([torch.zeros_like(made[0, :, :1]), made[0]], 1)
    return MotionSample(field=field, moves=bilateral_smooth(moves, rgb)[0], calls=calls)


def bilateral_smooth(
    moves: Float[Tensor, "1 hh ww"], rgb: Float[Tensor, "1 3 hh ww"]
) -> Float[Tensor, "1 hh ww"]:
    """Likelihoods shared among near pixels of one colour: things move as wholes, up to their edges.

    On worlds kept back from training this raises the overlap with what moves from 0.40 to 0.50.
    """
    # Kornia takes a second to load, which scenes without a motion branch need not wait for.
    from kornia.filters import joint_bilateral_blur

    shared = moves[:, None]
    for _ in range(ROUNDS):
        shared = joint_bilateral_blur(shared, rgb, (AROUND_PX,) * 2, ALIKE, (NEAR_PX,) * 2)
    return shared[:, 0]


def _velocity(
    branch: MotionUNet,
    rgb: Float[Tensor, "1 3 hh ww"],
    wish: MotionRequest,
    calls: CallCount,
) -> VelocityFn:
    def asked(words: Tensor | None) -> VelocityFn:
        def call(state: Tensor, level: float) -> Tensor:
            levels = state.new_full((len(state),), level)
            clean = branch(rgb, state, levels, words, None)
            return velocity_from_clean(state, clean, levels[:, None, None, None, None])

        return call

    if wish.text is None:
        return guided(None, asked(None), UNGUIDED, calls)
    return guided(asked(wish.text), asked(None), wish.settings.motion.guidance, calls)
