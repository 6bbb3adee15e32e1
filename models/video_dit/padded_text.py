"""Prompts padded with zeros to a fixed length, at the cost of one token more.

Axes: ``b`` batch, ``s`` text tokens, ``e`` width. Wan attends to all 512 tokens of a padded prompt.
Equal keys with equal values count as one whose logit is higher by the logarithm of their number, so
the result is exactly that of all of them.
"""

import math

import torch
from jaxtyping import Bool, Float
from torch import Tensor


def with_padding(
    text: Float[Tensor, "b s e"], mask: Bool[Tensor, "b s"] | None, length: int
) -> tuple[Float[Tensor, "b s2 e"], Float[Tensor, "b s2"]]:
    """Text with one zero token that stands for all padding, and what is added to the logits.

    Tokens beyond ``length`` are dropped.
    """
    text = text[:, :length]
    real = text.new_ones(text.shape[:2], dtype=torch.bool) if mask is None else mask[:, :length]
    logits = torch.zeros_like(text[..., 0]).masked_fill(~real, -math.inf)
    count = (length - real.sum(1, keepdim=True)).to(text)
    padded = torch.cat([text, torch.zeros_like(text[:, :1])], 1)
    return padded, torch.cat([logits, count.log()], 1)
