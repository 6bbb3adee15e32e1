"""Deformation from refinement features, one query time per call (time input of MoVieS).

Axes: ``b`` batch, ``d`` channels of features and motion features, ``k`` key frames, ``n`` = b k,
``h w`` cells of 4 pixels, ``h4 w4`` pixels, ``e`` width of the condition. Times are fractions of
the clip. The output is a rate, multiplied by elapsed = query time − time of the key frame, so a
Gaussian has no offset at its key frame. The network adds a predicted share of the rate that optical
flow measured until the query time:

    offset = elapsed · depth · upsampled(head + share · measured rate)
"""

from collections.abc import Iterable, Iterator

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.conv_block import CELL_PX, NEIGHBOURS, convex_upsample
from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.blocks.modulation import ZeroModulation
from diff4splat.models.blocks.norm import ChannelRmsNorm
from diff4splat.models.blocks.time_embedding import EmbeddingMlp, fourier_embedding
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.networks import DEFORMATION_SPLIT
from diff4splat.models.ldrm.refinement.decoder import widths
from diff4splat.models.ldrm.refinement.motion_features import (
    INPUT_CHANNELS,
    MOTION_CHANNELS,
    input_motion,
    keyframe_span,
    slot_weights,
)
from diff4splat.models.ldrm.refinement.warped_flow import RATE_UNIT, SLOT_CUES, SLOTS

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
        modulated = self.norm(features) * (1 + scale) + shift
        hidden = torch.nn.functional.silu(self.conv_1(torch.nn.functional.silu(modulated)))
        return features + gate * self.conv_2(hidden)


class RefinedDeformation(nn.Module):
    """Raw offset, rotation and scale correction of every key-frame pixel at one time."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        deformation = config.deformation
        self.time_frequencies = deformation.time_frequencies
        channels = widths(config.refinement.channels)[0]
        # Features grow along the skip connections and would dominate the motion features.
        self.norm_in = ChannelRmsNorm(channels)
        self.input_conv = nn.Conv2d(channels + INPUT_CHANNELS, deformation.width, 3, padding=1)
        self.input_motion = nn.Conv2d(SLOT_CUES, deformation.width, 3, padding=1)
        self.time_mlp = EmbeddingMlp(4 * deformation.time_frequencies, deformation.width)
        self.blocks = nn.ModuleList(
            [TimeConvBlock(deformation.width, deformation.width) for _ in range(deformation.blocks)]
        )
        self.norm = ChannelRmsNorm(deformation.width)
        self.weights = nn.Conv2d(deformation.width, NEIGHBOURS * CELL_PX**2, 1)
        self.head = zero_(nn.Conv2d(deformation.width, CHANNELS + 1, 3, padding=1))

    def is_identity(self) -> bool:
        """True while the last layer is exactly zero; then nothing moves."""
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
        flat = tokens.transpose(1, 2).flatten(0, 1)
        features, motion = flat.tensor_split([-MOTION_CHANNELS], 1)
        return self.input_conv(torch.cat([self.norm_in(features), input_motion(motion)], 1))

    def _at(
        self, input_features: Float[Tensor, "n c h w"], tokens: Tensor, time: Float[Tensor, " b"]
    ) -> Float[Tensor, "b 10 k h4 w4"]:
        batch, _, keys = tokens.shape[:3]
        key_times = torch.arange(keys, dtype=torch.float32, device=tokens.device) / max(keys - 1, 1)
        elapsed, condition = time[:, None] - key_times, self._condition(time, key_times)
        measured = _measured_motion(tokens, elapsed)
        features = input_features + self.input_motion(measured)
        for block in self.blocks:
            features = block(features, condition)
        features = torch.nn.functional.silu(self.norm(features))
        raw, share = self.head(features).split([CHANNELS, 1], 1)
        raw = torch.cat([raw[:, :3] + share * RATE_UNIT * measured[:, :3], raw[:, 3:]], 1)
        raw = raw * _lengths(tokens).to(features.dtype)
        motion = convex_upsample(raw, self.weights(features)).unflatten(0, (batch, keys))
        elapsed = elapsed[..., None, None, None].to(motion.dtype)
        return (elapsed * motion).transpose(1, 2).to(tokens.dtype)

    def _condition(
        self, time: Float[Tensor, " b"], key_times: Float[Tensor, " k"]
    ) -> Float[Tensor, "n e"]:
        query = fourier_embedding(time, self.time_frequencies)[:, None].expand(
            -1, len(key_times), -1
        )
        source = fourier_embedding(key_times, self.time_frequencies)[None].expand(
            time.shape[0], -1, -1
        )
        return self.time_mlp(torch.cat([query, source], -1)).flatten(0, 1)


def _measured_motion(
    tokens: Float[Tensor, "b d k h w"], elapsed: Float[Tensor, "b k"]
) -> Float[Tensor, "n 4 h w"]:
    """Rate and difference of every cell at one time, interpolated from the two nearest slots."""
    keys = tokens.shape[2]
    slots = tokens[:, -MOTION_CHANNELS:-1].transpose(1, 2).unflatten(2, (SLOTS, SLOT_CUES))
    weights = slot_weights(elapsed * keyframe_span(keys)).to(tokens.dtype)
    return torch.einsum("bks,bksdhw->bkdhw", weights, slots).flatten(0, 1)


def _lengths(tokens: Float[Tensor, "b d k h w"]) -> Float[Tensor, "n 10 h w"]:
    """Relative depth for the channels of the offset, 1 for all others."""
    offsets = torch.arange(CHANNELS, device=tokens.device) < DEFORMATION_SPLIT[0]
    log_depth = tokens[:, -1:].transpose(1, 2).flatten(0, 1)
    return (log_depth * offsets[:, None, None]).exp()
