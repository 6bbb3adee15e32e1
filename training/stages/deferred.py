"""Deferred back-propagation through renders (as in ARF, arXiv 2206.06360, §3.3).

An image is rendered without a graph. When its gradient is there, it is rendered again with a graph,
the gradient goes on to the Gaussians, and the graph is let go: memory holds the intermediates of
one image, whatever the number of images. Values and gradients are the same as without.

An operation of its own: ``torch.utils.checkpoint`` drops saved tensors alone, and the rasteriser
keeps arrays of its own between its passes.
"""

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor

Images = tuple[Tensor, Tensor]
"""Colour and depth."""


def deferred(draw: Callable[..., Images], *tensors: Tensor) -> Images:
    """``draw(*tensors)``, which runs again in the backward pass; it must not be random.

    Gradients reach ``tensors`` alone.
    """
    return _Deferred.apply(draw, *tensors)


class _Deferred(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, draw: Callable[..., Images], *tensors: Tensor) -> Images:
        ctx.draw = draw
        ctx.save_for_backward(*tensors)
        return draw(*tensors)

    @staticmethod
    def backward(ctx: Any, *incoming: Tensor) -> tuple[Tensor | None, ...]:
        wanted = ctx.needs_input_grad[1:]
        leaves = [
            value.detach().requires_grad_(needed)
            for value, needed in zip(ctx.saved_tensors, wanted, strict=True)
        ]
        with torch.enable_grad():
            outputs = ctx.draw(*leaves)
        learning = [leaf for leaf in leaves if leaf.requires_grad]
        found = iter(torch.autograd.grad(outputs, learning, incoming, allow_unused=True))
        return (None, *(next(found) if needed else None for needed in wanted))
