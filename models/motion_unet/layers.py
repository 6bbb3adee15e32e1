"""Layers of the motion U-Net: modulated convolutions, means over frames, text cross-attention.

Axes: ``n`` = b t maps (the latent frames of a sample one after another), ``c`` channels, ``h w``
cells, ``e`` width of a condition or of a text token. Whatever a block adds from conditions,
text and other frames is zero at first.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.attention import Attention
from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.blocks.modulation import ZeroModulation
from diff4splat.models.blocks.norm import ChannelRmsNorm
from diff4splat.models.motion_unet.text_tokens import TextTokens

MODULATIONS = 2
"""A scale and a shift."""
RANDOM_CELLS = 24
"""Random features that texts are compared by."""


class ModulatedConvBlock(nn.Module):
    """x + conv(silu(norm(conv(silu(norm(x)))) · (1 + scale) + shift)) (FiLM, arXiv 1709.07871)."""

    def __init__(self, channels: int, condition_width: int) -> None:
        super().__init__()
        self.norm_1, self.norm_2 = ChannelRmsNorm(channels), ChannelRmsNorm(channels)
        self.conv_1 = nn.Conv2d(channels, channels, 3, padding=1)
        self.conv_2 = nn.Conv2d(channels, channels, 3, padding=1)
        self.modulation = ZeroModulation(condition_width, channels, MODULATIONS)

    def forward(
        self, features: Float[Tensor, "n c h w"], condition: Float[Tensor, "n e"]
    ) -> Float[Tensor, "n c h w"]:
        """Same size."""
        scale, shift = self.modulation(condition)[..., None, None].unbind(1)
        hidden = self.conv_1(torch.nn.functional.silu(self.norm_1(features)))
        modulated = self.norm_2(hidden) * (1 + scale) + shift
        return features + self.conv_2(torch.nn.functional.silu(modulated))


class TemporalMeanMixing(nn.Module):
    """x + linear(mean of x over the frames of its sample)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.project = zero_(nn.Conv2d(channels, channels, 1))

    def forward(self, features: Float[Tensor, "n c h w"], samples: int) -> Float[Tensor, "n c h w"]:
        """``samples`` is b; every one has n / b frames."""
        frames = features.unflatten(0, (samples, -1))
        return (frames + self.project(frames.mean(1))[:, None]).flatten(0, 1)


class TextCrossAttention(nn.Module):
    """x + attention(norm(x), text): every cell attends to the text tokens."""

    def __init__(self, channels: int, heads: int, text_width: int) -> None:
        super().__init__()
        self.norm = ChannelRmsNorm(channels)
        self.attention = Attention(channels, heads, text_width)
        zero_(self.attention.to_output)

    def forward(
        self, features: Float[Tensor, "n c h w"], text: TextTokens
    ) -> Float[Tensor, "n c h w"]:
        """Nothing is added to a sample without text."""
        return features + self._added(features, text)

    def added_to_random(self, text: TextTokens, generator: torch.Generator) -> Float[Tensor, "b r"]:
        """What a text adds to the same random features of every sample."""
        gain = self.norm.gain
        features = torch.randn(gain.shape[0], RANDOM_CELLS, 1, generator=generator).to(gain)
        added = self._added(features.expand(text.states.shape[0], -1, -1, -1), text)
        return added.flatten(1)

    def _added(
        self, features: Float[Tensor, "n c h w"], text: TextTokens
    ) -> Float[Tensor, "n c h w"]:
        has_text = text.has_text.to(features)[:, None, None]
        by_frame = self.norm(features).unflatten(0, (has_text.shape[0], -1)).movedim(2, -1)
        update = self.attention(by_frame.flatten(1, 3), text.states, mask=text.attention_mask)
        update = (update * has_text).unflatten(1, by_frame.shape[1:4])
        return update.movedim(-1, 2).flatten(0, 1)


class UNetLevel(nn.Module):
    """One resolution of the encoder: convolutions, mean over frames, text cross-attention."""

    def __init__(self, channels: int, condition_width: int, heads: int, text_width: int) -> None:
        super().__init__()
        self.block = ModulatedConvBlock(channels, condition_width)
        self.frame_mean = TemporalMeanMixing(channels)
        self.text_attention = TextCrossAttention(channels, heads, text_width)

    def forward(
        self,
        features: Float[Tensor, "n c h w"],
        condition: Float[Tensor, "n e"],
        samples: int,
        text: TextTokens | None,
    ) -> Float[Tensor, "n c h w"]:
        """Without ``text`` there is no cross-attention."""
        features = self.frame_mean(self.block(features, condition), samples)
        return features if text is None else self.text_attention(features, text)
