"""Two video models, one for high and one for low noise (Wan 2.2 A14B), with the calls of one.

Axes: ``b`` batch, ``c`` latent channels, ``t h w`` latent frames, rows and columns. A sample's
noisiest frame decides: from the boundary on the first expert is asked, below it the second.
"""

from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.config.model import ModelConfig
from diff4splat.models.video_dit.conditions import DitConditions
from diff4splat.models.video_dit.dit import VideoDiT

HIGH, LOW = "high_noise", "low_noise"
"""Attributes of the experts, and prefixes of their weights."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpertConditions:
    """The same conditions as each expert embeds them."""

    high_noise: DitConditions
    low_noise: DitConditions

    def with_text_of(self, other: "ExpertConditions | None") -> "ExpertConditions":
        """As that of ``DitConditions``."""
        return ExpertConditions(
            high_noise=self.high_noise.with_text_of(None if other is None else other.high_noise),
            low_noise=self.low_noise.with_text_of(None if other is None else other.low_noise),
        )


class NoiseExperts(nn.Module):
    """Velocity from the expert for the level."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config.dit
        self.high_noise, self.low_noise = VideoDiT(config), VideoDiT(config)

    def forward(
        self,
        latent: Float[Tensor, "b c t h w"],
        level: Float[Tensor, "b t"],
        *given: Any,
        **more: Any,
    ) -> Float[Tensor, "b c t h w"]:
        """As that of ``VideoDiT``."""
        return self.velocity(latent, level, self.prepare(*given, **more))

    def prepare(self, *given: Any, **more: Any) -> ExpertConditions:
        """As that of ``VideoDiT``, by both."""
        return ExpertConditions(
            high_noise=self.high_noise.prepare(*given, **more),
            low_noise=self.low_noise.prepare(*given, **more),
        )

    def velocity(
        self,
        latent: Float[Tensor, "b c t h w"],
        level: Float[Tensor, "b t"],
        conditions: ExpertConditions,
    ) -> Float[Tensor, "b c t h w"]:
        """Samples of one batch may belong to different experts."""
        noisy = level.amax(1) >= self.config.expert_boundary
        experts = {True: HIGH, False: LOW}
        asked = set(noisy.tolist())
        if len(asked) == 1:
            name = experts[asked.pop()]
            return getattr(self, name).velocity(latent, level, getattr(conditions, name))
        velocity = torch.empty_like(latent)
        for high, name in experts.items():
            rows = (noisy == high).nonzero()[:, 0]
            own = _rows(getattr(conditions, name), rows)
            found = getattr(self, name).velocity(latent[rows], level[rows], own)
            velocity = velocity.index_copy(0, rows, found)
        return velocity


def _rows(conditions: DitConditions, rows: Tensor) -> DitConditions:
    """Those of some samples."""
    assert is_dataclass(conditions)
    named = {field.name: getattr(conditions, field.name) for field in fields(conditions)}
    return DitConditions(
        **{name: None if each is None else each[rows] for name, each in named.items()}
    )
