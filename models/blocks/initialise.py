"""Zero initialisation of layers that must not act at first; all others keep PyTorch's default."""

from typing import TypeVar

from torch import nn

Layer = TypeVar("Layer", bound=nn.Module)


def zero_(layer: Layer) -> Layer:
    """Set every parameter of ``layer`` to zero: its output is zero whatever the input."""
    for parameter in layer.parameters():
        nn.init.zeros_(parameter)
    return layer
