"""What a prompt asks to move, as query vectors.

Axes: ``b`` prompts, ``s`` text tokens, ``e`` width of their states, ``c`` channels, ``q`` queries.
The text encoder works on bytes and stays frozen. Convolutions find words in its states, attention
finds those that name what moves.

    text ─ linear ─ convolutions of 5 tokens, dilated 1, 2, 4 ─ attention pooling ─ MLP ─ queries
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.norm import ChannelRmsNorm
from diff4splat.models.motion_unet.text_tokens import TextTokens

KERNEL = 5
DILATIONS = (1, 2, 4)
POOLS = 8
"""Weighted means over all tokens, each with weights of its own."""
QUERIES = 2
"""A prompt may name two objects that have little in common."""


class TokenConv(nn.Module):
    """x + conv(silu(norm(x))) along the text."""

    def __init__(self, channels: int, dilation: int) -> None:
        super().__init__()
        padding = dilation * (KERNEL // 2)
        self.norm = ChannelRmsNorm(channels)
        self.conv = nn.Conv1d(channels, channels, KERNEL, padding=padding, dilation=dilation)

    def forward(self, states: Float[Tensor, "b c s"], real: Float[Tensor, "b 1 s"]) -> Tensor:
        """Same size; tokens that are not ``real`` stay zero, whatever their number."""
        return (states + self.conv(torch.nn.functional.silu(self.norm(states)) * real)) * real


class TextQueries(nn.Module):
    """Query vectors, and a bias each; those of no text are learnt."""

    def __init__(self, text_width: int, channels: int, query_width: int) -> None:
        super().__init__()
        self.input = nn.Linear(text_width, channels)
        self.convs = nn.ModuleList([TokenConv(channels, dilation) for dilation in DILATIONS])
        self.pool_weights = nn.Linear(channels, POOLS)
        self.hidden = nn.Linear(POOLS * channels, 2 * channels)
        self.output = nn.Linear(2 * channels, QUERIES * (query_width + 1))
        self.null_pooled = nn.Parameter(torch.zeros(POOLS * channels))

    def forward(self, text: TextTokens) -> tuple[Float[Tensor, "b q c"], Float[Tensor, "b q"]]:
        """Queries and biases."""
        pooled = torch.where(text.has_text[:, None], self._pooled(text), self.null_pooled)
        hidden = torch.nn.functional.silu(self.hidden(pooled))
        queries = self.output(hidden).unflatten(-1, (QUERIES, -1))
        return queries[..., :-1], queries[..., -1]

    def _pooled(self, text: TextTokens) -> Float[Tensor, "b p"]:
        real = text.mask.to(text.states)[:, None]
        states = self.input(text.states).movedim(-1, 1) * real
        for conv in self.convs:
            states = conv(states, real)
        logits = self.pool_weights(states.movedim(1, -1))
        weights = logits.masked_fill(~text.attention_mask[..., None], -math.inf).softmax(1)
        return torch.einsum("bsp,bcs->bpc", weights, states).flatten(1)
