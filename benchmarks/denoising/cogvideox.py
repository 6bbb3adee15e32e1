"""CogVideoX: ``CogVideoXPipeline`` and our network of its weights."""

import json
from collections.abc import Callable
from dataclasses import replace

import diffusers
import torch
from torch import Tensor

from denoising.case import CHANNELS, GUIDANCE, TEXT_WIDTH, Case, with_weights
from diff4splat.models.cogvideox import source_config
from diff4splat.models.cogvideox.key_map import joint_dit_key
from diff4splat.models.cogvideox.noise_schedule import trained_levels
from diff4splat.models.config.sizes import paper_size

TEXT_TOKENS = (226, 226)
"""Of the prompt and of the negative one, both padded."""


def tiny_transformer(width: int) -> torch.nn.Module:
    """Random weights in the layout of 5B, a sixteenth as wide."""
    network = diffusers.CogVideoXTransformer3DModel(
        num_attention_heads=width // 32,
        attention_head_dim=32,
        in_channels=CHANNELS,
        out_channels=CHANNELS,
        text_embed_dim=TEXT_WIDTH,
        time_embed_dim=64,
        num_layers=6,
        use_rotary_positional_embeddings=True,
    )
    return network.eval()


def _scheduler() -> diffusers.CogVideoXDDIMScheduler:
    return diffusers.CogVideoXDDIMScheduler(
        prediction_type="v_prediction",
        rescale_betas_zero_snr=True,
        timestep_spacing="trailing",
        snr_shift_scale=1.0,
        clip_sample=False,
    )


def diffusers_loop(
    transformer: torch.nn.Module, case: Case
) -> tuple[Callable[[], Tensor], list[float]]:
    """The pipeline class with its DDIM scheduler, and the levels that this one visits."""
    scheduler = _scheduler()
    vae = diffusers.AutoencoderKLCogVideoX(
        block_out_channels=(8, 8, 8, 8), layers_per_block=1, norm_num_groups=2
    )
    pipeline = diffusers.CogVideoXPipeline(
        tokenizer=None, text_encoder=None, vae=vae, scheduler=scheduler, transformer=transformer
    )
    pipeline.set_progress_bar_config(disable=True)
    side = 8 * case.noise.shape[-1]

    def loop() -> Tensor:
        latent = pipeline(
            prompt_embeds=case.text,
            negative_prompt_embeds=case.negative,
            latents=case.noise.transpose(1, 2).clone(),
            height=side,
            width=side,
            num_frames=case.frames,
            num_inference_steps=case.steps,
            guidance_scale=GUIDANCE,
            output_type="latent",
        ).frames
        return latent.transpose(1, 2)

    loop()
    table = trained_levels(_joint(transformer))
    return loop, [*(float(table[int(step)]) for step in scheduler.timesteps), 0.0]


def _joint(transformer: torch.nn.Module) -> source_config.JointConfig:
    public, schedule = (
        json.loads(json.dumps(dict(each.config))) for each in (transformer, _scheduler())
    )
    return source_config.joint_config(public, schedule, {})


def our_network(transformer: torch.nn.Module) -> torch.nn.Module:
    """Ours, with these weights."""
    public = json.loads(json.dumps(dict(transformer.config)))
    settings = replace(source_config.dit_config(public), render_condition=False)
    base = paper_size()
    config = replace(
        base,
        dit=settings,
        joint=_joint(transformer),
        vae=replace(base.vae, latent_channels=CHANNELS),
        text=replace(base.text, width=TEXT_WIDTH),
    )
    stored = {joint_dit_key(key): value for key, value in transformer.state_dict().items()}
    return with_weights(config, stored)
