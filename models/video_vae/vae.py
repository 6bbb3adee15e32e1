"""Causal 3D video autoencoder, 4×8×8 (close to Wan 2.1): video to latents and back.

Axes: ``b`` batch, ``c`` latent channels, ``f`` = 1 + 4 k video frames, ``t h w`` latent frames,
rows and columns. Video is ``b c t h w`` in [−1, 1]. Latents outside this class are *standardised*,
(raw − mean_c) / std_c with the statistics of the training set; until they are set, mean is 0, std
is 1.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.errors import ShapeError
from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.config.networks import TIME_STRIDE, VaeConfig
from diff4splat.models.video_vae.decoder import VaeDecoder
from diff4splat.models.video_vae.encoder import VaeEncoder
from diff4splat.models.video_vae.latent_distribution import LatentDistribution
from diff4splat.models.video_vae.pca_shortcut import PcaShortcut

LOG_VARIANCE_RANGE = (-30.0, 20.0)
"""Clamp that keeps exp() finite in float32 and half precision losses (Stable Diffusion)."""
FIRST_LOG_VARIANCE = -6.0
"""Initial log-variance with a PCA shortcut, whose latents have variance 1."""


class VideoVae(nn.Module):
    """Encoder, decoder and the statistics of their latents."""

    def __init__(self, config: VaeConfig) -> None:
        super().__init__()
        self.config = config
        self.encoder = VaeEncoder(config)
        self.decoder = VaeDecoder(config)
        self.pca_shortcut = _pca_shortcut(config, self.encoder, self.decoder)
        self.register_buffer("latent_mean", torch.zeros(config.latent_channels))
        self.register_buffer("latent_std", torch.ones(config.latent_channels))

    def encode(self, video: Float[Tensor, "b 3 f hh ww"]) -> LatentDistribution:
        """Standardised latents of a video, or of an image when f = 1.

        Raises:
            ShapeError: f is not 1 + 4 k, or a side is not a multiple of ``space_stride``.
        """
        require_video_shape(video, self.config)
        mean, log_variance = self.encoder(video).chunk(2, 1)
        if self.pca_shortcut is not None:
            mean = mean + self.pca_shortcut.encode(video)
        shift, std = self._statistics()
        return LatentDistribution(
            mean=(mean - shift) / std,
            log_variance=log_variance.clamp(*LOG_VARIANCE_RANGE) - 2 * std.log(),
        )

    def decode(self, latent: Float[Tensor, "b c t h w"]) -> Float[Tensor, "b 3 f hh ww"]:
        """Video of 1 + 4 (t − 1) frames in one pass; not clamped to [−1, 1]."""
        frames, _ = self.decode_chunk(latent, self.initial_caches(latent))
        return frames[:, :, TIME_STRIDE - 1 :]

    def decode_chunk(
        self, latent: Float[Tensor, "b c t h w"], caches: tuple[Tensor, ...]
    ) -> tuple[Float[Tensor, "b 3 f hh ww"], tuple[Tensor, ...]]:
        """Four frames per latent frame; drop the first three of the whole video.

        A pure function: chunks in a row give the frames that one pass gives.
        """
        shift, std = self._statistics()
        raw = latent * std + shift
        video, caches = self.decoder(raw, caches)
        return (
            video if self.pca_shortcut is None else video + self.pca_shortcut.decode(raw)
        ), caches

    def initial_caches(self, latent: Float[Tensor, "b c t h w"]) -> tuple[Tensor, ...]:
        """The caches to begin a video of this latent's size with."""
        return self.decoder.initial_caches(latent)

    def set_statistics(self, mean: Float[Tensor, " c"], std: Float[Tensor, " c"]) -> None:
        """Standardise from now on, by statistics of latents encoded with mean 0 and std 1."""
        if not bool((torch.isfinite(std) & (std > 0) & torch.isfinite(mean)).all()):
            raise ShapeError(
                "latent statistics: expected finite means and deviations above 0; measure again"
            )
        self.latent_mean.copy_(mean)
        self.latent_std.copy_(std)

    def _statistics(self) -> tuple[Float[Tensor, "c 1 1 1"], Float[Tensor, "c 1 1 1"]]:
        return self.latent_mean[:, None, None, None], self.latent_std[:, None, None, None]


def require_video_shape(video: Tensor, config: VaeConfig) -> None:
    """Require 1 + 4 k frames and sides that the stride divides.

    Raises:
        ShapeError: other frames or sides.
    """
    frames, height, width = video.shape[2:]
    if frames % TIME_STRIDE != 1:
        nearest = 1 + TIME_STRIDE * (frames // TIME_STRIDE)
        raise ShapeError(f"video frames: expected 1 + 4 k, got {frames}; use {nearest}")
    stride = config.space_stride
    if height % stride or width % stride:
        raise ShapeError(
            f"video size: expected sides that are multiples of {stride} px, "
            f"got {height} by {width}; crop or pad"
        )


def _pca_shortcut(
    config: VaeConfig, encoder: VaeEncoder, decoder: VaeDecoder
) -> PcaShortcut | None:
    """The shortcut, if configured; the convolutions then start as a correction of zero."""
    if not config.pca_shortcut:
        return None
    zero_(encoder.conv_out)
    zero_(decoder.conv_out)
    torch.nn.init.constant_(
        encoder.conv_out.conv.bias[config.latent_channels :], FIRST_LOG_VARIANCE
    )
    return PcaShortcut(config)
