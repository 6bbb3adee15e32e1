"""Operations and kept activations of each network, counted on the meta device.

Networks of equal blocks are run with one block and with two: the difference is a block's share, and
nothing large is ever traced. Axes: ``b`` batch (1 here), ``f`` frames, ``h w`` pixels.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import torch
from torch import Tensor, nn
from torch.overrides import TorchFunctionMode
from torch.utils.flop_counter import FlopCounterMode

from diff4splat.errors import ConfigError
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.factory import create_networks
from diff4splat.models.placement.initial_weights import memory_key
from diff4splat.models.video_dit.camera_adapter import PLUCKER_CHANNELS

ENCODE = "vae encoder"
"""The encoder alone, as stages use a frozen autoencoder."""
TEXT_TOKENS = 128
"""Bytes of a caption."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Operations:
    """One call of a network on one sample, forward only."""

    flops: float
    kept_bytes: float
    """Activations that the backward pass needs, in bfloat16 as far as the network allows."""
    block_bytes: float = 0.0
    """Of one block among them; 0 without blocks."""
    blocks: int = 0

    def recomputed_bytes(self, block_input_bytes: float) -> float:
        """Kept with activation checkpointing: inputs of all blocks, and everything of one."""
        outside = self.kept_bytes - self.blocks * self.block_bytes
        return outside + self.blocks * block_input_bytes + self.block_bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleShape:
    """The video that a stage reads."""

    frames: int
    size_px: tuple[int, int]


@cache
def count(part: str, config: ModelConfig, shape: SampleShape) -> Operations:
    """Operations of one call of a part; ``vae`` encodes and decodes once each.

    Raises:
        ConfigError: a network that is not counted, such as one with a refinement branch.
    """
    if config.refinement.used or part not in CALLS:
        raise ConfigError(
            f"forecast: expected a model of the paper's networks, got {part} of {config.name}; "
            "measure a few steps instead: train --steps 3"
        )
    if part not in BLOCKS:
        return _run(part, config, shape)
    field = BLOCKS[part]
    total = getattr(config, field).blocks
    one, two = (_run(part, _with_blocks(config, field, blocks), shape) for blocks in (1, 2))
    flops, kept = two.flops - one.flops, two.kept_bytes - one.kept_bytes
    return Operations(
        flops=one.flops + (total - 1) * flops,
        kept_bytes=one.kept_bytes + (total - 1) * kept,
        block_bytes=kept,
        blocks=total,
    )


def _with_blocks(config: ModelConfig, field: str, blocks: int) -> ModelConfig:
    return replace(config, **{field: replace(getattr(config, field), blocks=blocks)})


def _run(part: str, config: ModelConfig, shape: SampleShape) -> Operations:
    name = "vae" if part == ENCODE else part
    networks = create_networks(config, "meta", parts=(name,))
    network = getattr(networks, name).to(torch.bfloat16)
    weights = {memory_key(value) for value in network.parameters()}
    kept: dict[int, int] = {}

    def keep(value: Tensor) -> Tensor:
        if memory_key(value) not in weights:
            kept[memory_key(value)] = value.untyped_storage().nbytes()
        alive.append(value)
        return value

    alive: list[Tensor] = []
    with (
        torch.device("meta"),
        _FusedAttention(),
        FlopCounterMode(display=False) as counter,
        torch.autograd.graph.saved_tensors_hooks(keep, lambda value: value),
    ):
        CALLS[part](network, config, shape)
    flops = float(counter.get_total_flops())
    return Operations(flops=flops, kept_bytes=float(sum(kept.values())))


class _FusedAttention(TorchFunctionMode):
    """Attention as GPUs compute it: the matrix of all pairs of tokens is never kept."""

    def __torch_function__(
        self,
        func: Callable[..., Any],
        types: Sequence[type],
        args: tuple[Any, ...] = (),
        kwargs: dict[str, Any] | None = None,
    ) -> Any:
        del types
        kwargs = kwargs or {}
        attention = torch.nn.functional.scaled_dot_product_attention
        if func is attention and kwargs.get("attn_mask") is None:
            return torch.ops.aten._scaled_dot_product_flash_attention(*args)[0]
        return func(*args, **kwargs)


def _numbers(*shape: int) -> Tensor:
    return torch.empty(shape, dtype=torch.bfloat16, requires_grad=True)


def _latent(config: ModelConfig, shape: SampleShape) -> Tensor:
    grid = config.latent_grid(shape.frames, shape.size_px)
    return _numbers(1, config.vae.latent_channels, *grid)


def _rays(shape: SampleShape) -> Tensor:
    return _numbers(1, PLUCKER_CHANNELS, shape.frames, *shape.size_px)


def _encode(network: Any, config: ModelConfig, shape: SampleShape) -> None:
    del config
    network.encode(_numbers(1, 3, shape.frames, *shape.size_px))


def _call_vae(network: Any, config: ModelConfig, shape: SampleShape) -> None:
    _encode(network, config, shape)
    network.decode(_latent(config, shape))


def _call_text(network: nn.Module, config: ModelConfig, shape: SampleShape) -> None:
    del config, shape
    tokens = torch.zeros(1, TEXT_TOKENS, dtype=torch.long)
    network(tokens, torch.ones(1, TEXT_TOKENS, dtype=torch.bool))


def _call_dit(network: Any, config: ModelConfig, shape: SampleShape) -> None:
    latent = _latent(config, shape)
    text = _numbers(1, TEXT_TOKENS, config.text.width)
    conditions = network.prepare(_rays(shape), text)
    network.velocity(latent, torch.zeros(1, latent.shape[2], dtype=torch.bfloat16), conditions)


def _call_ldrm(network: nn.Module, config: ModelConfig, shape: SampleShape) -> None:
    network(_latent(config, shape), _rays(shape))


def _call_deformation(network: nn.Module, config: ModelConfig, shape: SampleShape) -> None:
    frames, rows, columns = config.latent_grid(shape.frames, shape.size_px)
    tokens = _numbers(1, config.ldrm.width, frames, rows // 2, columns // 2)
    network(tokens, torch.zeros(1, dtype=torch.bfloat16))


CALLS: dict[str, Callable[[Any, ModelConfig, SampleShape], None]] = {
    "vae": _call_vae,
    ENCODE: _encode,
    "text_encoder": _call_text,
    "dit": _call_dit,
    "ldrm": _call_ldrm,
    "deformation": _call_deformation,
}
BLOCKS = {"text_encoder": "text", "dit": "dit", "ldrm": "ldrm"}
"""Parts of equal blocks, and where their number stands."""
