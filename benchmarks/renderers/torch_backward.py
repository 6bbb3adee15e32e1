"""A renderer written in PyTorch as a ``Prepared``: autograd gives the backward pass."""

from collections.abc import Callable
from dataclasses import dataclass, fields

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.scene.gaussians import Gaussians

Draw = Callable[[Gaussians], Tensor]


@dataclass(frozen=True, slots=True, kw_only=True)
class TorchPrepared:
    """``draw`` maps Gaussians to an ``h w 3`` image over black."""

    gaussians: Gaussians
    draw: Draw

    @torch.no_grad()
    def forward(self) -> Float[Tensor, "h w 3"]:
        """The image, no gradients recorded."""
        return self.draw(self.gaussians)

    def forward_backward(self, grad_rgb: Float[Tensor, "h w 3"]) -> Gaussians:
        """The image with gradients recorded, and the backward pass."""
        names = [field.name for field in fields(self.gaussians)]
        leaves = [getattr(self.gaussians, name).detach().requires_grad_() for name in names]
        rgb = self.draw(Gaussians(**dict(zip(names, leaves, strict=True))))
        found = torch.autograd.grad(rgb, leaves, grad_rgb, materialize_grads=True)
        return Gaussians(**dict(zip(names, found, strict=True)))
