"""Configurations of CogVideoX's parts in diffusers and transformers → ours.

Supported: CogVideoX-2B, 5B, 5B-I2V, 1.5-5B and 1.5-5B-I2V. Their sizes are read, never assumed;
what a configuration asks for beyond them is refused.
"""

from diff4splat.models.config.joint import JointConfig
from diff4splat.models.config.networks import DitConfig, TextConfig, VaeConfig
from diff4splat.models.public_weights.settings import (
    Source,
    count,
    number,
    require_settings,
    unsupported,
)
from diff4splat.models.wan.source_config import (
    CAMERA_WIDTH,
    MAX_PROMPT_BYTES,
    t5_sizes,
)

TRANSFORMER, VAE, TEXT = "CogVideoXTransformer3DModel", "AutoencoderKLCogVideoX", "T5EncoderModel"
SCHEDULERS = ("CogVideoXDDIMScheduler", "CogVideoXDPMScheduler")
BETAS = {"scaled_linear": "scaled_linear", "linear": "linear", "squaredcos_cap_v2": "cosine"}
LATER_SIZE_PX = (768, 1360)
"""What CogVideoX 1.5 was trained at; its configuration does not say so."""
STRIDE = 8
FEEDFORWARD_FACTOR = 4
MODEL, SCHEDULE = "transformer/config.json", "scheduler/scheduler_config.json"


def dit_config(source: Source) -> DitConfig:
    """Of ``transformer/config.json``.

    Raises:
        CheckpointError: a setting that no supported model has.
    """
    _require_known(source)
    heads = count(source, "num_attention_heads", MODEL)
    width = heads * count(source, "attention_head_dim", MODEL)
    inputs, outputs = (count(source, name, MODEL) for name in ("in_channels", "out_channels"))
    if inputs not in (outputs, 2 * outputs):
        raise unsupported(MODEL, "in_channels", f"{outputs} or {2 * outputs}", inputs)
    return DitConfig(
        width=width,
        blocks=count(source, "num_layers", MODEL),
        heads=heads,
        feedforward_width=FEEDFORWARD_FACTOR * width,
        camera_width=CAMERA_WIDTH,
        render_condition=True,
        padded_text_tokens=count(source, "max_text_seq_length", MODEL),
        condition_channels=inputs - outputs,
    )


def _require_known(source: Source) -> None:
    require_settings(source, MODEL, patch_size=2, temporal_compression_ratio=4, norm_eps=1e-5)
    require_settings(source, MODEL, norm_elementwise_affine=True, attention_bias=True)
    require_settings(source, MODEL, activation_fn="gelu-approximate", timestep_activation_fn="silu")
    require_settings(source, MODEL, flip_sin_to_cos=True, freq_shift=0)
    if source.get("patch_size_t") is None:
        require_settings(source, MODEL, patch_bias=True)
    width = count(source, "time_embed_dim", MODEL)
    if source.get("ofs_embed_dim") not in (None, width):
        raise unsupported(MODEL, "ofs_embed_dim", f"none or {width}", source["ofs_embed_dim"])


def joint_config(source: Source, schedule: Source, vae: Source) -> JointConfig:
    """Of the configurations of the transformer, the scheduler and the autoencoder.

    Raises:
        CheckpointError: a setting that no supported model has.
    """
    frames = (count(source, "sample_frames", MODEL) - 1) // 4 + 1
    rows, columns = (count(source, f"sample_{side}", MODEL) // 2 for side in ("height", "width"))
    patch_frames, positions = source.get("patch_size_t") or 1, _positions(source)
    if patch_frames not in (1, 2) or (patch_frames == 2 and positions != "rotary"):
        raise unsupported(MODEL, "patch_size_t", "none, or 2 with rotary positions", patch_frames)
    return JointConfig(
        level_width=count(source, "time_embed_dim", MODEL),
        patch_frames=patch_frames,
        positions=positions,
        base_grid=(frames, rows, columns),
        space_scale=number(source, "spatial_interpolation_scale", MODEL, 1.875),
        time_scale=number(source, "temporal_interpolation_scale", MODEL, 1.0),
        offset_width=source.get("ofs_embed_dim") or 0,
        inverse_image_scale=bool(vae.get("invert_scale_latents")),
        **_noise(schedule),
    )


def _positions(source: Source) -> str:
    rotary = bool(source.get("use_rotary_positional_embeddings"))
    learned = bool(source.get("use_learned_positional_embeddings"))
    if learned and not rotary:
        raise unsupported(MODEL, "use_learned_positional_embeddings", "false without rotary", True)
    return "learned" if learned else "rotary" if rotary else "sinusoidal"


def _noise(source: Source) -> dict[str, object]:
    """A missing setting has the default of diffusers."""
    if source.get("prediction_type") != "v_prediction":
        raise unsupported(
            SCHEDULE, "prediction_type", "v_prediction", source.get("prediction_type")
        )
    require_settings(source, SCHEDULE, num_train_timesteps=1000, trained_betas=None)
    betas = source.get("beta_schedule", "scaled_linear")
    if betas not in BETAS:
        raise unsupported(SCHEDULE, "beta_schedule", " or ".join(BETAS), betas)
    return {
        "betas": BETAS[betas],
        "first_beta": number(source, "beta_start", SCHEDULE, 0.00085),
        "last_beta": number(source, "beta_end", SCHEDULE, 0.012),
        "snr_shift": number(source, "snr_shift_scale", SCHEDULE, 3.0),
        "zero_terminal_snr": bool(source.get("rescale_betas_zero_snr", False)),
    }


def vae_config(source: Source, tile_px: tuple[int, int] | None = None) -> VaeConfig:
    """Of ``vae/config.json``.

    Raises:
        CheckpointError: a setting that no supported model has.
    """
    where = "vae/config.json"
    require_settings(source, where, in_channels=3, out_channels=3, temporal_compression_ratio=4)
    require_settings(source, where, act_fn="silu", norm_eps=1e-6)
    require_settings(source, where, use_quant_conv=False, use_post_quant_conv=False)
    widths, groups = source.get("block_out_channels"), count(source, "norm_num_groups", where)
    if not isinstance(widths, list) or not all(isinstance(each, int) for each in widths):
        raise unsupported(where, "block_out_channels", "whole numbers", widths)
    if len(widths) != 4 or any(each < 1 or each % groups for each in widths):
        raise unsupported(where, "block_out_channels", f"four multiples of {groups}", widths)
    return VaeConfig(
        latent_channels=count(source, "latent_channels", where),
        widths=tuple(widths),
        blocks=count(source, "layers_per_block", where),
        layout="cogvideox",
        groups=groups,
        tile_px=tile_px or (),
    )


def text_config(source: Source) -> TextConfig:
    """Of ``text_encoder/config.json``.

    Raises:
        CheckpointError: a setting that no supported model has.
    """
    return TextConfig(**t5_sizes(source), max_bytes=MAX_PROMPT_BYTES, encoder="t5")


def latent_statistics(source: Source, channels: int) -> tuple[list[float], list[float]]:
    """Mean and standard deviation of every latent channel.

    Raises:
        CheckpointError: a setting that no supported model has.
    """
    where = "vae/config.json"
    require_settings(source, where, shift_factor=None, latents_mean=None, latents_std=None)
    scale = number(source, "scaling_factor", where, 1.15258426)
    return [0.0] * channels, [1 / scale] * channels


def size_px(source: Source) -> tuple[int, int]:
    """(height, width) that the weights were trained at."""
    if source.get("patch_size_t"):
        return LATER_SIZE_PX
    height, width = (count(source, f"sample_{side}", MODEL) for side in ("height", "width"))
    return STRIDE * height, STRIDE * width
