"""Weights of the loss terms, one class per kind of stage; 0 leaves a term's computation out.

"paper" is Diff4Splat (arXiv 2511.00503) §3 and appendix; "MoVieS" is its sibling's public code;
"ours" is a choice made here.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from diff4splat.training.recipe.checks import require
from diff4splat.training.recipe.kinds import StageKind


@dataclass(frozen=True, slots=True, kw_only=True)
class AutoencoderLosses:
    """Of the video autoencoder."""

    photometric: float = 1.0
    """Charbonnier error of the decoded video."""
    perceptual: float = 0.5
    """LPIPS of the decoded frames."""
    kl: float = 1e-4
    """KL divergence of the posterior from N(0, 1) (ours; latent diffusion uses 1e-6 on sums)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReconstructionLosses:
    """Of rendered images and depth."""

    photometric: float = 1.0
    """λ_photo (paper)."""
    perceptual: float = 0.5
    """λ_p, LPIPS beside the squared error, inside the photometric loss (paper)."""
    depth: float = 0.5
    """λ_geo, 1 − Pearson on rendered depth (paper)."""
    depth_log: float = 0.0
    """|log depth − log truth| of the Gaussians at their input pixels (after MoVieS)."""
    smoothness: float = 0.1
    """Total variation of rendered depth, inside L_geo; its weight is not in the paper (ours)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionLosses:
    """Of the displacement of tracked points."""

    weight: float = 2.0
    """λ_motion (paper)."""
    distance: float = 2.0
    """λ_m: distance between predicted and true displacement (paper)."""
    displacement_l1: float = 1.0
    """L1 norm of the predicted displacement (paper; pulls every point towards zero motion)."""
    huber_delta: float = 0.0
    """Distance, in model units, below which the loss is quadratic (ours); 0 is the paper."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DynamicLosses:
    """Of rendered images at any time, and of displacements."""

    reconstruction: ReconstructionLosses = field(default_factory=ReconstructionLosses)
    motion: MotionLosses = field(default_factory=MotionLosses)


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthLosses:
    """Of the depth of single images."""

    depth_log: float = 1.0
    """|log depth − log truth|."""
    depth_gradient: float = 0.5
    """|∇ (log depth − log truth)| at several scales (after MiDaS)."""
    inverse_depth: float = 1.0
    """|1 / depth − 1 / truth| in units of one over the plane's depth (ours): how far a pixel is
    from its true position after the camera translates."""
    sky_margin: float = 0.2
    """How much nearer than the sky the depth is at pixels without truth (ours): for data in which
    only the sky has no depth."""
    window_consistency: float = 0.0
    """A window of a photograph gets the depth that the whole gives it (ours); needs
    ``data.photographs``."""
    uncertainty: float = 0.0
    """Likelihood of the error of log depth (Kendall and Gal 2017); the depth learns nothing from
    it. Needs ``model.monocular_depth.uncertainty``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlowLosses:
    """Of the velocity of the video diffusion model."""

    flow: float = 1.0
    """Flow matching (paper)."""
    min_level_weighting: float = 0.0
    """Velocity errors at levels below count as if they were made at this level (ours); 0 is the
    paper. A network that predicts clean latents would otherwise learn small levels alone."""
    hidden_weight: float = 1.0
    """Weight of a latent cell that the first frame hides, where a shown one has 1 (ours)."""
    channel_power_exponent: float = 0.0
    """Weight of a latent channel: its share of image power to this exponent (ours); 0 is the
    paper."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DistillationLosses:
    """Of the velocity of a video model of few steps, and how its teacher integrates."""

    flow: FlowLosses = field(default_factory=FlowLosses)
    segments: int = 4
    """Steps of the student: Euler with even levels."""
    teacher_steps: int = 6
    """Of the teacher in each of them, so that four take 24 (ours)."""
    guidance: float = 1.0
    """Of the teacher; the student has it built in and runs without. 1 is none."""
    guidance_low: float = 0.2
    """Level below which the teacher runs without."""

    def __post_init__(self) -> None:
        counts = {"segments": self.segments, "teacher_steps": self.teacher_steps}
        for name, count in counts.items():
            require(count >= 1, f"losses: {name}", "at least 1", count)
        require(math.isfinite(self.guidance), "losses: guidance", "a number", self.guidance)
        low = self.guidance_low
        require(0 <= low <= 1, "losses: guidance_low", "0 to 1", low)


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionDiffusionLosses:
    """Of the velocity and the mask of the motion network."""

    flow: float = 1.0
    """Flow matching."""
    min_level_weighting: float = 0.0
    """As in ``FlowLosses``."""
    motion_mask: float = 0.0
    """Cross-entropy of the motion mask (ours): most pixels are static, so a squared error alone
    learns the moving ones slowly."""
    paraphrase: float = 0.0
    """Difference of what the network reads in a plain and a free sentence of one meaning (ours)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectMaskLosses:
    """Of the pixels that a prompt asks to move."""

    cross_entropy: float = 10.0
    """Mean over pixels: most are not asked for, whatever the prompt."""
    dice: float = 1.0
    """1 − overlap (V-Net, arXiv 1606.04797): small objects count as large ones."""
    names: float = 0.3
    """Cross-entropy of noun and colour of every pixel, without a prompt."""
    instances: float = 0.0
    """Cross-entropy and overlap of what belongs to one object, whatever its name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageClassifierLosses:
    """Of the pixels that a prompt asks to move, corrected by the image classifier."""

    cross_entropy: float = 3.0
    """Mean over pixels."""
    dice: float = 1.0
    """1 − overlap, as in ``ObjectMaskLosses``."""
    absent: float = 0.5
    """Cross-entropy of the most probable pixels where nothing is asked for: the highest of all
    decides whether anything moves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectShadowLosses:
    """Of the shadow of one object."""

    darkening: float = 2.0
    """Huber's error of the logarithm."""
    lit_colors: float = 20.0
    """Squared error of the colours without the shadow."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointLosses:
    """Of the video diffusion model and the reconstruction together."""

    flow: FlowLosses = field(default_factory=FlowLosses)
    reconstruction: ReconstructionLosses = field(default_factory=ReconstructionLosses)
    motion: MotionLosses = field(default_factory=MotionLosses)


Losses = (
    AutoencoderLosses
    | ReconstructionLosses
    | MotionLosses
    | DynamicLosses
    | DepthLosses
    | FlowLosses
    | DistillationLosses
    | MotionDiffusionLosses
    | ObjectMaskLosses
    | ImageClassifierLosses
    | ObjectShadowLosses
    | JointLosses
)
LOSSES: Mapping[StageKind, type[Losses]] = MappingProxyType(
    {
        "vae": AutoencoderLosses,
        "posed_video_pretrain": ReconstructionLosses,
        "static": ReconstructionLosses,
        "motion": MotionLosses,
        "dynamic": DynamicLosses,
        "monocular_depth": DepthLosses,
        "motion_diffusion": MotionDiffusionLosses,
        "object_mask": ObjectMaskLosses,
        "image_classifier": ImageClassifierLosses,
        "object_shadow": ObjectShadowLosses,
        "video_diffusion": FlowLosses,
        "video_distillation": DistillationLosses,
        "joint": JointLosses,
    }
)
