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
CAPTION_KINDS = ("video_diffusion", "video_distillation", "motion_diffusion", "joint")
"""Kinds that read captions, which name left and right."""
LATENT_KINDS = ("video_diffusion", "video_distillation")
"""Kinds that can learn from encoded clips."""
