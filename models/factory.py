"""The one place where networks are put together.

Every part starts from its own random stream, so weights depend on the configuration, the seed and
the part alone: not on the caller's random state, nor on whether the text encoder is built.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType

import torch
from torch import nn

from diff4splat.models.config.model import ModelConfig
from diff4splat.models.deformation.network import DeformationNetwork
from diff4splat.models.deformation.refined_network import RefinedDeformation
from diff4splat.models.ldrm.ldrm import Ldrm
from diff4splat.models.text_encoder.encoder import TextEncoder
from diff4splat.models.video_dit.dit import VideoDiT
from diff4splat.models.video_vae.vae import VideoVae


@dataclass(frozen=True, slots=True, kw_only=True)
class Networks:
    """All networks of one model."""

    vae: VideoVae
    text_encoder: TextEncoder | None
    """None when there is no prompt."""
    dit: VideoDiT
    ldrm: Ldrm
    deformation: DeformationNetwork | RefinedDeformation

    def parts(self) -> list[tuple[str, nn.Module]]:
        """(name, network) of the parts that exist."""
        named = [(field.name, getattr(self, field.name)) for field in fields(self)]
        return [(name, part) for name, part in named if part is not None]

    def to(self, target: torch.device | torch.dtype) -> "Networks":
        """Move or cast every part, in place."""
        for _, part in self.parts():
            part.to(target)
        return self


PARTS = tuple(field.name for field in fields(Networks))
"""Names of the networks, in the order of their random streams."""


def create_networks(
    config: ModelConfig,
    device: torch.device | str | None = None,
    *,
    with_text: bool = True,
    seed: int = 0,
    needed: Collection[str] | None = None,
) -> Networks:
    """Networks with random weights that are the same for the same arguments.

    On the meta device nothing is allocated; elsewhere weights are drawn on the CPU and then moved.
    Where ``needed`` names parts, all others stay on the meta device: shapes without weights.
    """
    target = torch.device("cpu" if device is None else device)

    def build(part: str, make: Callable[[], nn.Module]) -> nn.Module:
        wanted = needed is None or part in needed
        return _build(part, make, target if wanted else torch.device("meta"), seed)

    return Networks(
        vae=build("vae", lambda: VideoVae(config.vae)),
        text_encoder=build("text_encoder", lambda: TextEncoder(config.text)) if with_text else None,
        dit=build("dit", lambda: VideoDiT(config)),
        ldrm=build("ldrm", lambda: Ldrm(config)),
        deformation=build("deformation", lambda: _deformation(config)),
    )


def _deformation(config: ModelConfig) -> DeformationNetwork | RefinedDeformation:
    """On tokens (paper), or on the detail decoder's features where there is one."""
    return (RefinedDeformation if config.detail.used else DeformationNetwork)(config)


def create_text_encoder(
    config: ModelConfig, device: torch.device | str = "cpu", seed: int = 0
) -> TextEncoder:
    """The text encoder that ``create_networks`` builds, alone."""
    return _build("text_encoder", lambda: TextEncoder(config.text), torch.device(device), seed)


def _build(part: str, make: Callable[[], nn.Module], target: torch.device, seed: int) -> nn.Module:
    draw_on = target if target.type == "meta" else torch.device("cpu")
    with torch.random.fork_rng(devices=[]), draw_on:
        torch.manual_seed(seed * len(PARTS) + PARTS.index(part))
        return make().to(target)


def parameter_counts(config: ModelConfig) -> Mapping[str, int]:
    """Trainable weights per part, counted without allocating anything."""
    parts = create_networks(config, "meta").parts()
    return MappingProxyType(
        {name: sum(map(torch.numel, part.parameters())) for name, part in parts}
    )
