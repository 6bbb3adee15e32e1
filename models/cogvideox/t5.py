"""T5 1.1 text encoder (arXiv 1910.10683), the one of CogVideoX: UMT5 with one position bias.

Axes: ``b`` prompts, ``s`` tokens, ``d`` width, ``h`` heads. CogVideoX pads prompts before they are
encoded, masks nothing, and its video model attends to the states of the padding: all tokens count
as real.
"""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.models.config.networks import TextConfig
from diff4splat.models.wan.umt5 import Umt5Encoder, distance_bias, umt5_key

PAD = 0
"""Token of the padding."""
SHARED_BIAS = "encoder.block.0.layer.0.SelfAttention.relative_attention_bias."


class T5Encoder(Umt5Encoder):
    """Prompts to the states of a fixed number of tokens."""

    def __init__(self, config: TextConfig, padded_tokens: int) -> None:
        super().__init__(config)
        self.distance_bias = distance_bias(config)
        self.padded_tokens = padded_tokens

    def shared_bias(self, buckets: Int[Tensor, "s s"]) -> Float[Tensor, "s s h"]:
        """That of the first block in the public files."""
        return self.distance_bias(buckets)

    def token_row(self, text: str) -> list[int]:
        """Tokens of a prompt and its padding."""
        row = super().token_row(text)
        return row + [PAD] * (self.padded_tokens - len(row))

    def encode_prompts(
        self, texts: list[str]
    ) -> tuple[Float[Tensor, "b s d"], Bool[Tensor, "b s"]]:
        """States of several prompts, and that all of them are real."""
        states = torch.cat([self.encode_prompt(text) for text in texts])
        return states, torch.ones(states.shape[:2], dtype=torch.bool, device=states.device)


def t5_key(key: str) -> str | None:
    """Our name of a public weight; None for the copy of the embedding that some files hold."""
    if key.startswith(SHARED_BIAS):
        return "distance_bias." + key.removeprefix(SHARED_BIAS)
    return umt5_key(key)
