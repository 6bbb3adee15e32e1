"""Marks the weights of a network that learn."""

from torch import nn

from diff4splat.models.adapters.lora import add_lora, is_lora
from diff4splat.models.config.tuning import Tuning

ADDED = ("camera_adapter.", "condition_embedding.")
"""What we add to a public video model, or to each of its experts."""


def prepare_tuning(network: nn.Module, tuning: Tuning, rank: int, seed: int = 0) -> None:
    """Mark the weights that learn; ``lora`` also adds its layers, in place."""
    if tuning == "full":
        return
    if tuning == "lora":
        add_lora(network, rank, seed)
    network.learning = frozenset(
        name for name, _ in network.named_parameters() if is_added(name) or is_lora(name)
    )


def is_added(name: str) -> bool:
    """Whether a weight belongs to a layer that we add."""
    return any(f".{layer}" in f".{name}" for layer in ADDED)


def learns(network: nn.Module, name: str) -> bool:
    """Whether a weight of a network that is trained learns; all do unless marked."""
    learning = getattr(network, "learning", None)
    return learning is None or name in learning
