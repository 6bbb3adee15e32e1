"""Another exposure and white balance for every image of a batch; colours keep their names.

Axes: ``b`` images, ``h w`` pixels.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

LOG_GAMMA, LOG_GAIN, LOG_BALANCE, NOISE = 0.3, 0.2, 0.06, 0.03
"""Half the ranges of gamma, gain and white balance, as logarithms; largest deviation of noise.
Small enough that colours keep their names."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomLight:
    """One draw per image."""

    gamma: Float[Tensor, "b 1 1 1"]
    factors: Float[Tensor, "b 3 1 1"]
    noise: Float[Tensor, "b 1 1 1"]
    """Standard deviation."""

    def lit(self, rgb: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b 3 h w"]:
        """The images in that light, without noise; above 1 where they are overexposed."""
        return rgb.clamp_min(1e-3) ** self.gamma * self.factors

    def noisy(
        self, lit: Float[Tensor, "b 3 h w"], generator: torch.Generator
    ) -> Float[Tensor, "b 3 h w"]:
        """Colours in [0, 1] with noise."""
        normal = torch.randn(lit.shape, generator=generator)
        return (lit + self.noise * normal.to(lit)).clamp(0, 1)


def draw_light(generators: Sequence[torch.Generator], like: Tensor) -> RandomLight:
    """One generator per image; device and precision of ``like``."""
    draws = torch.stack([torch.rand(6, generator=one) for one in generators]).to(like)
    gamma, gain, *balance, noise = (2 * draws - 1)[..., None, None, None].unbind(1)
    return RandomLight(
        gamma=(LOG_GAMMA * gamma).exp(),
        factors=(LOG_GAIN * gain + LOG_BALANCE * torch.cat(balance, 1)).exp(),
        noise=NOISE * noise.abs(),
    )
