"""Builds every network of a model.

Every part starts from a separate random stream. Its weights depend on the configuration, the seed
and the part alone: not on the caller's random state, nor on which other parts are built.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cache
from types import MappingProxyType
from typing import Any

import torch
from torch import nn
from torch.overrides import TorchFunctionMode

from diff4splat.models.cogvideox.t5 import T5Encoder
from diff4splat.models.cogvideox.transformer import JointVideoDiT
from diff4splat.models.cogvideox.vae import CogVideoXVae
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.deformation.network import DeformationNetwork
from diff4splat.models.deformation.refined_network import RefinedDeformation
from diff4splat.models.image_classifier.network import ImageClassifier
from diff4splat.models.image_encoder.clip import ClipImageEncoder
from diff4splat.models.image_inpainting.network import ImageInpainting
from diff4splat.models.ldrm.ldrm import Ldrm
from diff4splat.models.monocular_depth.backbone_network import BackboneDepthNet
from diff4splat.models.monocular_depth.network import MonocularDepthNet
from diff4splat.models.motion_unet.unet import MotionUNet
from diff4splat.models.networks import PARTS, Networks, model_parts
from diff4splat.models.object_mask.backbone_network import BackboneObjectMaskNet
from diff4splat.models.object_mask.mask_heads import HeadShape
from diff4splat.models.object_mask.network import ObjectMaskNet
from diff4splat.models.object_shadow.network import ObjectShadowNet
from diff4splat.models.placement.initial_weights import (
    InitialWeights,
    RecordedCalls,
    initial_weights,
)
from diff4splat.models.text_encoder.encoder import TextEncoder
from diff4splat.models.video_dit.dit import VideoDiT
from diff4splat.models.video_vae.vae import VideoVae
from diff4splat.models.wan.experts import NoiseExperts
from diff4splat.models.wan.umt5 import Umt5Encoder
from diff4splat.models.wan.vae import WanVae

STREAMS = 7
"""Random streams per seed: a part that was added later changes no other's weights."""


def create_networks(
    config: ModelConfig,
    device: torch.device | str | None = None,
    *,
    parts: Collection[str] | None = None,
    seed: int = 0,
) -> Networks:
    """Networks with random weights that are the same for the same arguments.

    Only ``parts`` are built, or all that the model has. On the meta device nothing is allocated;
    elsewhere weights are drawn on the CPU and then moved.
    """
    target = torch.device("cpu" if device is None else device)
    builders = _builders(config)
    wanted = [part for part in model_parts(config) if parts is None or part in parts]
    return Networks(**{part: _build(part, builders[part], target, seed) for part in wanted})


def plan_networks(
    config: ModelConfig, parts: Collection[str], *, seed: int = 0
) -> tuple[Networks, Mapping[str, InitialWeights]]:
    """Networks on the meta device, and how to draw the weights of ``create_networks`` singly."""
    builders, made, weights = _builders(config), {}, {}
    for part in (part for part in model_parts(config) if part in parts):
        with torch.device("meta"), RecordedCalls() as recorded:
            made[part] = builders[part]()
        weights[part] = initial_weights(made[part], recorded.calls, _stream(part, seed))
    return Networks(**made), MappingProxyType(weights)


def _builders(config: ModelConfig) -> Mapping[str, Callable[[], nn.Module]]:
    motion = config.motion_unet
    return {
        "vae": lambda: _vae(config),
        "text_encoder": lambda: _text_encoder(config),
        "dit": lambda: _dit(config),
        "ldrm": lambda: Ldrm(config),
        "deformation": lambda: _deformation(config),
        "monocular_depth": lambda: _monocular_depth(config),
        "motion_unet": lambda: MotionUNet(
            motion.width,
            motion.heads,
            config.text,
            mask_refiner_width=motion.mask_refiner_width,
            object_mask=motion.object_mask,
        ),
        "object_mask": lambda: _object_mask(config),
        "image_classifier": ImageClassifier,
        "image_inpainting": lambda: ImageInpainting(config.image_inpainting.widths),
        "object_shadow": lambda: ObjectShadowNet(config.object_shadow.width),
        "image_encoder": lambda: ClipImageEncoder(config.image_encoder),
    }


def _vae(config: ModelConfig) -> nn.Module:
    """Ours, or one that holds public weights."""
    if config.vae.layout == "plain":
        return VideoVae(config.vae)
    return (CogVideoXVae if config.vae.layout == "cogvideox" else WanVae)(config.vae)


def _dit(config: ModelConfig) -> nn.Module:
    """Text attended to across or in one sequence, and one network or one per range of noise."""
    if config.joint.used:
        return JointVideoDiT(config)
    return (NoiseExperts if config.dit.expert_boundary else VideoDiT)(config)


def _monocular_depth(config: ModelConfig) -> nn.Module:
    """On features of the image backbone, or on its own."""
    depth = config.monocular_depth
    if not depth.image_backbone:
        return MonocularDepthNet(depth.channels)
    return BackboneDepthNet(depth.channels, size=depth.backbone_size, uncertainty=depth.uncertainty)


def _object_mask(config: ModelConfig) -> nn.Module:
    mask = config.object_mask
    shape = HeadShape(
        width=mask.width,
        text_width=config.text.width,
        instance_channels=mask.instance_channels,
    )
    if not mask.image_backbone:
        return ObjectMaskNet(shape)
    return BackboneObjectMaskNet(shape, mask.backbone_size)


def _text_encoder(config: ModelConfig) -> nn.Module:
    if config.text.encoder == "t5":
        return T5Encoder(config.text, config.dit.padded_text_tokens)
    return (TextEncoder if config.text.encoder == "bytes" else Umt5Encoder)(config.text)


def _deformation(config: ModelConfig) -> DeformationNetwork | RefinedDeformation:
    """From tokens (paper), or from the features of the refinement decoder where there is one."""
    return (RefinedDeformation if config.refinement.used else DeformationNetwork)(config)


def _build(part: str, make: Callable[[], nn.Module], target: torch.device, seed: int) -> nn.Module:
    if target.type == "meta":
        with target, _NoInitialValues():
            return make()
    with torch.random.fork_rng(devices=[]), torch.device("cpu"):
        torch.manual_seed(_stream(part, seed))
        return make().to(target)


def _stream(part: str, seed: int) -> int:
    """Seed of a part's own random stream."""
    return seed * STREAMS + PARTS.index(part)


class _NoInitialValues(TorchFunctionMode):
    """Skips ``torch.nn.init``: meta tensors have no values, and drawing some loads a compiler."""

    def __torch_function__(
        self,
        func: Callable[..., Any],
        types: Sequence[type],
        args: tuple[Any, ...] = (),
        kwargs: dict[str, Any] | None = None,
    ) -> Any:
        del types
        kwargs = kwargs or {}
        if getattr(func, "__module__", None) == "torch.nn.init":
            return args[0] if args else kwargs["tensor"]
        return func(*args, **kwargs)


@cache
def parameter_counts(config: ModelConfig) -> Mapping[str, int]:
    """Trainable weights per part, counted without allocating anything."""
    parts = create_networks(config, "meta").parts()
    return MappingProxyType(
        {name: sum(map(torch.numel, part.parameters())) for name, part in parts}
    )
