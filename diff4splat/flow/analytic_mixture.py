"""The exact velocity of Gaussian-mixture data, in closed form.

Axes: ``b`` batch, ``k`` components, ``d`` dimensions. For clean ~ Σ_k p_k N(mean_k, diag(std_k²))
and noisy = (1 - level) · clean + level · noise, each component stays Gaussian and

    variance_k  = (1 - level)² std_k² + level²
    offset_k    = noisy - (1 - level) mean_k
    velocity    = E[noise - clean | noisy]
                = Σ_k P(k | noisy) ((level - (1 - level) std_k²) / variance_k · offset_k - mean_k)

(conditional expectation of jointly Gaussian variables). The trajectory of one component is
noisy(level) = (1 - level) mean + sqrt(variance) z with a fixed z. Used to measure samplers.
"""

import math
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ConfigError, ShapeError


@dataclass(frozen=True, slots=True, kw_only=True)
class GaussianMixture:
    """Data with a velocity in closed form."""

    means: Float[Tensor, "k d"]
    stds: Float[Tensor, "k d"]
    log_weights: Float[Tensor, " k"]
    """Unnormalised."""

    def __post_init__(self) -> None:
        if self.stds.shape != self.means.shape or self.log_weights.shape != self.means.shape[:1]:
            raise ShapeError(
                "GaussianMixture: expected means and stds (k, d) and log_weights (k,), got "
                f"{[tuple(t.shape) for t in (self.means, self.stds, self.log_weights)]}"
            )
        if not bool((self.stds >= 0).all()):
            raise ConfigError("GaussianMixture.stds: expected 0 or above")

    def velocity(self, noisy: Float[Tensor, "b d"], level: float) -> Float[Tensor, "b d"]:
        """E[noise - clean | noisy], a substitute for the velocity of a network."""
        clean_weight = 1 - level
        variance = clean_weight**2 * self.stds**2 + level**2
        # Very small deviations would divide by zero at level 0.
        variance = variance.clamp_min(torch.finfo(variance.dtype).eps ** 2)
        offset = noisy[:, None] - clean_weight * self.means
        energy = (offset.square() / variance + variance.log()).sum(-1)
        posterior = torch.softmax(self.log_weights - 0.5 * energy, -1)[..., None]
        gain = (level - clean_weight * self.stds**2) / variance
        return (posterior * (gain * offset - self.means)).sum(1)

    def with_weights(self, log_weights: Float[Tensor, " k"]) -> "GaussianMixture":
        """The same components with other weights: a condition that prefers some of them."""
        return replace(self, log_weights=log_weights)


def random_mixture(
    seed: int, components: int = 8, dimensions: int = 48, stds: tuple[float, float] = (0.005, 0.5)
) -> GaussianMixture:
    """Standard normal means; standard deviations log-uniform between the two of ``stds``."""
    generator = torch.Generator().manual_seed(seed)
    shape = (components, dimensions)
    means = torch.randn(shape, generator=generator, dtype=torch.float64)
    mixed = torch.rand(shape, generator=generator, dtype=torch.float64)
    low, high = math.log(stds[0]), math.log(stds[1])
    return GaussianMixture(
        means=means,
        stds=torch.exp(low + mixed * (high - low)),
        log_weights=torch.zeros(components, dtype=torch.float64),
    )
