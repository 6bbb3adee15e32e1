"""Weight files of version 1, written before the priors were parts of their own.

Version 1 kept the depth prior inside ``ldrm`` and the motion prior inside ``dit``, under other
names, and its video model also predicted motion channels, which nothing uses any more. Values are
kept; channels of the video model that predicted motion are dropped.
"""

import re
from collections.abc import Mapping

import torch
from torch import Tensor

from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.networks import TIME_STRIDE, TOKEN_PATCH

SOURCES: Mapping[str, tuple[str, str]] = {
    "monocular_depth": ("ldrm", "detail.picture_depth."),
    "motion_unet": ("dit", "motion_branch."),
}
"""Part of version 2 → file of version 1, and the prefix of its keys there."""
RENAMED: Mapping[str, tuple[tuple[str, str], ...]] = {
    "vae": ((r"^code\.", "pca_shortcut."),),
    "text_encoder": (),
    "dit": ((r"^draft_embedding\.", "condition_embedding.latent."),),
    "ldrm": (
        (r"^detail\.decoder\.enter\.", "detail.decoder.input_conv."),
        (r"^detail\.decoder\.shrink_", "detail.decoder.down_"),
        (r"^detail\.decoder\.grow_", "detail.decoder.up_"),
        (r"^detail\.decoder\.mixed\.", "detail.decoder.mid."),
        (r"^detail\.pixels\.looks\.", "detail.pixels.appearance."),
        (r"^detail\.pixels\.", "detail.pixel_head."),
        (r"^detail\.surroundings\.enter\.", "detail.surroundings.input_conv."),
        (r"^detail\.surroundings\.near\.", "detail.surroundings.local."),
        (r"^detail\.surroundings\.shrink\.", "detail.surroundings.downsample."),
        (r"^detail\.surroundings\.far\.", "detail.surroundings.context."),
        (r"^detail\.surroundings\.", "detail.border_head."),
        (r"^detail\.", "refinement."),
    ),
    "deformation": ((r"^enter\.", "input_conv."), (r"^enter_now\.", "input_motion.")),
    "monocular_depth": (
        (r"^enter\.", "input_conv."),
        (r"^down\.", "down_blocks."),
        (r"^shrink\.", "downsample."),
        (r"^grow\.", "upsample."),
        (r"^mixed\.", "mid."),
        (r"^up\.", "up_blocks."),
    ),
    "motion_unet": (
        (r"^reader\.", "text_adapter."),
        (r"^untold$", "null_text_embedding"),
        (r"^enter_picture\.", "input_image."),
        (r"^enter_motion\.", "input_motion."),
        (r"^(outline\.)?shrink", r"\1down"),
        (r"^(outline\.)?grow", r"\1up"),
        (r"^mixed\.", "mid."),
        (r"^head\.", "motion_head."),
        (r"^moves\.", "mask_head."),
        (r"^(fine|middle|coarse)\.read\.", r"\1.text_attention."),
        (r"^outline\.enter\.", "outline.input_image."),
        (r"^outline\.told\.", "outline.input_features."),
        (r"^outline\.", "mask_refiner."),
    ),
}
"""Part → (pattern, replacement) pairs, applied in order."""


def legacy_file(part: str) -> str:
    """The part of version 1 whose file holds a part of version 2."""
    return SOURCES[part][0] if part in SOURCES else part


def upgrade_tensors(
    part: str, tensors: Mapping[str, Tensor], config: ModelConfig
) -> dict[str, Tensor]:
    """The weights of one part, from the tensors of ``legacy_file(part)``."""
    upgraded = {_renamed(part, key): value for key, value in _part_tensors(part, tensors).items()}
    return _upgrade_dit(upgraded, config) if part == "dit" else upgraded


def _part_tensors(part: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The tensors that belong to the part, without its prefix."""
    if part in SOURCES:
        prefix = SOURCES[part][1]
        inside = {key: value for key, value in tensors.items() if key.startswith(prefix)}
        return {key.removeprefix(prefix): value for key, value in inside.items()}
    others = tuple(prefix for file, prefix in SOURCES.values() if file == part)
    return {key: value for key, value in tensors.items() if not key.startswith(others)}


def _renamed(part: str, key: str) -> str:
    for pattern, replacement in RENAMED[part]:
        key = re.sub(pattern, replacement, key)
    return key


def _upgrade_dit(tensors: dict[str, Tensor], config: ModelConfig) -> dict[str, Tensor]:
    """Latent channels alone, and a validity mask that changes nothing yet."""
    channels, cells = config.vae.latent_channels, TOKEN_PATCH**2
    for key in ("patch_embedding.weight", "condition_embedding.latent.weight"):
        if key in tensors:
            tensors[key] = tensors[key][:, : channels * cells]
    for key in ("head.weight", "head.bias"):
        if key in tensors and len(tensors[key]) % cells == 0:
            tensors[key] = tensors[key].unflatten(0, (cells, -1))[:, :channels].flatten(0, 1)
    if "condition_embedding.latent.weight" in tensors:
        validity = torch.zeros(config.dit.width, TIME_STRIDE * cells)
        tensors["condition_embedding.validity.weight"] = validity
    return tensors
