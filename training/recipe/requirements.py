"""What a stage requires of the model that it trains, and of its data.

All that recipes ask of a model configuration is here.
"""

from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.models.config.priors import BACKBONE_MULTIPLE_PX
from diff4splat.training.recipe.checks import require
from diff4splat.training.recipe.kinds import (
    CAPTION_KINDS,
    IMAGE_KINDS,
    LATENT_KINDS,
    RECONSTRUCTION_KINDS,
)
from diff4splat.training.recipe.stage import StageRecipe


def require_fit(stage: StageRecipe, model: ModelConfig) -> None:
    """Refuse a stage that the model or its own data do not allow.

    Raises:
        ConfigError: with the key to correct.
    """
    _require_networks(stage, model)
    _require_data(stage, model)


def _require_networks(stage: StageRecipe, model: ModelConfig) -> None:
    what, refines = f"stage {stage.name}", model.refinement.used
    fits = stage.kind != "posed_video_pretrain" or (refines and stage.use_ground_truth_frames)
    expected = "a refinement decoder (model.refinement) and use_ground_truth_frames for its kind"
    require(fits, what, expected, "one or neither")
    fits = stage.kind != "motion_diffusion" or model.motion_unet.used
    require(fits, f"{what}: model.motion_unet.width", "a motion network for its kind", 0)
    fits = stage.kind != "object_mask" or model.object_mask.used
    require(fits, f"{what}: model.object_mask.width", "an object mask for its kind", 0)
    fits = stage.kind != "image_classifier" or model.object_mask.image_classifier
    where = f"{what}: model.object_mask.image_classifier"
    require(fits, where, "true for its kind", model.object_mask.image_classifier)
    fits = stage.kind != "object_shadow" or model.object_shadow.used
    require(fits, f"{what}: model.object_shadow.width", "an object shadow for its kind", 0)
    needs = stage.kind == "object_mask" and stage.losses.instances
    fits = not needs or model.object_mask.instance_channels
    require(fits, f"{what}: model.object_mask.instance_channels", "2 or more for its loss", 0)
    fits = stage.kind != "monocular_depth" or model.monocular_depth.used
    require(fits, f"{what}: model.monocular_depth.channels", "a depth network for its kind", 0)
    needs = stage.kind == "monocular_depth" and stage.losses.uncertainty
    fits = not needs or model.monocular_depth.uncertainty
    require(fits, f"{what}: model.monocular_depth.uncertainty", "true for its loss", "false")


def _require_data(stage: StageRecipe, model: ModelConfig) -> None:
    what, data = f"stage {stage.name}: data", stage.data
    encoded = any(source.kind == "latents" for source in data.sources)
    fits = not encoded or stage.kind in LATENT_KINDS
    require(
        fits, f"{what}.sources", f"latents for {' or '.join(LATENT_KINDS)} stages alone", stage.kind
    )
    fits = not (data.augment and stage.kind in CAPTION_KINDS)
    require(fits, f"{what}.augment", "false where captions are read", "true")
    fits = not data.keyframes_only or stage.kind in IMAGE_KINDS
    expected = f"false but for {' and '.join(IMAGE_KINDS)} stages"
    require(fits, f"{what}.keyframes_only", expected, "true")
    if stage.kind == "monocular_depth":
        fits = not stage.losses.window_consistency or data.photographs
        require(fits, f"{what}.photographs", "a folder for losses.window_consistency", "none")
        fits = not data.cutouts or data.view_sides_px
        require(fits, f"{what}.view_sides_px", "sides of views that show data.cutouts", "none")
    if stage.kind == "monocular_depth" and model.monocular_depth.image_backbone:
        sides = data.view_sides_px or data.size_px
        fits = all(side % BACKBONE_MULTIPLE_PX == 0 for side in sides)
        expected = f"multiples of {BACKBONE_MULTIPLE_PX} on the image backbone"
        require(fits, f"{what}.view_sides_px or size_px", expected, sides)
    keyframed = model.refinement.used and stage.kind in RECONSTRUCTION_KINDS
    fits, stride = not keyframed or data.keyframe_stride == TIME_STRIDE, data.keyframe_stride
    expected = f"{TIME_STRIDE} with a refinement decoder"
    require(fits, f"{what}.keyframe_stride", expected, stride)
