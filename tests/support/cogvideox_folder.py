"""Tiny random CogVideoX models, saved by diffusers and transformers themselves."""

import json
from pathlib import Path

import pytest
import torch
from wan_folder import WORDS, spread_, write_tokenizer

HEADS, HEAD_WIDTH, TEXT_WIDTH, TEXT_TOKENS, CHANNELS = 2, 16, 16, 11, 4
KINDS = ("2b", "5b", "5b_i2v", "1.5", "1.5_i2v")
SCALE, LEVEL_WIDTH = 0.7, 24


def transformer(kind: str = "2b"):
    """The layouts of 2B, 5B, 5B-I2V, 1.5-5B and 1.5-5B-I2V at tiny width."""
    diffusers = pytest.importorskip("diffusers", reason="needs the package diffusers")
    later, image = kind.startswith("1.5"), kind.endswith("i2v")
    torch.manual_seed(1)
    network = diffusers.CogVideoXTransformer3DModel(
        num_attention_heads=HEADS,
        attention_head_dim=HEAD_WIDTH,
        in_channels=2 * CHANNELS if image else CHANNELS,
        out_channels=CHANNELS,
        time_embed_dim=LEVEL_WIDTH,
        ofs_embed_dim=LEVEL_WIDTH if kind == "1.5_i2v" else None,
        text_embed_dim=TEXT_WIDTH,
        num_layers=2,
        sample_width=6,
        sample_height=4,
        sample_frames=9,
        patch_size_t=2 if later else None,
        max_text_seq_length=TEXT_TOKENS,
        use_rotary_positional_embeddings=kind != "2b",
        use_learned_positional_embeddings=kind == "5b_i2v",
    )
    if kind == "5b_i2v":
        # As after training: no sinusoids any more, and text has a position too.
        network.patch_embed.pos_embedding = torch.randn_like(network.patch_embed.pos_embedding)
    return spread_(network)


def vae(kind: str = "2b"):
    """A tiny autoencoder."""
    diffusers = pytest.importorskip("diffusers", reason="needs the package diffusers")
    torch.manual_seed(2)
    network = diffusers.AutoencoderKLCogVideoX(
        block_out_channels=(4, 8, 8, 12),
        latent_channels=CHANNELS,
        layers_per_block=1,
        norm_num_groups=2,
        sample_height=32,
        sample_width=48,
        scaling_factor=SCALE,
        invert_scale_latents=kind == "1.5_i2v",
    )
    return spread_(network)


def text_encoder():
    """A tiny T5 1.1: one position bias for all blocks."""
    transformers = pytest.importorskip("transformers", reason="needs the package transformers")
    torch.manual_seed(3)
    config = transformers.T5Config(
        vocab_size=len(WORDS),
        d_model=TEXT_WIDTH,
        d_kv=6,
        d_ff=24,
        num_layers=3,
        num_heads=2,
        feed_forward_proj="gated-gelu",
    )
    return spread_(transformers.T5EncoderModel(config))


def scheduler(kind: str = "2b"):
    """The schedule of the public models."""
    diffusers = pytest.importorskip("diffusers", reason="needs the package diffusers")
    return diffusers.CogVideoXDDIMScheduler(
        beta_schedule="scaled_linear",
        prediction_type="v_prediction",
        rescale_betas_zero_snr=True,
        timestep_spacing="trailing",
        snr_shift_scale=3.0 if kind == "2b" else 1.0,
        clip_sample=False,
    )


def write_cogvideox(
    folder: Path, kind: str = "2b", dtype: torch.dtype = torch.float32, **options
) -> Path:
    """A whole model folder, saved by the libraries; ``max_shard_size`` cuts it into shards."""
    transformer(kind).to(dtype).save_pretrained(folder / "transformer", **options)
    vae(kind).to(dtype).save_pretrained(folder / "vae")
    text_encoder().to(dtype).save_pretrained(folder / "text_encoder", **options)
    scheduler(kind).save_pretrained(folder / "scheduler")
    write_tokenizer(folder / "tokenizer")
    image = kind.endswith("i2v")
    index = {"_class_name": "CogVideoXImageToVideoPipeline" if image else "CogVideoXPipeline"}
    (folder / "model_index.json").write_text(json.dumps(index))
    return folder
