"""Newton's method held inside a bracket, and the step that carries gradients through a root.

The root x of f(x; k) = y has the differential dx = (dy - ∂f/∂k dk) / f′(x): roots are found without
gradients, and ``with_gradient`` attaches that differential to them.
"""

from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor

STEPS = 50
"""At most; five or six do, except next to a turning point."""


@torch.no_grad()
def solve_rising(
    evaluate: Callable[[Tensor], tuple[Tensor, Tensor]],
    target: Float[Tensor, "*b"],
    start: Float[Tensor, "*b"],
    upper: float,
) -> Float[Tensor, "*b"]:
    """Where in [0, upper] a rising f has the value ``target``; ``evaluate`` gives f and slope.

    A step that leaves the bracket is replaced by halving it. Targets outside f's range end at an
    end of the interval; the caller looks at the residual.
    """
    low, high = torch.zeros_like(target), torch.full_like(target, upper)
    x = torch.minimum(start.clamp_min(0), high)
    for _ in range(STEPS):
        value, slope = evaluate(x)
        above = value > target
        high, low = torch.where(above, x, high), torch.where(above, low, x)
        step = x - (value - target) / slope
        inside = (step >= low) & (step <= high)
        following = torch.where(inside, step, (low + high) / 2)
        settled = (following - x).abs() <= 1e-15 * x.abs()
        x = following
        if bool(settled.all()):
            break
    return x


def with_gradient(
    root: Float[Tensor, "*b"], residual: Float[Tensor, "*b"], slope: Float[Tensor, "*b"]
) -> Float[Tensor, "*b"]:
    """The root itself, with the gradient of ``-residual / slope``.

    ``residual`` is f(root; k) - y with gradients to k and y; root and slope are constants.
    """
    return root - (residual - residual.detach()) / slope
