"""Block of CogVideoX: text and video attend to each other as one sequence.

Axes: ``b`` batch, ``s`` text tokens, ``t`` frames of tokens, ``m`` tokens of a frame, ``d`` width,
``e`` width of the embedded level. Both share every weight but those of the modulation (adaLN-zero,
arXiv 2212.09748), of which each has its own. A frame is modulated by its own noise level, text by
the last frame's.
"""

import torch
from jaxtyping import Complex, Float
from torch import Tensor, nn

from diff4splat.models.blocks.attention import attend
from diff4splat.models.blocks.feedforward import FeedForward
from diff4splat.models.blocks.modulation import ZeroModulation
from diff4splat.models.blocks.norm import EPSILON
from diff4splat.models.blocks.precision import at_least_float32
from diff4splat.models.config.networks import DitConfig

MODULATIONS = 6
"""Shift, scale and gate of the video, then of the text."""
NORM_EPSILON = 1e-5

Pair = tuple[Float[Tensor, "b s d"], Float[Tensor, "b t m d"]]
"""Text and video."""
Gates = tuple[Float[Tensor, "b 1 d"], Float[Tensor, "b t 1 d"]]
"""Of text and of video."""


class JointNorm(nn.Module):
    """One norm, then a modulation of text and another of video."""

    def __init__(self, width: int, level_width: int) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width, eps=NORM_EPSILON)
        self.modulation = ZeroModulation(level_width, width, MODULATIONS)

    def forward(
        self,
        text: Float[Tensor, "b s d"],
        video: Float[Tensor, "b t m d"],
        embedding: Float[Tensor, "b t e"],
    ) -> tuple[Pair, Gates]:
        """Both modulated, and both gates."""
        vectors = self.modulation(embedding)
        shift, scale, gate = vectors[:, :, :3, None].unbind(2)
        text_shift, text_scale, text_gate = vectors[:, -1, 3:, None].unbind(1)
        text = torch.addcmul(text_shift, self.norm(text), 1 + text_scale)
        video = torch.addcmul(shift, self.norm(video), 1 + scale)
        return (text, video), (text_gate, gate)


class JointAttention(nn.Module):
    """Self-attention of the joined sequence; queries and keys are normalised per head."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.to_query, self.to_key = nn.Linear(width, width), nn.Linear(width, width)
        self.to_value, self.to_output = nn.Linear(width, width), nn.Linear(width, width)
        self.query_norm = nn.LayerNorm(width // heads, eps=EPSILON)
        self.key_norm = nn.LayerNorm(width // heads, eps=EPSILON)

    def forward(
        self, tokens: Float[Tensor, "b n d"], turns: Complex[Tensor, "n 1 p"] | None, skipped: int
    ) -> Float[Tensor, "b n2 d"]:
        """``turns`` covers all tokens; the first ``skipped`` ones are only attended to."""
        query = self.query_norm(self._split(self.to_query(tokens[:, skipped:])))
        key = self.key_norm(self._split(self.to_key(tokens)))
        if turns is not None:
            query, key = turned(query, turns[skipped:]), turned(key, turns)
        return self.to_output(attend(query, key, self._split(self.to_value(tokens))))

    def _split(self, tokens: Float[Tensor, "b n d"]) -> Float[Tensor, "b n h c"]:
        return tokens.unflatten(-1, (self.heads, -1))


class JointBlock(nn.Module):
    """The identity when fresh: its gates start at zero."""

    def __init__(self, config: DitConfig, level_width: int) -> None:
        super().__init__()
        self.attention_norm = JointNorm(config.width, level_width)
        self.attention = JointAttention(config.width, config.heads)
        self.feedforward_norm = JointNorm(config.width, level_width)
        self.feedforward = FeedForward(config.width, config.feedforward_width)

    def forward(
        self,
        text: Float[Tensor, "b s d"],
        video: Float[Tensor, "b t m d"],
        embedding: Float[Tensor, "b t e"],
        turns: Complex[Tensor, "n 1 p"] | None,
        last: bool = False,
    ) -> tuple[Float[Tensor, "b s2 d"], Float[Tensor, "b t m d"]]:
        """Attention, then the perceptron, each with its gates; no text comes out of the last."""
        normed, gates = self.attention_norm(text, video, embedding)
        skipped = text.shape[1] if last else 0
        update = self.attention(_join(normed), turns, skipped)
        text, video = _gated((text[:, skipped:], video), update, gates)
        normed, gates = self.feedforward_norm(text, video, embedding)
        return _gated((text, video), self.feedforward(_join(normed)), gates)


def turned(
    heads: Float[Tensor, "b n h c"], turns: Complex[Tensor, "n 1 p"]
) -> Float[Tensor, "b n h c"]:
    """Every pair of channels as a complex number, multiplied by its token's turn."""
    pairs = torch.view_as_complex(at_least_float32(heads).unflatten(-1, (-1, 2)))
    return torch.view_as_real(pairs * turns).flatten(-2).to(heads.dtype)


def _join(pair: Pair) -> Float[Tensor, "b n d"]:
    return torch.cat([pair[0], pair[1].flatten(1, 2)], 1)


def _gated(pair: Pair, update: Float[Tensor, "b n d"], gates: Gates) -> Pair:
    """Both plus their gate times their part of the update."""
    text, video = pair
    count = text.shape[1]
    text = torch.addcmul(text, gates[0], update[:, :count])
    return text, torch.addcmul(video, gates[1], update[:, count:].unflatten(1, video.shape[1:3]))
