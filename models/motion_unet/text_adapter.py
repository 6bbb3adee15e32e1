"""Text adapter of the motion U-Net: blocks after the text encoder, which stays frozen.

Axes: ``b`` batch, ``s`` text tokens, ``e`` their width. The encoder was trained with the video
model, which needs the direction of motion; the motion U-Net also needs the object that moves.
"""

import math

from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.config.networks import TextConfig
from diff4splat.models.motion_unet.text_tokens import TextTokens
from diff4splat.models.text_encoder.encoder import TextBlock, distance_buckets

BLOCKS = 2


class TextAdapter(nn.Module):
    """Residual blocks on the text states; the identity when fresh."""

    def __init__(self, config: TextConfig) -> None:
        super().__init__()
        self.config = config
        self.distance_bias = nn.Embedding(config.relative_position_buckets, config.heads)
        self.blocks = nn.ModuleList([TextBlock(config) for _ in range(BLOCKS)])
        for block in self.blocks:
            zero_(block.to_output)
            zero_(block.contract)

    def forward(self, text: TextTokens) -> Float[Tensor, "b s e"]:
        """States of real tokens; those of padding are zero."""
        states = text.states
        buckets = distance_buckets(states.shape[1], self.config, states.device)
        bias = self.distance_bias(buckets).permute(2, 0, 1)[None]
        bias = bias.masked_fill(~text.attention_mask[:, None, None], -math.inf)
        for block in self.blocks:
            states = block(states, bias)
        return states * text.mask[..., None]
