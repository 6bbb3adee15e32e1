"""CogVideoX and CogVideoX 1.5 as a family of public models."""

from collections.abc import Mapping

import torch

from diff4splat.models.cogvideox import source_config
from diff4splat.models.cogvideox.key_map import joint_dit_key
from diff4splat.models.cogvideox.t5 import t5_key
from diff4splat.models.public_weights.family import Family, PublicNetworks, WeightSource
from diff4splat.models.public_weights.options import ImportOptions
from diff4splat.models.public_weights.sentencepiece import PIECES_FILE, tokenizer_json
from diff4splat.models.public_weights.source_folder import (
    SourceFolder,
    require_class,
    require_same,
)
from diff4splat.models.wan.tokenizer import TOKENIZER_FILE

SOURCES: Mapping[str, tuple[WeightSource, ...]] = {
    "vae": (WeightSource(folder="vae", rename=str),),
    "text_encoder": (WeightSource(folder="text_encoder", rename=t5_key),),
    "dit": (WeightSource(folder="transformer", rename=joint_dit_key),),
}


def _read(folder: SourceFolder, settings: ImportOptions) -> PublicNetworks:
    transformer = folder.json(source_config.MODEL)
    vae, text = folder.json("vae/config.json"), folder.json("text_encoder/config.json")
    schedule = folder.json(source_config.SCHEDULE)
    require_class(transformer, (source_config.TRANSFORMER,), source_config.MODEL)
    require_class(vae, (source_config.VAE,), "vae/config.json")
    require_class(text, (source_config.TEXT,), "text_encoder/config.json")
    require_class(schedule, source_config.SCHEDULERS, source_config.SCHEDULE)
    vae_config = source_config.vae_config(vae, settings.tile_px)
    text_config, channels = source_config.text_config(text), vae_config.latent_channels
    require_same(transformer, out_channels=channels, text_embed_dim=text_config.width)
    mean, std = source_config.latent_statistics(vae, channels)
    return PublicNetworks(
        name=f"cogvideox-{transformer['num_layers']}-blocks",
        size_px=source_config.size_px(transformer),
        vae=vae_config,
        text=text_config,
        dit=source_config.dit_config(transformer),
        joint=source_config.joint_config(transformer, schedule, vae),
        sources=SOURCES,
        statistics={"latent_mean": torch.tensor(mean), "latent_std": torch.tensor(std)},
    )


def _tokenizer(folder: SourceFolder) -> bytes:
    """The public folders hold the vocabulary as SentencePiece alone."""
    if folder.has(f"tokenizer/{TOKENIZER_FILE}"):
        return folder.file(f"tokenizer/{TOKENIZER_FILE}").read_bytes()
    return tokenizer_json(folder.file(f"tokenizer/{PIECES_FILE}"))


COGVIDEOX = Family(
    pipelines=("CogVideoXPipeline", "CogVideoXImageToVideoPipeline"),
    read=_read,
    tokenizer=_tokenizer,
)
