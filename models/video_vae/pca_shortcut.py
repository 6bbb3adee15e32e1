"""The linear part of the video autoencoder: one matrix to latents, one back (ours).

Axes: ``b`` batch, ``c`` latent channels, ``t h w`` latent frames, rows and columns. Every latent
pixel depends on one block of four frames and ``stride``² pixels alone. The best such pair
of matrices is known in closed form (principal components), so training starts from the best
linear autoencoder, and the convolutions beside it learn the dependence between blocks (residual
autoencoding of DC-AE, arXiv 2410.10733, with a learned instead of a fixed shortcut).
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.patches import fill_first_pack, patchify, unpatchify
from diff4splat.models.config.networks import TIME_STRIDE, VaeConfig


class PcaShortcut(nn.Module):
    """Blocks to latents and back, without neighbours or history."""

    def __init__(self, config: VaeConfig) -> None:
        super().__init__()
        self.patch = (TIME_STRIDE, config.space_stride, config.space_stride)
        values = 3 * TIME_STRIDE * config.space_stride**2
        self.to_latent = nn.Linear(values, config.latent_channels)
        self.to_block = nn.Linear(config.latent_channels, values)

    def encode(self, video: Float[Tensor, "b 3 f h8 w8"]) -> Float[Tensor, "b c t h w"]:
        """Latents; the first frame fills its block of four."""
        return self.to_latent(self.blocks(video)).movedim(-1, 1)

    def decode(self, latent: Float[Tensor, "b c t h w"]) -> Float[Tensor, "b 3 t4 h8 w8"]:
        """Four frames per latent frame."""
        return unpatchify(self.to_block(latent.movedim(1, -1)), self.patch)

    def blocks(self, video: Float[Tensor, "b 3 f h8 w8"]) -> Float[Tensor, "b t h w n"]:
        """Input of the matrices, in the order (t, h, w, c)."""
        listed = patchify(fill_first_pack(video), self.patch).unflatten(-1, (3, -1))
        return listed.transpose(-1, -2).flatten(-2)

    @torch.no_grad()
    def channel_power(self) -> Float[Tensor, " c"]:
        """Sum of squares that each latent channel of variance 1 adds to the pixels."""
        return self.to_block.weight.square().sum(0)

    @torch.no_grad()
    def set_components(
        self, mean: Float[Tensor, " n"], components: Float[Tensor, "c n"], std: Float[Tensor, " c"]
    ) -> None:
        """Latents become block coordinates along orthonormal ``components``, of variance 1."""
        self.to_latent.weight.copy_(components / std[:, None])
        self.to_latent.bias.copy_(-(components @ mean) / std)
        self.to_block.weight.copy_((components * std[:, None]).mT)
        self.to_block.bias.copy_(mean)
