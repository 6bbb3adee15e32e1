"""The networks of a model by name; none of their code is imported here."""

from dataclasses import dataclass, fields
from typing import Any

import torch

from diff4splat.models.config.model import ModelConfig
from diff4splat.models.protocols import (
    DeformationMaps,
    DepthPrior,
    GaussianMaps,
    ImageClasses,
    ImageCompletion,
    ImageStates,
    MotionPrior,
    ObjectMask,
    PromptEncoder,
    ShadowOfObject,
    VideoCodec,
    VideoVelocity,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Networks:
    """The networks of one model; None for parts that are not loaded, or that the model lacks."""

    vae: VideoCodec | None = None
    text_encoder: PromptEncoder | None = None
    dit: VideoVelocity | None = None
    ldrm: GaussianMaps | None = None
    deformation: DeformationMaps | None = None
    monocular_depth: DepthPrior | None = None
    motion_unet: MotionPrior | None = None
    image_encoder: ImageStates | None = None
    object_mask: ObjectMask | None = None
    image_classifier: ImageClasses | None = None
    image_inpainting: ImageCompletion | None = None
    object_shadow: ShadowOfObject | None = None

    def parts(self) -> list[tuple[str, Any]]:
        """(name, network) of the parts that exist."""
        named = [(field.name, getattr(self, field.name)) for field in fields(self)]
        return [(name, part) for name, part in named if part is not None]

    def to(self, target: torch.device | torch.dtype) -> "Networks":
        """Move or cast every part, in place."""
        for _, part in self.parts():
            part.to(target)
        return self


PARTS = tuple(field.name for field in fields(Networks))
"""Names of the networks, in the order of their random streams."""


def reconstruction_parts(config: ModelConfig) -> tuple[str, ...]:
    """The parts that turn a true video into a scene."""
    return ("vae", "ldrm", "deformation", *ldrm_start_parts(config))


def ldrm_start_parts(config: ModelConfig) -> tuple[str, ...]:
    """The depth prior, where LDRM corrects its depth; else nothing."""
    return ("monocular_depth",) if config.refinement.depth_prior else ()


def model_parts(config: ModelConfig) -> tuple[str, ...]:
    """The parts that a model of this configuration has."""
    absent = set()
    if not config.image_encoder.used:
        absent.add("image_encoder")
    if not config.monocular_depth.used:
        absent.add("monocular_depth")
    if not config.motion_unet.used:
        absent.add("motion_unet")
    if not config.object_mask.used:
        absent.add("object_mask")
    if not config.object_mask.image_classifier:
        absent.add("image_classifier")
    if not config.image_inpainting.used:
        absent.add("image_inpainting")
    if not config.object_shadow.used:
        absent.add("object_shadow")
    return tuple(part for part in PARTS if part not in absent)
