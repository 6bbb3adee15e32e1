"""Depth losses of maps that are constant, empty, or nearly so."""

from collections.abc import Callable, Iterator
from functools import partial

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.stability.check import Check, Outcome
from diff4splat.stability.compare import all_finite, finite_gradients
from diff4splat.training.losses.depth import depth_correlation, depth_log_error, depth_smoothness

GROUP = "losses"
LIMIT = 1e-4
SIDE_PX = 16
Maps = Float[Tensor, "1 1 h w"]


def loss_checks() -> Iterator[Check]:
    """Value and gradient of each loss for pairs of a rendered and a true map."""
    for name, (rendered, truth) in _pairs().items():
        yield Check(
            group=GROUP,
            name=f"correlation, {name}",
            run=partial(measure_loss, depth_correlation, rendered, truth),
            limit=LIMIT,
            error_unit="absolute",
            quick="constant" in name,
        )
    for name, depth in {"constant": _flat(4.0), "zero": _flat(0.0), "1e-30": _flat(1e-30)}.items():
        yield Check(
            group=GROUP,
            name=f"smoothness, {name} depth",
            run=partial(measure_loss, lambda depth, _: depth_smoothness(depth), depth, depth),
            limit=LIMIT,
            error_unit="absolute",
        )
    yield Check(
        group=GROUP,
        name="log error, truth without any valid pixel",
        run=partial(measure_loss, depth_log_error, _ramp(), _flat(0.0)),
        limit=LIMIT,
        error_unit="absolute",
    )


def measure_loss(loss: Callable[[Tensor, Tensor], Tensor], rendered: Maps, truth: Maps) -> Outcome:
    """In float32 against float64, for the same float32 maps."""
    leaf = rendered.float().requires_grad_()
    got = loss(leaf, truth.float())
    exact = loss(rendered.float().double(), truth.float().double())
    return Outcome(
        error=float((got.detach().double() - exact).abs().max()),
        value_finite=all_finite([got]),
        gradient_finite=finite_gradients([got], {"rendered": leaf}),
        note=f"loss {float(got.detach()):.6g}",
    )


def _pairs() -> dict[str, tuple[Maps, Maps]]:
    """Rendered and true maps."""
    ramp = _ramp()
    one = torch.zeros_like(ramp)
    one[..., 0, 0] = 4.0
    lost = ramp.clone()
    lost[..., ::2] = torch.nan
    return {
        "constant depth": (_flat(4.0), ramp),
        "nearly constant depth": (4 + 1e-7 * ramp, ramp),
        "constant truth": (ramp, _flat(4.0)),
        "constant depth and truth": (_flat(4.0), _flat(4.0)),
        "depth 0": (_flat(0.0), ramp),
        "one valid pixel": (ramp, one),
        "truth with NaN": (ramp, lost),
        "depth 1e30": (1e30 * ramp, ramp),
        "depth 1e-30": (1e-30 * ramp, ramp),
        "offset of 1e6": (1e6 + ramp, ramp),
        "the same": (ramp, ramp),
        "opposite": (10 - ramp, ramp),
    }


def _ramp() -> Maps:
    values = torch.linspace(1, 5, SIDE_PX * SIDE_PX, dtype=torch.float64)
    return values.view(1, 1, SIDE_PX, SIDE_PX)


def _flat(value: float) -> Maps:
    return torch.full((1, 1, SIDE_PX, SIDE_PX), value, dtype=torch.float64)
