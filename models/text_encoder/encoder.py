"""Byte-level text encoder in the manner of T5 (arXiv 1910.10683) and ByT5 (arXiv 2105.13626).

Axes: ``b`` prompts, ``s`` tokens, ``d`` width, ``h`` heads. A token is a UTF-8 byte 0 … 255, so
there is no vocabulary file; 256 pads, 257 begins and 258 ends a prompt. Positions enter only as a
learned bias per head and bucket of distances, shared by all blocks. Pre-norm blocks without linear
biases.
"""

import math

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from diff4splat.models.blocks.attention import attend
from diff4splat.models.blocks.norm import TokenRmsNorm
from diff4splat.models.config.networks import TextConfig
from diff4splat.models.text_encoder.prompt import PAD, VOCABULARY, token_row


def tokenize(prompts: list[str], max_bytes: int) -> tuple[Int[Tensor, "b s"], Bool[Tensor, "b s"]]:
    """Tokens padded to the longest prompt, and a mask that is true where they are real.

    Raises:
        InputError: a prompt is empty or longer than ``max_bytes``.
    """
    rows = [token_row(prompt, max_bytes) for prompt in prompts]
    longest = max(map(len, rows))
    tokens = torch.tensor([row + [PAD] * (longest - len(row)) for row in rows])
    return tokens, tokens != PAD


def distance_buckets(length: int, config: TextConfig, device: torch.device) -> Int[Tensor, "s s"]:
    """T5's bidirectional buckets of key − query: near ones exact, far ones logarithmic."""
    position = torch.arange(length, device=device)
    distance = position[None, :] - position[:, None]
    half = config.relative_position_buckets // 2
    exact = half // 2
    # A distance of 0 never reaches the logarithm; the clamp keeps it finite there.
    ratio = (distance.abs().clamp_min(1).float() / exact).log() / math.log(
        config.max_distance / exact
    )
    far = (exact + (ratio * (half - exact)).long()).clamp_max(half - 1)
    bucket = torch.where(distance.abs() < exact, distance.abs(), far)
    return bucket + torch.where(distance > 0, half, 0)


class TextBlock(nn.Module):
    """Self-attention and a gated-GELU perceptron (T5 v1.1)."""

    def __init__(self, config: TextConfig) -> None:
        super().__init__()
        width, hidden = config.width, config.feedforward_width
        self.heads = config.heads
        self.attention_norm = TokenRmsNorm(width)
        self.to_query_key_value = nn.Linear(width, 3 * width, bias=False)
        self.to_output = nn.Linear(width, width, bias=False)
        self.feedforward_norm = TokenRmsNorm(width)
        self.expand = nn.Linear(width, 2 * hidden, bias=False)
        self.contract = nn.Linear(hidden, width, bias=False)

    def forward(
        self, states: Float[Tensor, "b s d"], bias: Float[Tensor, "#b h s s"]
    ) -> Float[Tensor, "b s d"]:
        """``bias`` is added to the attention logits; −∞ hides a token."""
        joint = self.to_query_key_value(self.attention_norm(states))
        query, key, value = joint.unflatten(-1, (3, self.heads, -1)).unbind(2)
        states = states + self.to_output(attend(query, key, value, bias.to(query.dtype)))
        gate, content = self.expand(self.feedforward_norm(states)).chunk(2, -1)
        return states + self.contract(torch.nn.functional.gelu(gate, approximate="tanh") * content)


class TextEncoder(nn.Module):
    """Prompts to one state per byte."""

    def __init__(self, config: TextConfig) -> None:
        super().__init__()
        self.config = config
        self.embedding = nn.Embedding(VOCABULARY, config.width)
        self.distance_bias = nn.Embedding(config.relative_position_buckets, config.heads)
        self.blocks = nn.ModuleList([TextBlock(config) for _ in range(config.blocks)])
        self.norm_out = TokenRmsNorm(config.width)

    def forward(
        self, tokens: Int[Tensor, "b s"], mask: Bool[Tensor, "b s"]
    ) -> Float[Tensor, "b s d"]:
        """States of real tokens; those of padding are zero."""
        buckets = distance_buckets(tokens.shape[1], self.config, tokens.device)
        bias = self.distance_bias(buckets).permute(2, 0, 1)[None]
        bias = bias.masked_fill(~mask[:, None, None], -math.inf)
        states = self.embedding(tokens)
        for block in self.blocks:
            states = block(states, bias)
        return self.norm_out(states) * mask[..., None]

    def encode_prompt(self, text: str) -> Float[Tensor, "1 s d"]:
        """States of one prompt.

        Raises:
            InputError: empty, or longer than ``max_bytes`` in UTF-8.
        """
        tokens, mask = tokenize([text], self.config.max_bytes)
        device = self.embedding.weight.device
        return self(tokens.to(device), mask.to(device))
