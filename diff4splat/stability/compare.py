"""Errors to float64 and finiteness of values and gradients."""

import math
from collections.abc import Iterable, Mapping, Sequence

import torch
from jaxtyping import Float
from torch import Tensor


def relative_error(got: Tensor, exact: Tensor) -> float:
    """Largest difference over the largest exact value; infinite where ``got`` is not finite."""
    got, exact = got.detach().double(), exact.detach().double()
    if got.shape != exact.shape or not all_finite([got, exact]):
        return math.inf
    if got.numel() == 0:
        return 0.0
    scale = float(exact.abs().max())
    difference = float((got - exact).abs().max())
    return difference / scale if scale > 0 else difference


def rms_error(got: Tensor, exact: Tensor) -> float:
    """Root mean square difference; infinite where either is not finite."""
    got, exact = got.detach().double(), exact.detach().double()
    if got.shape != exact.shape or not all_finite([got, exact]):
        return math.inf
    return float((got - exact).square().mean().sqrt()) if got.numel() else 0.0


def all_finite(tensors: Iterable[Tensor]) -> bool:
    """Whether no number is NaN or infinite."""
    return all(bool(torch.isfinite(tensor).all()) for tensor in tensors)


def psnr_db(rmse: float) -> str:
    """Peak signal-to-noise ratio of colours in [0, 1], as text."""
    return "identical" if rmse == 0 else f"{-20 * math.log10(rmse):.0f} dB"


def weighted_sum(outputs: Sequence[Float[Tensor, "..."]]) -> Float[Tensor, ""]:
    """A scalar with a different seeded weight on every number, to differentiate."""
    generator = torch.Generator().manual_seed(3)
    total = outputs[0].new_zeros((), dtype=torch.float64)
    for output in outputs:
        weights = torch.rand(output.shape, generator=generator, dtype=torch.float64)
        total = total + (output.double() * (0.5 + weights)).sum()
    return total


def finite_gradients(outputs: Sequence[Tensor], leaves: Mapping[str, Tensor]) -> bool | None:
    """Whether the gradient of a weighted sum is finite in every leaf; None without a gradient."""
    differentiable = [output for output in outputs if output.requires_grad]
    if not differentiable:
        return None
    gradients = torch.autograd.grad(
        weighted_sum(differentiable), list(leaves.values()), allow_unused=True
    )
    return all_finite(gradient for gradient in gradients if gradient is not None)
