"""Block of the video model: self-attention, cross-attention to text, feed-forward (Wan 2.1).

Axes: ``b`` batch, ``t`` latent frames, ``m`` tokens of a frame, ``d`` width, ``s`` text tokens.
The six modulation vectors (shift, scale, gate for attention and for feed-forward) are one shared
projection of the noise level plus a table per block (PixArt-α, arXiv 2310.00426).
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.attention import Attention
from diff4splat.models.blocks.feedforward import FeedForward
from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.blocks.modulation import modulate
from diff4splat.models.blocks.norm import EPSILON
from diff4splat.models.blocks.precision import at_least_float32
from diff4splat.models.blocks.rope import RopeTables
from diff4splat.models.config.networks import DitConfig
from diff4splat.models.video_dit.conditions import DitConditions
from diff4splat.models.video_dit.image_attention import TextImageAttention

MODULATIONS = 6


class DitBlock(nn.Module):
    """The identity when fresh: its gates and the cross-attention's output start at zero."""

    def __init__(self, config: DitConfig) -> None:
        super().__init__()
        width = config.width
        self.attention_norm = nn.LayerNorm(width, eps=EPSILON, elementwise_affine=False)
        self.attention = Attention(width, config.heads)
        self.text_norm = nn.LayerNorm(width, eps=EPSILON)
        attention = TextImageAttention if config.image_width else Attention
        self.text_attention = attention(width, config.heads)
        self.feedforward_norm = nn.LayerNorm(width, eps=EPSILON, elementwise_affine=False)
        self.feedforward = FeedForward(width, config.feedforward_width)
        self.modulation = nn.Parameter(torch.zeros(MODULATIONS, width))
        zero_(self.text_attention.to_output)

    def forward(
        self,
        tokens: Float[Tensor, "b t m d"],
        modulation: Float[Tensor, "b t 6 d"],
        rope: RopeTables,
        conditions: DitConditions,
    ) -> Float[Tensor, "b t m d"]:
        """Without text the cross-attention is not computed at all.

        Nothing is added to a sample of which the text mask marks no token as real.
        """
        wide = at_least_float32(modulation) + at_least_float32(self.modulation)
        shift, scale, gate, ff_shift, ff_scale, ff_gate = wide[..., None, :].unbind(2)
        frames = tokens.shape[1]
        modulated = self._modulated(self.attention_norm, tokens, shift, scale).flatten(1, 2)
        update = self.attention(modulated, rope=rope).unflatten(1, (frames, -1))
        tokens = (tokens + gate * update).to(tokens.dtype)
        if conditions.text is not None:
            queries = self.text_norm(tokens).flatten(1, 2)
            tokens = tokens + self._from_text(queries, conditions).unflatten(1, (frames, -1))
        modulated = self._modulated(self.feedforward_norm, tokens, ff_shift, ff_scale)
        return (tokens + ff_gate * self.feedforward(modulated)).to(tokens.dtype)

    def _modulated(
        self, norm: nn.LayerNorm, tokens: Float[Tensor, "b t m d"], shift: Tensor, scale: Tensor
    ) -> Float[Tensor, "b t m d"]:
        """Norms, scales and sums are those of single precision, as in Wan."""
        return modulate(norm(at_least_float32(tokens)), shift, scale).to(tokens.dtype)

    def _from_text(
        self, queries: Float[Tensor, "b n d"], conditions: DitConditions
    ) -> Float[Tensor, "b n d"]:
        text, mask = conditions.text, conditions.text_mask
        if conditions.image is not None:
            return self.text_attention(queries, text, mask, conditions.image)
        if mask is None or mask.is_floating_point():
            return self.text_attention(queries, context=text, mask=mask)
        has_text = mask.any(1, keepdim=True)
        # Softmax needs a token even where the result is thrown away.
        update = self.text_attention(queries, context=text, mask=mask | ~has_text)
        return update * has_text[..., None]
