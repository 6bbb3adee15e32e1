"""LDRM and deformation on the latents of a public video model, and cameras for that model.

Its own weights stay as they are: the video stage trains the camera adapter, the layer of the render
condition and low-rank corrections.

Stages, losses and steps are those of the ``paper`` recipe; there is no stage for the autoencoder.
The model is that of an imported folder, so the recipe is made for it: ``train --config backbone
--from-model FOLDER``.
"""

from dataclasses import replace

from diff4splat.configs.paper import paper_recipe
from diff4splat.configs.test import test_recipe
from diff4splat.models.config.model import ModelConfig
from diff4splat.training.recipe.recipe import Recipe

BACKBONE = "backbone"
"""Name of the recipe."""
KINDS = ("static", "dynamic", "video_diffusion")
"""Stages that train what the public model lacks."""
TOY_SIDE_PX = 128
"""Models for smaller images are those of tests."""


def backbone_recipe(model: ModelConfig) -> Recipe:
    """The recipe for an imported model, at its own number of frames and size of images."""
    toy = max(model.size_px) < TOY_SIDE_PX
    base = test_recipe() if toy else paper_recipe()
    stages = [stage for stage in base.stages if stage.kind in KINDS]
    sizes = dict.fromkeys((stage.name for stage in stages), model.size_px)
    if not toy:
        sizes["static-low"] = _half(model)
    return replace(
        base,
        name=BACKBONE,
        model=model,
        stages=tuple(
            replace(
                stage,
                trained=tuple(part for part in stage.trained if part != "text_encoder"),
                tuning="lora" if stage.kind == "video_diffusion" else "full",
                data=replace(stage.data, size_px=sizes[stage.name], frames=model.frames),
            )
            for stage in stages
        ),
    )


def _half(model: ModelConfig) -> tuple[int, int]:
    """About half the size, in whole tokens."""
    height, width = (
        model.token_px * max(side // (2 * model.token_px), 1) for side in model.size_px
    )
    return height, width
