"""The autoencoders of Wan 2.1 (4×8×8, 16 channels) and Wan 2.2 (4×16×16, 48 channels).

Axes: ``b`` batch, ``c`` latent channels, ``f`` = 1 + 4 k video frames, ``t h w`` latent frames,
rows and columns. The calls are those of ``VideoVae``: video in [−1, 1], standardised latents. Video
goes through in chunks, frame 0 alone and then four frames at a time, so memory does not grow with
the length of the video; a layer over time takes its history from the chunk before.
"""

from collections.abc import Iterator

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.config.networks import TIME_STRIDE, VaeConfig
from diff4splat.models.video_vae.latent_distribution import LatentDistribution
from diff4splat.models.video_vae.vae import LOG_VARIANCE_RANGE, require_video_shape
from diff4splat.models.wan.history import History
from diff4splat.models.wan.vae_decoder import WanDecoder
from diff4splat.models.wan.vae_encoder import WanEncoder


class WanVae(nn.Module):
    """Encoder, decoder and latent statistics, under the names of the public weights."""

    pca_shortcut = None
    """Only ours has one."""

    def __init__(self, config: VaeConfig) -> None:
        super().__init__()
        self.config = config
        channels = config.latent_channels
        self.encoder = WanEncoder(config)
        self.quant_conv = nn.Conv3d(2 * channels, 2 * channels, 1)
        self.post_quant_conv = nn.Conv3d(channels, channels, 1)
        self.decoder = WanDecoder(config)
        self.register_buffer("latent_mean", torch.zeros(channels))
        self.register_buffer("latent_std", torch.ones(channels))

    def encode(self, video: Float[Tensor, "b 3 f hh ww"]) -> LatentDistribution:
        """Standardised latents of a video, or of an image when f = 1.

        Raises:
            ShapeError: f is not 1 + 4 k, or a side is not a multiple of ``space_stride``.
        """
        require_video_shape(video, self.config)
        video = fold_pixels(video, self.config.pixel_patch)
        caches, chunks = None, []
        for chunk in _chunks(video):
            history = History(caches)
            chunks.append(self.encoder(chunk, history))
            caches = history.caches
        mean, log_variance = self.quant_conv(torch.cat(chunks, 2)).chunk(2, 1)
        shift, std = self._statistics()
        return LatentDistribution(
            mean=(mean - shift) / std,
            log_variance=log_variance.clamp(*LOG_VARIANCE_RANGE) - 2 * std.log(),
        )

    def decode(self, latent: Float[Tensor, "b c t h w"]) -> Float[Tensor, "b 3 f hh ww"]:
        """Video of 1 + 4 (t − 1) frames in [−1, 1]."""
        caches, frames = None, []
        for chunk in latent.split(1, 2):
            decoded, caches = self.decode_chunk(chunk, caches)
            frames.append(decoded)
        return torch.cat(frames, 2)

    def decode_chunk(
        self, latent: Float[Tensor, "b c t h w"], caches: tuple[Tensor, ...] | None
    ) -> tuple[Float[Tensor, "b 3 f hh ww"], tuple[Tensor, ...]]:
        """Frames of a chunk, and what the next one needs; no caches: the video begins here.

        A pure function: chunks in a row give the frames that one pass gives.
        """
        shift, std = self._statistics()
        history = History(caches)
        pixels = self.decoder(self.post_quant_conv(latent * std + shift), history)
        return unfold_pixels(pixels, self.config.pixel_patch).clamp(-1, 1), history.caches

    def _statistics(self) -> tuple[Float[Tensor, "c 1 1 1"], Float[Tensor, "c 1 1 1"]]:
        return self.latent_mean[:, None, None, None], self.latent_std[:, None, None, None]


def _chunks(video: Float[Tensor, "b c f h w"]) -> Iterator[Float[Tensor, "b c t h w"]]:
    """Frame 0, then four frames at a time."""
    yield video[:, :, :1]
    yield from video[:, :, 1:].split(TIME_STRIDE, 2) if video.shape[2] > 1 else ()


def fold_pixels(video: Float[Tensor, "b c t h w"], side: int) -> Float[Tensor, "b c2 t h2 w2"]:
    """Blocks of side² pixels as channels, in the order colour, column, row (Wan 2.2)."""
    blocks = video.unflatten(4, (-1, side)).unflatten(3, (-1, side))
    return blocks.permute(0, 1, 6, 4, 2, 3, 5).flatten(1, 3)


def unfold_pixels(pixels: Float[Tensor, "b c t h w"], side: int) -> Float[Tensor, "b c2 t h2 w2"]:
    """The way back."""
    blocks = pixels.unflatten(1, (-1, side, side)).permute(0, 1, 4, 5, 3, 6, 2)
    return blocks.flatten(5, 6).flatten(3, 4)
