"""LDRM's output: raw maps, before any activation.

Axes: ``b`` batch, ``d`` channels, ``f hh ww`` frames, rows and columns of the Gaussian grid,
``t h2 w2`` grid of the tokens, ``hs ws`` cells of the border layer.
"""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class RawGaussianMaps:
    """Raw attributes of one Gaussian per grid cell, and the tokens for the deformation network."""

    gaussians: Float[Tensor, "b 12 f hh ww"]
    """Channels RGB 3, scale 3, quaternion 4, opacity 1, ray distance 1; zero is the base scene.
    With a refinement decoder ``f`` counts key frames."""
    tokens: Float[Tensor, "b d t h2 w2"]
    """Canonical latent for the deformation network."""
    border: Float[Tensor, "b 12 hs ws"] | None = None
    """The same channels for the border extension of the first frame; with refinement only."""

    def sample(self, index: int) -> "RawGaussianMaps":
        """One batch element, as a batch of one."""
        row, border = slice(index, index + 1), self.border
        return RawGaussianMaps(
            gaussians=self.gaussians[row],
            tokens=self.tokens[row],
            border=None if border is None else border[row],
        )
