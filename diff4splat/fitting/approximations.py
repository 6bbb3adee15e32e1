"""What a fit approximates, and what it leaves to the user."""

from dataclasses import replace

from diff4splat.approximations.declaration import Approximation, UserChoices, set_field
from diff4splat.fitting.settings import (
    CameraSettings,
    DensitySettings,
    FitSettings,
    StaticDetectionSettings,
)

OPTIMISER = (
    "how the optimiser gets there: decides whether a fit converges, not what it approximates"
)
LOSS = "what the fit is asked to match"
LIMIT = "how much is kept or how often something is written; changes no scene"

APPROXIMATIONS = (
    Approximation(
        name="fit-hexplane",
        subject="fit",
        summary="a coarser motion field: cells of a HexPlane in space",
        fields=("FitSettings.planes",),
        values=(4, 8, 16, 32),
        default=32,
        reference=None,
        apply=lambda settings, value: (
            settings
            if value is None
            else replace(settings, planes=replace(settings.planes, space=(value,) * 3))
        ),
        label_meaning="cells along each axis",
    ),
    Approximation(
        name="fit-budget",
        subject="fit",
        summary="fewer Gaussians in a fit",
        fields=("DensitySettings.budget", "FitSettings.density", "FitSettings.points"),
        values=(500, 1000, 2000, 4000),
        default=4000,
        reference=None,
        apply=lambda settings, value: (
            settings
            if value is None
            else replace(
                settings,
                points=value,
                density=replace(settings.density, budget=value),
            )
        ),
        label_meaning="most Gaussians",
    ),
    Approximation(
        name="fit-steps",
        subject="fit",
        summary="a fit of fewer steps",
        fields=("FitSettings.fine_steps", "FitSettings.coarse_steps"),
        values=(25, 50, 100, 200),
        default=200,
        reference=None,
        apply=lambda settings, value: (
            settings
            if value is None
            else replace(settings, coarse_steps=value // 2, fine_steps=value)
        ),
        label_meaning="steps of the fine stage",
    ),
    Approximation(
        name="fit-static",
        subject="fit",
        summary="taking what hardly moves out of the motion",
        fields=("StaticDetectionSettings.offset_px", "FitSettings.stillness"),
        values=(0.0, 0.1, 0.5, 2.0),
        default=0.1,
        reference=None,
        apply=lambda settings, value: (
            settings if value is None else set_field("stillness.offset_px")(settings, value)
        ),
        label_meaning="pixels that a static Gaussian may move",
    ),
)

USER_CHOICES: UserChoices = {
    "FitSettings.motion": "the kind of motion: another model, not a coarser one",
    "FitSettings.seed": "which of equally good fits",
    "FitSettings.dtype": "float64 is the reference; report stability measures what float32 changes",
    "FitSettings.views_per_step": OPTIMISER,
    "FitSettings.harmonics": "how colour depends on the view: asked for; `sh-degree` measures it",
    "FitSettings.harmonics_every": OPTIMISER,
    "FitSettings.use_depth": LOSS,
    "FitSettings.rates": OPTIMISER,
    "FitSettings.weights": LOSS,
    "FitSettings.camera": "the settings of learned cameras, each of its own",
    "FitSettings.decoder": "the model of the motion: what a scene file holds",
    "FitSettings.time_slices": OPTIMISER,
    "FitSettings.picture_memory_mb": LIMIT,
    "FitSettings.checkpoint_every": LIMIT,
    "FitSettings.judge_every": LIMIT,
    "DensitySettings.every": OPTIMISER,
    "DensitySettings.growth": OPTIMISER,
    "DensitySettings.until": OPTIMISER,
    "DensitySettings.min_opacity": "as the pruning of a scene, which `pruning` measures",
    "DensitySettings.min_gradient": OPTIMISER,
    "StaticDetectionSettings.min_score": OPTIMISER,
    "StaticDetectionSettings.change": "how much colour a static Gaussian may change: a decision",
    "StaticDetectionSettings.checks": OPTIMISER,
    "CameraSettings.learn": "what of the cameras is unknown: asked for",
    "CameraSettings.start": OPTIMISER,
    "CameraSettings.samples": "noise of one step; `exposure-samples` measures such samples",
    "CameraSettings.shown_samples": "as the samples of a photograph, which are measured",
    "CameraSettings.tolerance_px": "as PhotoSettings.tolerance_px, which is measured",
    "CameraSettings.most_intervals": "a limit; the error that remains is reported",
}
"""Fields that change results, and approximate nothing."""

SETTINGS_CLASSES = (FitSettings, DensitySettings, StaticDetectionSettings, CameraSettings)
"""Whose fields are all named above."""
