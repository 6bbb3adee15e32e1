"""Pre-norm Transformer block: x + attention(norm(x)), then x + feed-forward(norm(x)).

Axes: ``b`` batch, ``n`` tokens, ``d`` width.
"""

from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.attention import Attention
from diff4splat.models.blocks.feedforward import FeedForward
from diff4splat.models.blocks.norm import EPSILON
from diff4splat.models.blocks.rope import RopeTables


class TransformerBlock(nn.Module):
    """Self-attention with rotary positions, and a perceptron."""

    def __init__(self, width: int, heads: int, feedforward_width: int) -> None:
        super().__init__()
        self.attention_norm = nn.LayerNorm(width, eps=EPSILON)
        self.attention = Attention(width, heads)
        self.feedforward_norm = nn.LayerNorm(width, eps=EPSILON)
        self.feedforward = FeedForward(width, feedforward_width)

    def forward(self, tokens: Float[Tensor, "b n d"], rope: RopeTables) -> Float[Tensor, "b n d"]:
        """Every token attends to every other."""
        tokens = tokens + self.attention(self.attention_norm(tokens), rope=rope)
        return tokens + self.feedforward(self.feedforward_norm(tokens))
