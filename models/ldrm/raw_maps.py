"""What LDRM answers: raw maps, before any activation.

Axes: ``b`` batch, ``d`` channels, ``f hh ww`` frames, rows and columns of the Gaussian grid,
``t h2 w2`` grid of the tokens, ``hs ws`` cells of the surroundings.
"""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class RawGaussianMaps:
    """Raw attributes of one Gaussian per grid cell, and the tokens they came from."""

    gaussians: Float[Tensor, "b 12 f hh ww"]
    """Channels RGB 3, scale 3, quaternion 4, opacity 1, ray distance 1; zero is the base scene.
    With a detail decoder ``f`` counts key frames."""
    tokens: Float[Tensor, "b d t h2 w2"]
    """Canonical latent for the deformation network."""
    surroundings: Float[Tensor, "b 12 hs ws"] | None = None
    """The same channels for the layer behind the first picture; only with a detail decoder."""

    def sample(self, index: int) -> "RawGaussianMaps":
        """One batch element, as a batch of one."""
        own, around = slice(index, index + 1), self.surroundings
        return RawGaussianMaps(
            gaussians=self.gaussians[own],
            tokens=self.tokens[own],
            surroundings=None if around is None else around[own],
        )
