"""Wan: ``WanPipeline`` and our network of its weights."""

import json
from collections.abc import Callable
from dataclasses import replace

import diffusers
import torch
from torch import Tensor

from denoising.case import CHANNELS, GUIDANCE, TEXT_WIDTH, Case, with_weights
from diff4splat.models.config.sizes import paper_size
from diff4splat.models.wan import source_config
from diff4splat.models.wan.key_map import video_dit_key

TEXT_TOKENS = (24, 2)
"""Of the prompt and of the negative one."""


def tiny_transformer(width: int) -> torch.nn.Module:
    """Random weights in the layout of T2V-1.3B, an eighth as wide."""
    network = diffusers.WanTransformer3DModel(
        num_attention_heads=width // 32,
        attention_head_dim=32,
        in_channels=CHANNELS,
        out_channels=CHANNELS,
        text_dim=TEXT_WIDTH,
        freq_dim=64,
        ffn_dim=4 * width,
        num_layers=6,
    )
    return network.eval()


def diffusers_loop(
    transformer: torch.nn.Module, case: Case
) -> tuple[Callable[[], Tensor], list[float]]:
    """The pipeline class with its Euler scheduler, and the levels that this one visits."""
    scheduler = diffusers.FlowMatchEulerDiscreteScheduler(shift=3.0)
    vae = diffusers.AutoencoderKLWan(base_dim=8, z_dim=CHANNELS, num_res_blocks=1)
    pipeline = diffusers.WanPipeline(
        tokenizer=None, text_encoder=None, vae=vae, scheduler=scheduler, transformer=transformer
    )
    pipeline.set_progress_bar_config(disable=True)
    side = 8 * case.noise.shape[-1]

    def loop() -> Tensor:
        return pipeline(
            prompt_embeds=padded(case.text),
            negative_prompt_embeds=padded(case.negative),
            latents=case.noise.clone(),
            height=side,
            width=side,
            num_frames=case.frames,
            num_inference_steps=case.steps,
            guidance_scale=GUIDANCE,
            output_type="latent",
        ).frames

    loop()
    return loop, scheduler.sigmas.tolist()


def our_network(transformer: torch.nn.Module) -> torch.nn.Module:
    """Ours, with these weights."""
    public = json.loads(json.dumps(dict(transformer.config)))
    settings = replace(source_config.dit_config(public), render_condition=False)
    base = paper_size()
    vae = replace(base.vae, latent_channels=CHANNELS)
    config = replace(base, dit=settings, vae=vae, text=replace(base.text, width=TEXT_WIDTH))
    stored = {video_dit_key(key): value for key, value in transformer.state_dict().items()}
    return with_weights(config, stored)


def padded(text: Tensor) -> Tensor:
    """Zeros up to 512 tokens, as the pipeline pads prompts."""
    return torch.nn.functional.pad(text, (0, 0, 0, 512 - text.shape[1]))
