"""Graphs of the video autoencoder and the video model.

The decoder takes one latent frame or several, with the caches of those before. The sampler stays
outside: one graph embeds the conditions, another is one evaluation of the velocity.
"""

import torch
from torch import Tensor, nn

from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.networks import TIME_STRIDE, TOKEN_PATCH
from diff4splat.models.onnx.shapes import Axis
from diff4splat.models.onnx_export.source import (
    GraphSource,
    InputSource,
    TensorFunction,
    mask,
    normal,
    output,
    unit,
)
from diff4splat.models.video_dit.conditions import DitConditions, RenderCondition

FRAMES: Axis = f"{TIME_STRIDE}*packs+1"
LATENT_FRAMES: Axis = "packs+1"


def vae_graphs(network: nn.Module, config: ModelConfig) -> list[GraphSource]:
    """Encoder and decoder."""
    return [_encoder(network, config), _decoder(network, config)]


def dit_graphs(network: nn.Module, config: ModelConfig) -> list[GraphSource]:
    """Embedded conditions, and the velocity that they lead to."""
    return [_conditions(network, config), _velocity(network, config)]


def _encoder(network: nn.Module, config: ModelConfig) -> GraphSource:
    def encode(vae: nn.Module, video: Tensor) -> tuple[Tensor, Tensor]:
        found = vae.encode(video)
        return found.mean, found.log_variance

    stride, channels = config.vae.space_stride, config.vae.latent_channels
    latent = ("batch", channels, LATENT_FRAMES, "rows", "columns")
    video = ("batch", 3, FRAMES, f"{stride}*rows", f"{stride}*columns")
    return GraphSource(
        name="vae_encoder",
        part="vae",
        module=TensorFunction(network, encode),
        inputs=(normal("video", *video),),
        outputs=(output("mean", *latent), output("log_variance", *latent)),
    )


def _decoder(network: nn.Module, config: ModelConfig) -> GraphSource:
    def decode(vae: nn.Module, latent: Tensor, *caches: Tensor) -> tuple[Tensor, ...]:
        video, following = vae.decode_chunk(latent, caches)
        return video, *following

    stride, channels = config.vae.space_stride, config.vae.latent_channels
    caches = _caches(network, channels)
    latent = normal("latent", "batch", channels, "frames", "rows", "columns")
    pixels = (f"{stride}*rows", f"{stride}*columns")
    return GraphSource(
        name="vae_decoder",
        part="vae",
        module=TensorFunction(network, decode),
        inputs=(latent, *caches),
        outputs=(
            output("video", "batch", 3, f"{TIME_STRIDE}*frames", *pixels),
            *(output(f"next_{cache.spec.name}", *cache.spec.shape) for cache in caches),
        ),
    )


def _caches(network: nn.Module, channels: int) -> list[InputSource]:
    """Two frames before each causal convolution, in the order of the calls."""
    one_cell = torch.zeros(1, channels, 1, 1, 1, device="meta")
    return [
        normal(f"cache_{index}", "batch", *cache.shape[1:3], *_scaled(cache.shape[3]))
        for index, cache in enumerate(network.initial_caches(one_cell))
    ]


def _scaled(factor: int) -> tuple[Axis, Axis]:
    if factor == 1:
        return "rows", "columns"
    return f"{factor}*rows", f"{factor}*columns"


def _conditions(network: nn.Module, config: ModelConfig) -> GraphSource:
    rendered = config.dit.render_condition

    def embed(dit: nn.Module, *inputs: Tensor) -> tuple[Tensor, ...]:
        camera, text, text_mask = inputs[:3]
        condition = RenderCondition(latent=inputs[3], validity=inputs[4]) if rendered else None
        found = dit.prepare(camera, text, text_mask, condition)
        states = (found.camera, found.text, found.pooled_text, found.render_tokens)
        return tuple(tensor for tensor in states if tensor is not None)

    pixels = (f"{config.token_px}*rows", f"{config.token_px}*columns")
    cells = (f"{TOKEN_PATCH}*rows", f"{TOKEN_PATCH}*columns")
    condition = (
        normal("render_latent", "batch", config.vae.latent_channels, LATENT_FRAMES, *cells),
        unit("validity", "batch", 1, FRAMES, *pixels),
    )
    width = config.dit.width
    tokens = ("batch", LATENT_FRAMES, "rows", "columns", width)
    pooled, render = output("pooled_text", "batch", width), output("render_tokens", *tokens)
    return GraphSource(
        name="dit_conditions",
        part="dit",
        module=TensorFunction(network, embed),
        inputs=(
            normal("camera", "batch", 6, FRAMES, *pixels),
            normal("text", "batch", "tokens", config.text.width),
            mask("text_mask", "batch", "tokens"),
            *(condition if rendered else ()),
        ),
        outputs=(
            output("camera_tokens", *tokens),
            output("text_states", "batch", "tokens", width),
            *((pooled,) if config.dit.pooled_text else ()),
            *((render,) if rendered else ()),
        ),
    )


def _velocity(network: nn.Module, config: ModelConfig) -> GraphSource:
    width, dit = config.dit.width, config.dit
    cells = (f"{TOKEN_PATCH}*rows", f"{TOKEN_PATCH}*columns")
    latent = ("batch", config.vae.latent_channels, "frames", *cells)
    tokens = ("batch", "frames", "rows", "columns", width)
    optional = (normal("pooled_text", "batch", width),) if dit.pooled_text else ()
    if dit.render_condition:
        optional += (normal("render_latent", *latent), normal("render_tokens", *tokens))
    names = [source.spec.name for source in optional]

    def velocity(network: nn.Module, *inputs: Tensor) -> tuple[Tensor]:
        state, level, camera, text, text_mask = inputs[:5]
        given = dict(zip(names, inputs[5:], strict=True))
        conditions = DitConditions(camera=camera, text=text, text_mask=text_mask, **given)
        return (network.velocity(state, level, conditions),)

    return GraphSource(
        name="dit_velocity",
        part="dit",
        module=TensorFunction(network, velocity),
        inputs=(
            normal("latent", *latent),
            unit("level", "batch", "frames"),
            normal("camera_tokens", *tokens),
            normal("text_states", "batch", "tokens", width),
            mask("text_mask", "batch", "tokens"),
            *optional,
        ),
        outputs=(output("velocity", *latent),),
    )
