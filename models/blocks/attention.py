"""Multi-head attention with root-mean-square-normalised queries and keys.

Axes: ``b`` batch, ``n`` tokens, ``s`` tokens attended to, ``d`` width (all heads together).
The norm runs over the whole width before it is split into heads, as in Wan 2.1.
"""

import math

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from diff4splat.models.blocks.norm import TokenRmsNorm
from diff4splat.models.blocks.rope import RopeTables, rotate
from diff4splat.models.placement.shared_tokens import TokenGroup


def attend(
    query: Float[Tensor, "b n h c"],
    key: Float[Tensor, "b s h c"],
    value: Float[Tensor, "b s h c"],
    bias: Float[Tensor, "#b #h #n s"] | Bool[Tensor, "#b #h #n s"] | None = None,
) -> Float[Tensor, "b n d"]:
    """softmax(q kᵀ / √c + bias) v, heads joined; a Boolean bias marks what may be attended to."""
    # The exporter lays the fused operation's output out otherwise than it was traced.
    attention = _by_formula if torch.compiler.is_exporting() else _fused
    heads = attention(query.transpose(1, 2), key.transpose(1, 2), value.transpose(1, 2), bias)
    return heads.transpose(1, 2).flatten(2)


def _fused(query: Tensor, key: Tensor, value: Tensor, bias: Tensor | None) -> Tensor:
    return torch.nn.functional.scaled_dot_product_attention(query, key, value, attn_mask=bias)


def _by_formula(query: Tensor, key: Tensor, value: Tensor, bias: Tensor | None) -> Tensor:
    logits = (query * query.shape[-1] ** -0.5) @ key.mT
    if bias is not None and bias.dtype == torch.bool:
        logits = logits.masked_fill(~bias, -math.inf)
    elif bias is not None:
        logits = logits + bias
    return logits.softmax(-1) @ value


class Attention(nn.Module):
    """Self-attention, or cross-attention to tokens of ``context_width``."""

    def __init__(self, width: int, heads: int, context_width: int | None = None) -> None:
        super().__init__()
        self.heads = heads
        source = width if context_width is None else context_width
        self.to_query = nn.Linear(width, width)
        self.to_key = nn.Linear(source, width)
        self.to_value = nn.Linear(source, width)
        self.to_output = nn.Linear(width, width)
        self.query_norm = TokenRmsNorm(width)
        self.key_norm = TokenRmsNorm(width)
        self.sharing: TokenGroup | None = None
        """Processes that share the tokens of a self-attention."""

    def forward(
        self,
        tokens: Float[Tensor, "b n d"],
        context: Float[Tensor, "b s e"] | None = None,
        rope: RopeTables | None = None,
        mask: Bool[Tensor, "b s"] | Float[Tensor, "b s"] | None = None,
    ) -> Float[Tensor, "b n d"]:
        """Attend to ``context`` (default: the tokens themselves) where ``mask`` is true.

        A ``mask`` of numbers is added to the logits.
        """
        source = tokens if context is None else context
        query = self._split(self.query_norm(self.to_query(tokens)))
        key = self._split(self.key_norm(self.to_key(source)))
        value = self._split(self.to_value(source))
        if rope is not None:
            query, key = rotate(query, rope), rotate(key, rope)
        if self.sharing is not None and context is None and mask is None:
            return self.to_output(self._shared(self.sharing, query, key, value))
        bias = None if mask is None else mask[:, None, None]
        return self.to_output(attend(query, key, value, bias))

    def _shared(
        self, sharing: TokenGroup, query: Tensor, key: Tensor, value: Tensor
    ) -> Float[Tensor, "b s d"]:
        """The tokens of this process after they attended to those of all processes."""
        query, key, value = sharing.to_heads(torch.stack([query, key, value])).unbind(0)
        heads = attend(query, key, value).unflatten(-1, (query.shape[2], -1))
        return sharing.to_tokens(heads).flatten(2)

    def _split(self, tokens: Float[Tensor, "b n d"]) -> Float[Tensor, "b n h c"]:
        return tokens.unflatten(-1, (self.heads, -1))
