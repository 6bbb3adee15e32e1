"""Low-rank adaptation of linear layers (LoRA, arXiv 2106.09685).

    y = W x + b + scale · up(down(x))        up is zero at first: a fresh layer changes nothing

The weights of the layer stay frozen. ``merged`` folds the product into W, and the network is again
one without such layers.
"""

import hashlib
import math
from collections.abc import Iterator, Mapping

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


def add_lora(network: nn.Module, rank: int, seed: int = 0) -> int:
    """Replace the layers that ``TARGETS`` names, in place; returns how many.

    Initial values depend on the seed and on the name of a layer alone. On the meta device there are
    none; ``initial_lora`` has them.

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
        with torch.random.fork_rng(devices=[]), layer.weight.device:
            setattr(parent, name, LoraLinear(layer, rank))
    weights = network.state_dict()
    for key, value in initial_lora(weights, seed):
        if not weights[key].is_meta:
            weights[key].copy_(value)
    return len(found)


def initial_lora(weights: Mapping[str, Tensor], seed: int) -> Iterator[tuple[str, Tensor]]:
    """Name and initial value of everything that LoRA adds to a network with ``weights``."""
    for key, value in weights.items():
        if key.endswith(DOWN):
            digest = hashlib.blake2b(f"{seed}/{key}".encode(), digest_size=8).digest()
            stream = torch.Generator().manual_seed(int.from_bytes(digest, "big") >> 1)
            down = torch.empty(value.shape)
            yield key, nn.init.kaiming_uniform_(down, a=math.sqrt(5), generator=stream)
        elif key.endswith(UP):
            yield key, torch.zeros(value.shape)
        elif key.endswith(SCALE):
            yield key, torch.tensor(1.0)


def is_lora(key: str) -> bool:
    """Whether a weight is one that LoRA adds."""
    return ".lora_" in key


def with_base(key: str) -> str:
    """The name that a weight of an adapted layer has in the network with LoRA."""
    layer, _, kind = key.rpartition(".")
    return f"{layer}{BASE}{kind}"


def merged(weights: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Weights of a network with such layers as those of one without; others pass unchanged."""
    layers = [key.removesuffix(DOWN) for key in weights if key.endswith(DOWN)]
    plain = {key: value for key, value in weights.items() if not is_lora(key)}
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
    return {key: value for key, value in weights.items() if is_lora(key)}
