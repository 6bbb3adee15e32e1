"""Deformation from the detail decoder's features: one query time per call (MoVieS's time input).

Axes: ``b`` batch, ``d`` channels of features and motion cues, ``k`` key frames, ``n`` = b k,
``h w`` cells of 4 pixels, ``h4 w4`` pixels, ``e`` width of the condition. Times are fractions of
the clip. The answer is multiplied by (query time − own time): a Gaussian is where its own frame saw
it, and what the network says is how fast it leaves. It says so beside the rate at which the pixel
was seen to leave until that time, of which it takes a share of its own:

    offset = elapsed · depth · (enlarged(head + share · seen rate))
"""

from collections.abc import Iterable, Iterator

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.conv_block import CELL_PX, NEIGHBOURS, convex_upsample
from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.blocks.modulation import ZeroModulation
from diff4splat.models.blocks.norm import ChannelRmsNorm
from diff4splat.models.blocks.time_embedding import EmbeddingMlp, octave_embedding
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.networks import DEFORMATION_SPLIT
from diff4splat.models.ldrm.refinement.decoder import widths
from diff4splat.models.ldrm.refinement.motion_features import (
    CUES,
    RATE_UNIT,
    SLOT_CUES,
    SLOTS,
    frames_between,
    slot_shares,
)

CHANNELS = sum(DEFORMATION_SPLIT)


class TimeConvBlock(nn.Module):
    """Convolutional residual, shifted, scaled and gated by the time; the identity when fresh."""

    def __init__(self, width: int, condition_width: int) -> None:
        super().__init__()
        self.norm = ChannelRmsNorm(width)
        self.modulation = ZeroModulation(condition_width, width, 3)
        self.conv_1 = nn.Conv2d(width, width, 3, padding=1)
        self.conv_2 = nn.Conv2d(width, width, 3, padding=1)

    def forward(
        self, features: Float[Tensor, "n c h w"], condition: Float[Tensor, "n e"]
    ) -> Float[Tensor, "n c h w"]:
        """One condition per key frame."""
        shift, scale, gate = self.modulation(condition)[..., None, None].unbind(-4)
        quiet = self.norm(features) * (1 + scale) + shift
        hidden = torch.nn.functional.silu(self.conv_1(torch.nn.functional.silu(quiet)))
        return features + gate * self.conv_2(hidden)


class RefinedDeformation(nn.Module):
    """Raw offset, rotation and scale correction of every key-frame pixel at one time."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        own = config.deformation
        self.time_frequencies = own.time_frequencies
        seen = widths(config.refinement.channels)[0]
        # Features grow along their skips; cues would drown in them.
        self.norm_in = ChannelRmsNorm(seen)
        self.input_conv = nn.Conv2d(seen + CUES, own.width, 3, padding=1)
        self.input_motion = nn.Conv2d(SLOT_CUES, own.width, 3, padding=1)
        self.time_mlp = EmbeddingMlp(4 * own.time_frequencies, own.width)
        self.blocks = nn.ModuleList(
            [TimeConvBlock(own.width, own.width) for _ in range(own.blocks)]
        )
        self.norm = ChannelRmsNorm(own.width)
        self.weights = nn.Conv2d(own.width, NEIGHBOURS * CELL_PX**2, 1)
        self.head = zero_(nn.Conv2d(own.width, CHANNELS + 1, 3, padding=1))

    @property
    def is_identity(self) -> bool:
        """True while the last layer is exactly zero: nothing moves, so leave the network out."""
        return not any(bool(parameter.any()) for parameter in self.head.parameters())

    def forward(
        self, tokens: Float[Tensor, "b d k h w"], time: Float[Tensor, " b"]
    ) -> Float[Tensor, "b 10 k h4 w4"]:
        """Channels offset 3, rotation 4, scale offset 3; zero means "does not move"."""
        return self._at(self._input_features(tokens), tokens, time)

    def at_times(
        self, tokens: Float[Tensor, "b d k h w"], times: Iterable[Float[Tensor, " b"]]
    ) -> Iterator[Float[Tensor, "b 10 k h4 w4"]]:
        """The same at one time after the other; what does not depend on time is computed once."""
        input_features = self._input_features(tokens)
        for time in times:
            yield self._at(input_features, tokens, time)

    def _input_features(self, tokens: Float[Tensor, "b d k h w"]) -> Float[Tensor, "n c h w"]:
        seen, cues = tokens.transpose(1, 2).flatten(0, 1).tensor_split([-CUES], 1)
        return self.input_conv(torch.cat([self.norm_in(seen), cues], 1))

    def _at(
        self, input_features: Float[Tensor, "n c h w"], tokens: Tensor, time: Float[Tensor, " b"]
    ) -> Float[Tensor, "b 10 k h4 w4"]:
        batch, _, keys = tokens.shape[:3]
        own = torch.arange(keys, dtype=torch.float32, device=tokens.device) / max(keys - 1, 1)
        elapsed, condition = time[:, None] - own, self._condition(time, own)
        now = _seen_at(tokens, elapsed)
        features = input_features + self.input_motion(now)
        for block in self.blocks:
            features = block(features, condition)
        features = torch.nn.functional.silu(self.norm(features))
        raw, share = self.head(features).split([CHANNELS, 1], 1)
        raw = torch.cat([raw[:, :3] + share * RATE_UNIT * now[:, :3], raw[:, 3:]], 1)
        raw = raw * _lengths(tokens).to(features.dtype)
        motion = convex_upsample(raw, self.weights(features)).unflatten(0, (batch, keys))
        elapsed = elapsed[..., None, None, None].to(motion.dtype)
        return (elapsed * motion).transpose(1, 2).to(tokens.dtype)

    def _condition(
        self, time: Float[Tensor, " b"], own: Float[Tensor, " k"]
    ) -> Float[Tensor, "n e"]:
        query = octave_embedding(time, self.time_frequencies)[:, None].expand(-1, len(own), -1)
        source = octave_embedding(own, self.time_frequencies)[None].expand(len(time), -1, -1)
        return self.time_mlp(torch.cat([query, source], -1)).flatten(0, 1)


def _seen_at(
    tokens: Float[Tensor, "b d k h w"], elapsed: Float[Tensor, "b k"]
) -> Float[Tensor, "n 4 h w"]:
    """Rate and difference of every cell at one time, between those of the nearest slots."""
    keys = tokens.shape[2]
    slots = tokens[:, -CUES:-1].transpose(1, 2).unflatten(2, (SLOTS, SLOT_CUES))
    shares = slot_shares(elapsed * frames_between(keys)).to(tokens.dtype)
    return torch.einsum("bks,bksdhw->bkdhw", shares, slots).flatten(0, 1)


def _lengths(tokens: Float[Tensor, "b d k h w"]) -> Float[Tensor, "n 10 h w"]:
    """Relative depth for the channels of the offset, 1 for all others."""
    offsets = torch.arange(CHANNELS, device=tokens.device) < DEFORMATION_SPLIT[0]
    log_depth = tokens[:, -1:].transpose(1, 2).flatten(0, 1)
    return (log_depth * offsets[:, None, None]).exp()
