"""What the loops of every family get, and ours."""

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import torch
from safetensors.torch import save_file
from torch import Tensor

from diff4splat.flow.guidance import CallCount, Guidance
from diff4splat.flow.samplers import SAMPLERS, integrate
from diff4splat.generation.video.video_sampling import Conditions, video_velocity
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.mapped_weights import map_weights
from diff4splat.models.video_dit.conditions import ImageCondition

CHANNELS, TEXT_WIDTH = 16, 128
GUIDANCE = 5.0


@dataclass(frozen=True, kw_only=True)
class Case:
    """What both loops get."""

    noise: Tensor
    text: Tensor
    negative: Tensor
    steps: int

    @property
    def frames(self) -> int:
        """Of the video."""
        return 4 * (self.noise.shape[2] - 1) + 1


def our_loop(dit: torch.nn.Module, case: Case, levels: list[float]) -> Callable[[], Tensor]:
    """Euler steps with guidance."""
    conditions = Conditions(
        image_latent=case.noise[:, :, :1],
        plucker=None,
        text=case.text,
        negative_text=case.negative,
        image=ImageCondition(),
    )

    @torch.no_grad()
    def loop() -> Tensor:
        guidance = Guidance(weight=GUIDANCE)
        velocity = video_velocity(dit, conditions, guidance, CallCount())
        return integrate(SAMPLERS["euler"], velocity, case.noise, levels)

    return loop


def with_weights(config: ModelConfig, stored: Mapping[str, Tensor]) -> torch.nn.Module:
    """Our network with these weights, mapped from a file as an imported model's are."""
    fresh = create_networks(config, parts=("dit",)).dit.state_dict()
    tensors = {
        key: stored.get(key, value).reshape(value.shape).contiguous()
        for key, value in fresh.items()
    }
    dit = create_networks(config, "meta", parts=("dit",)).dit
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "dit.safetensors"
        save_file(tensors, file)
        map_weights(dit, "dit", file)
    return dit
