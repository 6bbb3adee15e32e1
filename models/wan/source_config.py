"""Configurations of Wan's parts in diffusers and transformers → ours.

Supported: T2V-1.3B, T2V-14B, I2V-14B (36 → 16 channels, CLIP states) and TI2V-5B. Their sizes are
read, never assumed; what a configuration asks for beyond them is refused.
"""

from diff4splat.models.config.networks import DitConfig, TextConfig, VaeConfig
from diff4splat.models.public_weights.settings import (
    Source,
    count,
    require_settings,
    unsupported,
)

TRANSFORMER, VAE, TEXT = "WanTransformer3DModel", "AutoencoderKLWan", "UMT5EncoderModel"
TEXT_TOKENS = 512
"""To which Wan pads prompts."""
MAX_PROMPT_BYTES = 8192
"""Far above 512 tokens; longer prompts are cut, as Wan does."""
CAMERA_WIDTH = 64


def dit_config(source: Source) -> DitConfig:
    """Of ``transformer/config.json``.

    Raises:
        CheckpointError: a setting that no supported model has.
    """
    where = "transformer/config.json"
    require_settings(
        source, where, patch_size=[1, 2, 2], cross_attn_norm=True, pos_embed_seq_len=None
    )
    require_settings(source, where, qk_norm="rms_norm_across_heads", eps=1e-6)
    width = count(source, "num_attention_heads", where) * count(source, "attention_head_dim", where)
    inputs, outputs = (count(source, name, where) for name in ("in_channels", "out_channels"))
    image_width = source.get("image_dim") or 0
    require_settings(source, where, added_kv_proj_dim=width if image_width else None)
    return DitConfig(
        width=width,
        blocks=count(source, "num_layers", where),
        heads=count(source, "num_attention_heads", where),
        feedforward_width=count(source, "ffn_dim", where),
        frequency_width=count(source, "freq_dim", where),
        camera_width=CAMERA_WIDTH,
        render_condition=True,
        padded_text_tokens=TEXT_TOKENS,
        condition_channels=inputs - outputs,
        image_width=image_width,
    )


def vae_config(source: Source) -> VaeConfig:
    """Of ``vae/config.json``.

    Raises:
        CheckpointError: a setting that no supported model has.
    """
    where = "vae/config.json"
    require_settings(source, where, attn_scales=[], temperal_downsample=[False, True, True])
    residual, patch = bool(source.get("is_residual")), source.get("patch_size") or 1
    factors = source.get("dim_mult")
    if not isinstance(factors, list) or not all(isinstance(each, int) for each in factors):
        raise unsupported(where, "dim_mult", "whole numbers", factors)
    base = count(source, "base_dim", where)
    decoder_base = source.get("decoder_base_dim") or base
    widths, decoder_widths = (
        tuple(width * each for each in factors) for width in (base, decoder_base)
    )
    require_settings(source, where, in_channels=3 * patch**2, out_channels=3 * patch**2)
    return VaeConfig(
        latent_channels=count(source, "z_dim", where),
        widths=widths,
        pixel_patch=patch,
        blocks=count(source, "num_res_blocks", where),
        layout="wan2.2" if residual else "wan2.1",
        decoder_widths=decoder_widths if decoder_base != base else (),
    )


def text_config(source: Source) -> TextConfig:
    """Of ``text_encoder/config.json``.

    Raises:
        CheckpointError: a setting that no supported model has.
    """
    return TextConfig(**t5_sizes(source), max_bytes=MAX_PROMPT_BYTES, encoder="umt5")


def t5_sizes(source: Source) -> dict[str, int]:
    """Sizes of an encoder of the T5 family.

    Raises:
        CheckpointError: a setting that no supported model has.
    """
    where = "text_encoder/config.json"
    require_settings(source, where, feed_forward_proj="gated-gelu", layer_norm_epsilon=1e-6)
    names = {
        "width": "d_model",
        "blocks": "num_layers",
        "heads": "num_heads",
        "feedforward_width": "d_ff",
        "relative_position_buckets": "relative_attention_num_buckets",
        "max_distance": "relative_attention_max_distance",
        "vocabulary": "vocab_size",
        "head_width": "d_kv",
    }
    return {ours: count(source, theirs, where) for ours, theirs in names.items()}


def latent_statistics(source: Source, channels: int) -> tuple[list[float], list[float]]:
    """Mean and standard deviation of every latent channel.

    Raises:
        CheckpointError: missing, or of another number of channels.
    """
    found = []
    for name in ("latents_mean", "latents_std"):
        values = source.get(name)
        whole = isinstance(values, list) and all(isinstance(v, int | float) for v in values)
        if not whole or len(values) != channels:
            raise unsupported("vae/config.json", name, f"{channels} numbers", values)
        found.append([float(value) for value in values])
    if min(found[1]) <= 0:
        raise unsupported("vae/config.json", "latents_std", "numbers above 0", found[1])
    return found[0], found[1]
