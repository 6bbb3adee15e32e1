"""The kinds of stages, each with one module of its name in ``training.stages``."""

from typing import Literal, get_args

StageKind = Literal[
    "vae",
    "posed_video_pretrain",
    "static",
    "motion",
    "dynamic",
    "monocular_depth",
    "motion_diffusion",
    "object_mask",
    "image_classifier",
    "object_shadow",
    "video_diffusion",
    "video_distillation",
    "joint",
]
KINDS: tuple[StageKind, ...] = get_args(StageKind)
RECONSTRUCTION_KINDS = (
    "posed_video_pretrain",
    "static",
    "motion",
    "dynamic",
    "monocular_depth",
    "joint",
)
"""Kinds whose samples have depth at the key frames that carry Gaussians."""
CAPTION_KINDS = (
    "video_diffusion",
    "video_distillation",
    "motion_diffusion",
    "object_mask",
    "image_classifier",
    "joint",
)
"""Kinds that read captions, which name left and right."""
REQUEST_KINDS = ("object_mask", "image_classifier")
"""Kinds whose samples are images with many prompts."""
SHADOW_KINDS = ("object_shadow",)
"""Kinds whose samples are images with and without an object."""
IMAGE_KINDS = ("motion_diffusion", *REQUEST_KINDS, *SHADOW_KINDS)
"""Kinds that look at single images: clips need no frames but key frames."""
LATENT_KINDS = ("video_diffusion", "video_distillation")
"""Kinds that can learn from encoded clips."""
