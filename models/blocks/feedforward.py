"""Two-layer perceptron with tanh-GELU, applied to each token separately.

Axes: ``*b n`` tokens, ``d`` width. The tanh form is explicit: exporters that fall back on the erf
form change the network by up to 4e-4.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn


class FeedForward(nn.Module):
    """d → hidden → d."""

    def __init__(self, width: int, hidden_width: int) -> None:
        super().__init__()
        self.expand = nn.Linear(width, hidden_width)
        self.contract = nn.Linear(hidden_width, width)

    def forward(self, tokens: Float[Tensor, "*b n d"]) -> Float[Tensor, "*b n d"]:
        """W₂ gelu(W₁ x + b₁) + b₂."""
        return self.contract(torch.nn.functional.gelu(self.expand(tokens), approximate="tanh"))
