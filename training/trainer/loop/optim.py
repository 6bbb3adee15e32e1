"""AdamW with warm-up and cosine, and the norm of the whole gradient.

Weights may be sharded: norms are taken over all shards, everything else works on the local ones.
Moments exist from the start, so that every checkpoint has the same keys.
"""

import math
from collections.abc import Iterable, Mapping

import torch
from torch import Tensor
from torch.distributed.tensor import DTensor

from diff4splat.errors import ConfigError
from diff4splat.training.recipe.optimizer import OptimizerSettings


def local(tensor: Tensor) -> Tensor:
    """The shard of this process, sharing memory; an ordinary tensor is its own."""
    return tensor.to_local() if isinstance(tensor, DTensor) else tensor


def create_optimizer(
    parameters: Mapping[str, Tensor], settings: OptimizerSettings
) -> torch.optim.AdamW:
    """AdamW over named weights; weight decay acts on matrices only.

    Raises:
        ConfigError: a learning rate is set for what does not learn.
    """
    rates = dict(settings.part_rates)
    _require_known(rates, parameters)
    groups: dict[tuple[float, float], list[Tensor]] = {}
    for name, parameter in parameters.items():
        decay = settings.weight_decay if parameter.ndim > 1 else 0.0
        groups.setdefault((_rate(name, rates), decay), []).append(parameter)
    optimizer = torch.optim.AdamW(
        [
            {"params": members, "weight_decay": decay, "rate": rate}
            for (rate, decay), members in groups.items()
        ],
        lr=settings.learning_rate,
        betas=settings.betas,
    )
    for parameter in parameters.values():
        optimizer.state[parameter] = {
            "step": torch.tensor(0.0),
            "exp_avg": torch.zeros_like(parameter, requires_grad=False),
            "exp_avg_sq": torch.zeros_like(parameter, requires_grad=False),
        }
    return optimizer


def part_of(name: str) -> str:
    """The model part that a weight belongs to."""
    return name.partition(".")[0]


def _rate(name: str, rates: Mapping[str, float]) -> float:
    """Factor of the longest named part or module that holds the weight."""
    holders = [holder for holder in rates if _holds(holder, name)]
    return rates[max(holders, key=len)] if holders else 1.0


def _holds(holder: str, name: str) -> bool:
    return name.startswith(f"{holder}.")


def _require_known(rates: Mapping[str, float], parameters: Mapping[str, Tensor]) -> None:
    unknown = [holder for holder in rates if not any(_holds(holder, name) for name in parameters)]
    if unknown:
        parts = ", ".join(sorted({part_of(name) for name in parameters}))
        raise ConfigError(
            f"part_rates: expected parts that learn ({parts}), or modules in them, got "
            f"{', '.join(sorted(unknown))}; correct the recipe"
        )


def schedule(step: int, steps: int, settings: OptimizerSettings) -> float:
    """Share of the peak learning rate at a step, counted from 0.

    Linear warm-up that reaches 1 at its last step, then half a cosine down to ``final_fraction``.
    """
    if step < settings.warmup_steps:
        return (step + 1) / settings.warmup_steps
    done = min(1.0, (step - settings.warmup_steps) / max(1, steps - settings.warmup_steps))
    wave = 0.5 * (1 + math.cos(math.pi * done))
    return settings.final_fraction + (1 - settings.final_fraction) * wave


def set_learning_rate(optimizer: torch.optim.Optimizer, rate: float) -> None:
    """Give every group its share of ``rate``."""
    for group in optimizer.param_groups:
        group["lr"] = rate * group["rate"]


def gradient_norm(parameters: Iterable[Tensor]) -> float:
    """2-norm over all weights and shards; equal at all processes, NaN if any gradient is."""
    gradients = [parameter.grad for parameter in parameters if parameter.grad is not None]
    if not gradients:
        return 0.0
    norm = torch.nn.utils.get_total_norm(gradients)
    return float(norm.full_tensor() if isinstance(norm, DTensor) else norm)


def clip_gradient(parameters: Iterable[Tensor], norm: float, largest: float) -> None:
    """Scale the whole gradient of that norm down to ``largest``."""
    if norm > largest:
        gradients = [local(value.grad) for value in parameters if value.grad is not None]
        torch._foreach_mul_(gradients, largest / norm)
