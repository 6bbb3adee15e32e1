"""The small network that turns features into residuals, as plain tensors.

Axes: ``f`` features, ``w`` width, ``k`` outputs of a head. The trunk is Linear(f, w) and further
[ReLU, Linear(w, w)]; a head is ReLU, Linear(w, w), ReLU, Linear(w, k) (4D Gaussians, arXiv
2310.08528). The last layer of each head starts at zero, so that the motion starts as the identity.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import linear, relu_

from diff4splat.errors import ConfigError, ShapeError

HEAD_NAMES = ("position", "rotation", "scale", "opacity", "color")
"""In this order; ``color`` has three outputs per harmonic, the others a fixed number."""
HEAD_SIZES = {"position": 3, "rotation": 4, "scale": 3, "opacity": 1}


@dataclass(frozen=True, slots=True, kw_only=True)
class Layer:
    """weight · input + bias."""

    weight: Float[Tensor, "out in"]
    bias: Float[Tensor, " out"]

    def __post_init__(self) -> None:
        if self.weight.ndim != 2 or tuple(self.bias.shape) != tuple(self.weight.shape[:1]):
            got = f"{tuple(self.weight.shape)} and {tuple(self.bias.shape)}"
            raise ShapeError(f"Layer: expected weight (out, in) and bias (out), got {got}")

    def __call__(self, values: Float[Tensor, "*b in"]) -> Float[Tensor, "*b out"]:
        """Apply it."""
        return linear(values, self.weight, self.bias)

    def to(self, target: torch.device | torch.dtype) -> "Layer":
        """Move or cast."""
        return Layer(weight=self.weight.to(target), bias=self.bias.to(target))


@dataclass(frozen=True, slots=True, kw_only=True)
class DecoderSize:
    """How large the network is and what it predicts."""

    width: int = 64
    depth: int = 1
    """Linear layers of the trunk."""
    heads: tuple[str, ...] = ("position", "rotation", "scale")
    """Any of ``HEAD_NAMES``."""
    coefficients: int = 1
    """Harmonics per colour (1, 4, 9 or 16) that the colour head changes."""

    def __post_init__(self) -> None:
        unknown = set(self.heads) - set(HEAD_NAMES)
        if unknown:
            raise ConfigError(
                f"DecoderSize.heads: expected some of {', '.join(HEAD_NAMES)}, "
                f"got {sorted(unknown)}"
            )
        if min(self.width, self.depth, self.coefficients) < 1:
            raise ConfigError(f"DecoderSize: expected whole numbers above 0, got {self}")

    def outputs(self, head: str) -> int:
        """How many numbers ``head`` gives."""
        return HEAD_SIZES.get(head, 3 * self.coefficients)


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionDecoder:
    """Trunk and heads; a head that is not there changes nothing."""

    trunk: tuple[Layer, ...]
    heads: Mapping[str, tuple[Layer, Layer]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        chain = [layer.weight.shape for layer in self.trunk]
        if not chain or any(a[0] != b[1] for a, b in pairwise(chain)):
            raise ShapeError(f"MotionDecoder.trunk: expected a chain of layers, got {chain}")
        for name, (hidden, last) in self.heads.items():
            outputs, fixed = last.weight.shape[0], HEAD_SIZES.get(name)
            fits = hidden.weight.shape[1] == chain[-1][0]
            fits &= last.weight.shape[1] == hidden.weight.shape[0]
            fits &= outputs % 3 == 0 if fixed is None else outputs == fixed
            if not fits or name not in HEAD_NAMES:
                shapes = f"{tuple(hidden.weight.shape)}, {tuple(last.weight.shape)}"
                raise ShapeError(f"MotionDecoder.heads: {name!r} does not fit, got {shapes}")

    def residuals(self, features: Float[Tensor, "*b f"]) -> dict[str, Tensor]:
        """What each head adds, ``*b k``."""
        # Rows, because changing a view in place would copy it on the backward pass.
        values = self.trunk[0](features.flatten(0, -2))
        for layer in self.trunk[1:]:
            values = layer(relu_(values))
        if not self.heads:
            return {}
        # All heads at once: two large products are faster than many small ones.
        first, last = zip(*self.heads.values(), strict=True)
        hidden = relu_(_stacked(first, torch.cat)(relu_(values)))
        sizes = [layer.bias.shape[0] for layer in last]
        predicted = _stacked(last, lambda weights: torch.block_diag(*weights))(hidden)
        parts = predicted.unflatten(0, features.shape[:-1]).split(sizes, -1)
        return dict(zip(self.heads, parts, strict=True))

    def to(self, target: torch.device | torch.dtype) -> "MotionDecoder":
        """Move or cast every tensor."""
        heads = {name: (a.to(target), b.to(target)) for name, (a, b) in self.heads.items()}
        return MotionDecoder(trunk=tuple(layer.to(target) for layer in self.trunk), heads=heads)


def make_decoder(
    features: int,
    size: DecoderSize,
    generator: torch.Generator | None = None,
    zero_heads: bool = True,
) -> MotionDecoder:
    """A float32 network at its start: Xavier-uniform weights, and last layers of zero.

    ``zero_heads=False`` draws the last layers too, as 4DGaussians does: then nothing is static.
    """
    inputs = [features] + [size.width] * (size.depth - 1)
    trunk = tuple(_draw(count, size.width, generator) for count in inputs)
    heads = {}
    for name in (name for name in HEAD_NAMES if name in size.heads):
        hidden = _draw(size.width, size.width, generator)
        last = _draw(size.width, size.outputs(name), generator)
        if zero_heads:
            last = Layer(weight=torch.zeros_like(last.weight), bias=torch.zeros_like(last.bias))
        heads[name] = (hidden, last)
    return MotionDecoder(trunk=trunk, heads=heads)


def _stacked(layers: Sequence[Layer], join: Callable[[list[Tensor]], Tensor]) -> Layer:
    biases = torch.cat([layer.bias for layer in layers])
    return Layer(weight=join([layer.weight for layer in layers]), bias=biases)


def _draw(inputs: int, outputs: int, generator: torch.Generator | None) -> Layer:
    weight = torch.nn.init.xavier_uniform_(torch.empty(outputs, inputs), generator=generator)
    bias = (2 * torch.rand(outputs, generator=generator) - 1) / inputs**0.5
    return Layer(weight=weight, bias=bias)
