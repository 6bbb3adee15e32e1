"""Exact zero where a branch must not act at first; everything else keeps PyTorch's own start."""

from typing import TypeVar

from torch import nn

Layer = TypeVar("Layer", bound=nn.Module)


def zero_(layer: Layer) -> Layer:
    """Set every parameter of ``layer`` to zero: its output is zero whatever the input."""
    for parameter in layer.parameters():
        nn.init.zeros_(parameter)
    return layer
