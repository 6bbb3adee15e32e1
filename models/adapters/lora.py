"""Low-rank adaptation of linear layers (LoRA, arXiv 2106.09685).

    y = W x + b + scale · up(down(x))        up is zero at first: a fresh layer changes nothing

The weights of the layer stay frozen. ``merged`` folds the product into W, and the network is again
one without such layers.
"""

from collections.abc import Mapping

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.errors import ConfigError
from diff4splat.models.blocks.initialise import zero_

TARGETS = ("to_query", "to_key", "to_value", "to_output")
"""Linear layers that are adapted: those of every attention."""
DOWN, UP, BASE, SCALE = ".lora_down.weight", ".lora_up.weight", ".base.", ".lora_scale"


class LoraLinear(nn.Module):
    """A linear layer and its low-rank correction."""

    def __init__(self, base: nn.Linear, rank: int) -> None:
        super().__init__()
        self.base = base.requires_grad_(False)
        self.lora_down = nn.Linear(base.in_features, rank, bias=False)
        self.lora_up = zero_(nn.Linear(rank, base.out_features, bias=False))
        self.register_buffer("lora_scale", torch.tensor(1.0))

    def forward(self, tokens: Float[Tensor, "*b d"]) -> Float[Tensor, "*b e"]:
        """Both added."""
        return self.base(tokens) + self.lora_scale * self.lora_up(self.lora_down(tokens))


def add_lora(network: nn.Module, rank: int) -> int:
    """Replace the layers that ``TARGETS`` names, in place; returns how many.

    Raises:
        ConfigError: a rank below 1, or no such layer.
    """
    if rank < 1:
        raise ConfigError(f"lora_rank: expected at least 1, got {rank}")
    found = [
        (parent, name, layer)
        for parent in network.modules()
        for name, layer in parent.named_children()
        if name in TARGETS and isinstance(layer, nn.Linear)
    ]
    if not found:
        raise ConfigError(f"LoRA: expected layers named {', '.join(TARGETS)}, got none")
    for parent, name, layer in found:
        setattr(parent, name, LoraLinear(layer, rank))
    return len(found)


def merged(weights: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Weights of a network with such layers as those of one without; others pass unchanged."""
    layers = [key.removesuffix(DOWN) for key in weights if key.endswith(DOWN)]
    plain = {key: value for key, value in weights.items() if ".lora_" not in key}
    for layer in layers:
        up, down = weights[layer + UP].double(), weights[layer + DOWN].double()
        weight = plain.pop(f"{layer}{BASE}weight")
        scale = weights[layer + SCALE].double()
        plain[f"{layer}.weight"] = (weight.double() + scale * up @ down).to(weight.dtype)
        if (bias := plain.pop(f"{layer}{BASE}bias", None)) is not None:
            plain[f"{layer}.bias"] = bias
    return plain


def lora_weights(weights: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """What has to be stored of such a network if the other weights are at hand."""
    return {key: value for key, value in weights.items() if ".lora_" in key}
