"""What the encoder of the video autoencoder predicts.

Axes: ``b`` batch, ``c`` channels, ``t h w`` latent frames, rows and columns.
"""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class LatentDistribution:
    """Diagonal Gaussian over standardised latents."""

    mean: Float[Tensor, "b c t h w"]
    log_variance: Float[Tensor, "b c t h w"]

    def sample(self, noise: Float[Tensor, "b c t h w"]) -> Float[Tensor, "b c t h w"]:
        """Mean plus std times noise, with standard normal ``noise``."""
        return self.mean + (0.5 * self.log_variance).exp() * noise
