"""Wan 2.1 and 2.2 as a family of public models."""

from collections.abc import Mapping

import torch

from diff4splat.errors import CheckpointError
from diff4splat.models.public_weights.family import Family, PublicNetworks, WeightSource
from diff4splat.models.public_weights.options import ImportOptions
from diff4splat.models.public_weights.source_folder import (
    SourceFolder,
    require_class,
    require_same,
)
from diff4splat.models.wan import source_config
from diff4splat.models.wan.key_map import video_dit_key
from diff4splat.models.wan.tokenizer import TOKENIZER_FILE
from diff4splat.models.wan.umt5 import umt5_key

DEFAULT_SIZE_PX = {8: (480, 832), 16: (704, 1280)}
"""By the stride of the autoencoder: what Wan 2.1 and TI2V-5B were trained at."""
SOURCES: Mapping[str, tuple[WeightSource, ...]] = {
    "vae": (WeightSource(folder="vae", rename=str),),
    "text_encoder": (WeightSource(folder="text_encoder", rename=umt5_key),),
    "dit": (WeightSource(folder="transformer", rename=video_dit_key),),
}


def _read(folder: SourceFolder, settings: ImportOptions) -> PublicNetworks:
    if folder.has("transformer_2/config.json"):
        raise CheckpointError(
            f"{folder.root}: expected one transformer, got two experts for high and low noise; "
            "use TI2V-5B or a Wan 2.1 model"
        )
    if settings.tile_px:
        raise CheckpointError(
            f"{folder.root}: expected no tiles for Wan's autoencoder, got {settings.tile_px}; "
            "its memory is bounded without them"
        )
    transformer = _config(folder, "transformer", source_config.TRANSFORMER)
    vae = _config(folder, "vae", source_config.VAE)
    text = _config(folder, "text_encoder", source_config.TEXT)
    vae_config, text_config = source_config.vae_config(vae), source_config.text_config(text)
    require_same(transformer, out_channels=vae_config.latent_channels, text_dim=text_config.width)
    mean, std = source_config.latent_statistics(vae, vae_config.latent_channels)
    return PublicNetworks(
        name=f"wan-{transformer['num_layers']}-blocks",
        size_px=DEFAULT_SIZE_PX.get(vae_config.space_stride, (512, 512)),
        vae=vae_config,
        text=text_config,
        dit=source_config.dit_config(transformer),
        sources=SOURCES,
        statistics={"latent_mean": torch.tensor(mean), "latent_std": torch.tensor(std)},
    )


def _config(folder: SourceFolder, part: str, known: str) -> Mapping[str, object]:
    config = folder.json(f"{part}/config.json")
    require_class(config, (known,), f"{part}/config.json")
    return config


def _tokenizer(folder: SourceFolder) -> bytes:
    return folder.file(f"tokenizer/{TOKENIZER_FILE}").read_bytes()


WAN = Family(pipelines=("WanPipeline", "WanImageToVideoPipeline"), read=_read, tokenizer=_tokenizer)
