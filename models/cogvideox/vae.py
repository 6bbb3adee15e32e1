"""The autoencoder of CogVideoX (4×8×8, 16 channels) with the calls of ``VideoVae``.

Axes: ``b`` batch, ``c`` latent channels, ``f`` = 1 + 4 k video frames, ``t h w`` latent frames,
rows and columns. Video in [−1, 1], standardised latents. Video goes through in chunks of eight
frames, latents of two; the first chunk takes what is left over, so memory does not grow with the
length of the video. With an even number of latent frames the first one still is one frame, which
the encoder made it of; diffusers would repeat it four times.
"""

from collections.abc import Callable, Iterator

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.cogvideox.vae_coders import CogDecoder, CogEncoder
from diff4splat.models.cogvideox.vae_layers import FirstFrameHistory
from diff4splat.models.cogvideox.vae_tiles import Tiles
from diff4splat.models.config.networks import VaeConfig
from diff4splat.models.video_vae.latent_distribution import LatentDistribution
from diff4splat.models.video_vae.vae import LOG_VARIANCE_RANGE, require_video_shape
from diff4splat.models.wan.history import History

CHUNK_FRAMES, CHUNK_LATENTS = 8, 2


class CogVideoXVae(nn.Module):
    """Encoder, decoder and latent statistics, under the names of the public weights."""

    pca_shortcut = None
    """Only ours has one."""

    def __init__(self, config: VaeConfig) -> None:
        super().__init__()
        self.config = config
        self.encoder, self.decoder = CogEncoder(config), CogDecoder(config)
        self.register_buffer("latent_mean", torch.zeros(config.latent_channels))
        self.register_buffer("latent_std", torch.ones(config.latent_channels))

    def encode(self, video: Float[Tensor, "b 3 f hh ww"]) -> LatentDistribution:
        """Standardised latents of a video, or of an image when f = 1.

        Raises:
            ShapeError: f is not 1 + 4 k, or a side is not a multiple of ``space_stride``.
        """
        require_video_shape(video, self.config)
        code = _in_chunks(self.encoder, CHUNK_FRAMES)
        tiles = self._tiles()
        in_tiles = tiles is not None and tiles.needed(video)
        mean, log_variance = (tiles.run(code, video) if in_tiles else code(video)).chunk(2, 1)
        shift, std = self._statistics()
        return LatentDistribution(
            mean=(mean - shift) / std,
            log_variance=log_variance.clamp(*LOG_VARIANCE_RANGE) - 2 * std.log(),
        )

    def decode(self, latent: Float[Tensor, "b c t h w"]) -> Float[Tensor, "b 3 f hh ww"]:
        """Video of 1 + 4 (t − 1) frames in about [−1, 1]."""
        code, tiles = _in_chunks(self._decoded, CHUNK_LATENTS), self._tiles()
        if tiles is None:
            return code(latent)
        tiles = Tiles(size=tiles.out_size, out_size=tiles.size)
        return tiles.run(code, latent) if tiles.needed(latent) else code(latent)

    def decode_chunk(
        self, latent: Float[Tensor, "b c t h w"], caches: tuple[Tensor, ...] | None
    ) -> tuple[Float[Tensor, "b 3 f hh ww"], tuple[Tensor, ...]]:
        """Frames of a chunk, and what the next one needs; no caches: the video begins here.

        A pure function. Chunks as ``chunk_sizes`` cuts them give the frames of ``decode``.
        """
        history = FirstFrameHistory(caches)
        return self._decoded(latent, history), history.caches

    def _decoded(self, latent: Float[Tensor, "b c t h w"], history: History) -> Tensor:
        shift, std = self._statistics()
        return self.decoder(latent * std + shift, history)

    def _statistics(self) -> tuple[Float[Tensor, "c 1 1 1"], Float[Tensor, "c 1 1 1"]]:
        return self.latent_mean[:, None, None, None], self.latent_std[:, None, None, None]

    def _tiles(self) -> Tiles | None:
        """Of the encoder; the decoder's are the same the other way round."""
        if not self.config.tile_px:
            return None
        height, width = self.config.tile_px
        stride = self.config.space_stride
        return Tiles(size=(height, width), out_size=(height // stride, width // stride))


def _in_chunks(
    code: Callable[[Tensor, History], Tensor], frames: int
) -> Callable[[Float[Tensor, "b c t h w"]], Float[Tensor, "b c2 t2 h2 w2"]]:
    """``code`` of a whole video, chunk by chunk."""

    def run(video: Float[Tensor, "b c t h w"]) -> Float[Tensor, "b c2 t2 h2 w2"]:
        caches, coded = None, []
        for chunk in video.split(list(chunk_sizes(video.shape[2], frames)), 2):
            history = FirstFrameHistory(caches)
            coded.append(code(chunk, history))
            caches = history.caches
        return torch.cat(coded, 2)

    return run


def chunk_sizes(count: int, frames: int) -> Iterator[int]:
    """Chunks of ``frames``; what is left over belongs to the first one."""
    chunks = max(count // frames, 1)
    yield count - (chunks - 1) * frames
    yield from [frames] * (chunks - 1)
