"""The order of stages that every recipe keeps, and what differs between them.

    vae → static-low → static-high → dynamic → video_diffusion → joint

The middle three are the paper's (40,000, 40,000 and 20,000 steps). The autoencoder comes first and
the video model after them because no public weights are assumed; both are trained by the paper in
some other way that it does not describe.
"""

from dataclasses import replace

from diff4splat.training.recipe.data import DataSettings, SourceSettings
from diff4splat.training.recipe.losses import (
    DynamicLosses,
    FlowLosses,
    JointLosses,
    MotionLosses,
    ReconstructionLosses,
)
from diff4splat.training.recipe.stage import Gate, StageRecipe

STATIC_ONLY = (SourceSettings(still_share=1.0),)
"""Clips in which only the camera moves."""
MIXED = (SourceSettings(still_share=0.25),)
"""Static clips keep their share in the dynamic stage: 20 to 30 % (ours, after MoVieS)."""


def static_data(data: DataSettings) -> DataSettings:
    """The same samples from clips in which nothing moves, without tracks."""
    return replace(data, sources=STATIC_ONLY, tracks=0)


def dynamic_data(data: DataSettings) -> DataSettings:
    """The same samples from moving and static clips."""
    return replace(data, sources=MIXED)


def static_stage(vae: StageRecipe, data: DataSettings) -> StageRecipe:
    """LDRM alone, on static clips."""
    return replace(
        vae,
        name="static-low",
        kind="static",
        trained=("ldrm",),
        losses=ReconstructionLosses(),
        data=static_data(data),
    )


def motion_stage(static: StageRecipe, tracks: int) -> StageRecipe:
    """Deformation alone, from tracked points of moving and static clips."""
    return replace(
        static,
        name="motion",
        kind="motion",
        trained=("deformation",),
        losses=MotionLosses(),
        data=dynamic_data(replace(static.data, tracks=tracks)),
    )


def dynamic_stage(static: StageRecipe, tracks: int) -> StageRecipe:
    """LDRM and deformation, on moving and static clips with tracked points."""
    return replace(
        static,
        name="dynamic",
        kind="dynamic",
        trained=("ldrm", "deformation"),
        losses=DynamicLosses(reconstruction=static.losses),
        data=dynamic_data(replace(static.data, tracks=tracks)),
    )


def video_diffusion_stage(dynamic: StageRecipe) -> StageRecipe:
    """Video diffusion; it uses the input view alone, so samples hold nothing else."""
    return replace(
        dynamic,
        name="video_diffusion",
        kind="video_diffusion",
        trained=("text_encoder", "dit"),
        losses=FlowLosses(),
        data=replace(dynamic.data, views=1, target_frames=1, tracks=0),
        gates=(),
    )


def joint_stage(dynamic: StageRecipe) -> StageRecipe:
    """All networks but the autoencoder."""
    return replace(
        dynamic,
        name="joint",
        kind="joint",
        trained=("text_encoder", "dit", "ldrm", "deformation"),
        losses=JointLosses(
            reconstruction=dynamic.losses.reconstruction, motion=dynamic.losses.motion
        ),
        gates=(),
    )


def reconstruction_gates(psnr: float, depth_correlation: float) -> tuple[Gate, ...]:
    """What a static stage must reach."""
    return (
        Gate(measure="psnr", bound=psnr),
        Gate(measure="depth_correlation", bound=depth_correlation),
    )


def later(
    stage: StageRecipe, name: str, size_px: tuple[int, int], rate_factor: float
) -> StageRecipe:
    """The same stage at another size with another learning rate."""
    optimizer = replace(stage.optimizer, learning_rate=stage.optimizer.learning_rate * rate_factor)
    data = replace(stage.data, size_px=size_px)
    return replace(stage, name=name, data=data, optimizer=optimizer)
