"""Wan 2.1 and 2.2 as a family of public models."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import torch

from diff4splat.errors import CheckpointError
from diff4splat.models.config.image_encoder import ImageEncoderConfig
from diff4splat.models.config.networks import DitConfig
from diff4splat.models.image_encoder.public_weights import (
    CLASSES,
    image_encoder_config,
    image_encoder_key,
)
from diff4splat.models.public_weights.family import Family, PublicNetworks, WeightSource
from diff4splat.models.public_weights.options import ImportOptions
from diff4splat.models.public_weights.settings import number, unsupported
from diff4splat.models.public_weights.source_folder import (
    SourceFolder,
    require_class,
    require_same,
)
from diff4splat.models.wan import source_config
from diff4splat.models.wan.experts import HIGH, LOW
from diff4splat.models.wan.key_map import video_dit_key
from diff4splat.models.wan.tokenizer import TOKENIZER_FILE
from diff4splat.models.wan.umt5 import umt5_key

DEFAULT_SIZE_PX = {8: (480, 832), 16: (704, 1280)}
"""By the stride of the autoencoder: what Wan 2.1 and TI2V-5B were trained at."""
INDEX, SECOND, IMAGE = "model_index.json", "transformer_2", "image_encoder"


def _read(folder: SourceFolder, settings: ImportOptions) -> PublicNetworks:
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
    dit, image_encoder = _dit_config(folder, transformer), _image_encoder(folder, transformer)
    return PublicNetworks(
        name=f"wan-{transformer['num_layers']}-blocks",
        size_px=DEFAULT_SIZE_PX.get(vae_config.space_stride, (512, 512)),
        vae=vae_config,
        text=text_config,
        dit=dit,
        image_encoder=image_encoder,
        sources=_sources(dit, image_encoder),
        statistics={"latent_mean": torch.tensor(mean), "latent_std": torch.tensor(std)},
    )


def _dit_config(folder: SourceFolder, transformer: Mapping[str, object]) -> DitConfig:
    """Two experts of Wan 2.2 A14B have the same settings and a level between them."""
    dit = source_config.dit_config(transformer)
    if not folder.has(f"{SECOND}/config.json"):
        return dit
    if source_config.dit_config(_config(folder, SECOND, source_config.TRANSFORMER)) != dit:
        raise CheckpointError(
            f"{folder.root / SECOND}: expected the settings of the first expert, got others; "
            "the folder mixes models"
        )
    boundary = number(folder.json(INDEX), "boundary_ratio", INDEX)
    if boundary >= 1:
        raise unsupported(INDEX, "boundary_ratio", "a number below 1", boundary)
    return replace(dit, expert_boundary=boundary)


def _image_encoder(folder: SourceFolder, transformer: Mapping[str, object]) -> ImageEncoderConfig:
    """Where the video model attends to states of the image."""
    if not transformer.get("image_dim"):
        return ImageEncoderConfig()
    source = folder.json(f"{IMAGE}/config.json")
    require_class(source, CLASSES, f"{IMAGE}/config.json")
    config = image_encoder_config(source)
    require_same(transformer, image_dim=config.width)
    return config


def _sources(
    dit: DitConfig, image_encoder: ImageEncoderConfig
) -> dict[str, tuple[WeightSource, ...]]:
    experts = {"transformer": f"{HIGH}.", SECOND: f"{LOW}."}
    names = experts if dit.expert_boundary else {"transformer": ""}
    found = {
        "vae": (WeightSource(folder="vae", rename=str),),
        "text_encoder": (WeightSource(folder="text_encoder", rename=umt5_key),),
        "dit": tuple(
            WeightSource(folder=folder, rename=video_dit_key, prefix=prefix)
            for folder, prefix in names.items()
        ),
    }
    if image_encoder.used:
        rename = partial(image_encoder_key, blocks=image_encoder.blocks)
        found["image_encoder"] = (WeightSource(folder=IMAGE, rename=rename),)
    return found


def _config(folder: SourceFolder, part: str, known: str) -> Mapping[str, object]:
    config = folder.json(f"{part}/config.json")
    require_class(config, (known,), f"{part}/config.json")
    return config


def _tokenizer(folder: SourceFolder) -> bytes:
    return folder.file(f"tokenizer/{TOKENIZER_FILE}").read_bytes()


WAN = Family(pipelines=("WanPipeline", "WanImageToVideoPipeline"), read=_read, tokenizer=_tokenizer)
