"""Text tokens of a prompt, as the motion U-Net takes them.

Axes: ``b`` batch, ``s`` text tokens, ``e`` their width.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class TextTokens:
    """States of text tokens; a sample without a real token equals one without text."""

    states: Float[Tensor, "b s e"]
    """0 where a token is not real."""
    mask: Bool[Tensor, "b s"]
    """True where a token is real."""

    @property
    def has_text(self) -> Bool[Tensor, " b"]:
        """Whether a sample has any real token."""
        return self.mask.any(1)

    @property
    def attention_mask(self) -> Bool[Tensor, "b s"]:
        """The mask, but all true for samples without text: softmax needs at least one token."""
        return self.mask | ~self.has_text[:, None]

    def pooled(self, null_embedding: Float[Tensor, " e"]) -> Float[Tensor, "b e"]:
        """The mean over real tokens, ``null_embedding`` where there are none."""
        mean = self.states.sum(1) / self.mask.sum(1, keepdim=True).clamp_min(1)
        return torch.where(self.has_text[:, None], mean, null_embedding)


def text_tokens(text: Float[Tensor, "b s e"], mask: Bool[Tensor, "b s"] | None) -> TextTokens:
    """All tokens are real where no mask is given."""
    if mask is None:
        mask = torch.ones(text.shape[:2], dtype=torch.bool, device=text.device)
    return TextTokens(states=text.masked_fill(~mask[..., None], 0), mask=mask)
