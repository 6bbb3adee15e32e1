"""Deformation at any query time, one time per call (Diff4Splat appendix; time input of MoVieS).

Axes: ``b`` batch, ``d`` width of LDRM's tokens, ``t h w`` token grid, ``f hh ww`` frames and cells
of the Gaussian grid, ``e`` width of the condition. The query time and the time of each latent frame
are fractions of the clip in [0, 1]: every Gaussian moves from the time of its frame to the query
time.

    tokens ─ linear ─ blocks(time) ─┬─ ×2 ────────┬─ ×2 ────────┬─ ×2 ────┐
                                   1×1 ── up ─ + 1×1 ── up ─ + 1×1 ─ up ─ + 1×1 ── up ── 10 channels

A 1×1 convolution and bilinear upsampling commute, so the sum over levels equals one 1×1
convolution over all levels upsampled and stacked, at a fraction of the memory and time. All 1×1
convolutions start at zero.
"""

from collections.abc import Iterable, Iterator

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.blocks.feedforward import FeedForward
from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.blocks.modulation import ZeroModulation, modulate
from diff4splat.models.blocks.norm import EPSILON
from diff4splat.models.blocks.resize import upsample_bilinear
from diff4splat.models.blocks.time_embedding import EmbeddingMlp, fourier_embedding
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.networks import DEFORMATION_SPLIT, TIME_STRIDE

LEVEL_FRAMES = (2, 2, 1)
"""Frames that each level expands one into; their product is TIME_STRIDE."""
CHANNELS = sum(DEFORMATION_SPLIT)


class TimeBlock(nn.Module):
    """Feed-forward residual, shifted, scaled and gated by the time; the identity when fresh."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width, eps=EPSILON, elementwise_affine=False)
        self.modulation = ZeroModulation(width, width, 3)
        self.feedforward = FeedForward(width, 2 * width)

    def forward(
        self, tokens: Float[Tensor, "b t h w d"], condition: Float[Tensor, "b t e"]
    ) -> Float[Tensor, "b t h w d"]:
        """One condition per latent frame."""
        shift, scale, gate = self.modulation(condition)[:, :, None, None].unbind(-2)
        return tokens + gate * self.feedforward(modulate(self.norm(tokens), shift, scale))


class UpsamplingLevel(nn.Module):
    """Twice the resolution and ``frames`` times the frames."""

    def __init__(self, channels: int, out_channels: int, frames: int) -> None:
        super().__init__()
        self.out_channels = out_channels
        self.expand = nn.Conv2d(channels, out_channels * frames * 4, 1)
        self.smooth = nn.Conv2d(out_channels, out_channels, 3, padding=1)

    def forward(self, features: Float[Tensor, "n c h w"]) -> Float[Tensor, "n2 c2 h2 w2"]:
        """``n`` counts the frames of all batch elements."""
        upsampled = torch.nn.functional.pixel_shuffle(self.expand(features), 2)
        upsampled = upsampled.unflatten(1, (-1, self.out_channels)).flatten(0, 1)
        upsampled = torch.nn.functional.gelu(upsampled, approximate="tanh")
        return upsampled + self.smooth(upsampled)


class DeformationNetwork(nn.Module):
    """Raw offset, rotation and scale correction of every Gaussian at one time."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        deformation = config.deformation
        self.time_frequencies = deformation.time_frequencies
        self.last_scale = (
            config.token_px // 2 ** len(deformation.level_widths) // config.ldrm.grid_stride
        )
        self.token_projection = nn.Linear(config.ldrm.width, deformation.width)
        self.time_mlp = EmbeddingMlp(4 * deformation.time_frequencies, deformation.width)
        self.blocks = nn.ModuleList(
            [TimeBlock(deformation.width) for _ in range(deformation.blocks)]
        )
        widths = (deformation.width, *deformation.level_widths)
        self.levels = nn.ModuleList(
            [
                UpsamplingLevel(*pair, frames)
                for *pair, frames in zip(widths, widths[1:], LEVEL_FRAMES, strict=False)
            ]
        )
        self.heads = nn.ModuleList([zero_(nn.Conv2d(width, CHANNELS, 1)) for width in widths])

    def is_identity(self) -> bool:
        """True while the last layers are exactly zero; then nothing moves."""
        return not any(bool(parameter.any()) for parameter in self.heads.parameters())

    def forward(
        self, tokens: Float[Tensor, "b d t h w"], time: Float[Tensor, " b"]
    ) -> Float[Tensor, "b 10 f hh ww"]:
        """Channels offset 3, rotation 4, scale offset 3; zero means "does not move"."""
        batch = tokens.shape[0]  # len() would freeze the batch size in an export
        features = self._tokens_at(tokens, time).movedim(-1, 2).flatten(0, 1)
        motion = self.heads[0](features)
        for level, head, frames in zip(self.levels, self.heads[1:], LEVEL_FRAMES, strict=True):
            features = level(features)
            motion = upsample_bilinear(motion.repeat_interleave(frames, 0), 2) + head(features)
        # Three frames of the first pack precede the video.
        motion = motion.unflatten(0, (batch, -1))[:, TIME_STRIDE - 1 :]
        frames = motion.shape[1]
        motion = upsample_bilinear(motion.flatten(0, 1), self.last_scale).unflatten(
            0, (batch, frames)
        )
        return motion.transpose(1, 2).to(tokens.dtype)

    def at_times(
        self, tokens: Float[Tensor, "b d t h w"], times: Iterable[Float[Tensor, " b"]]
    ) -> Iterator[Float[Tensor, "b 10 f hh ww"]]:
        """The same at one time after the other."""
        for time in times:
            yield self(tokens, time)

    def _tokens_at(self, tokens: Tensor, time: Tensor) -> Float[Tensor, "b t h w e"]:
        frames = tokens.shape[2]
        latent_frame = torch.arange(frames, dtype=torch.float32, device=tokens.device)
        frame_time = latent_frame / max(frames - 1, 1)
        query = fourier_embedding(time, self.time_frequencies)[:, None].expand(-1, frames, -1)
        source = fourier_embedding(frame_time, self.time_frequencies)[None].expand(
            tokens.shape[0], -1, -1
        )
        condition = self.time_mlp(torch.cat([query, source], -1))
        features = self.token_projection(tokens.movedim(1, -1))
        for block in self.blocks:
            features = block(features, condition)
        return features
