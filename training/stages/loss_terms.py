"""Loss terms and their weighted sum (Diff4Splat, training losses).

    L = λ_photo (MSE + λ_p LPIPS) + λ_geo (1 − Pearson) + smoothness + λ_motion L_motion

Axes: ``b`` batch, ``m p`` targets, ``h w`` pixels.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

from diff4splat.io.pixels import unit_rgb
from diff4splat.metrics.features.protocol import PerceptualFeatures
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.losses.depth import depth_correlation, depth_log_error, depth_smoothness
from diff4splat.training.losses.motion import track_motion
from diff4splat.training.losses.photometric import perceptual_error, squared_error
from diff4splat.training.recipe.losses import MotionLosses, ReconstructionLosses
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.model_stage import Terms
from diff4splat.training.stages.scene_prediction import RenderedScenes


@dataclass(frozen=True, slots=True, kw_only=True)
class LossTerm:
    """One term by name, computed when it is needed."""

    name: str
    weight: float
    compute: Callable[[], Float[Tensor, " b"]]


def weighted_sum(terms: Sequence[LossTerm]) -> Terms:
    """The value of every term, and their weighted sum as ``total``.

    Terms of weight 0 are not computed, but for the first: a stage always has a loss to
    differentiate.
    """
    used = [term for place, term in enumerate(terms) if term.weight or place == 0]
    values = {term.name: term.compute() for term in used}
    return values | {TOTAL: sum(term.weight * values[term.name] for term in used)}


def combine(first: Terms, second: Terms) -> Terms:
    """The terms of two objectives, and the sum of their totals."""
    return {**first, **second, TOTAL: first[TOTAL] + second[TOTAL]}


def reconstruction_terms(
    rendered: RenderedScenes,
    batch: ClipBatch,
    weights: ReconstructionLosses,
    features: PerceptualFeatures,
) -> list[LossTerm]:
    """Terms of the rendered images and depth at the targets."""
    rgb, truth = rendered.rgb.flatten(1, 2), unit_rgb(batch.target_rgb).flatten(1, 2)
    depth, true_depth = rendered.depth.flatten(1, 2), batch.target_depth.flatten(1, 2)
    valid = true_depth > 0
    photometric, geometric = weights.photometric, weights.depth
    terms = [
        LossTerm(name="photometric", weight=photometric, compute=lambda: squared_error(rgb, truth)),
        LossTerm(
            name="perceptual",
            weight=photometric * weights.perceptual,
            compute=lambda: perceptual_error(rgb, truth, features),
        ),
        LossTerm(
            name="depth",
            weight=geometric,
            compute=lambda: depth_correlation(depth, true_depth, valid),
        ),
        LossTerm(
            name="smoothness",
            weight=geometric * weights.smoothness,
            compute=lambda: depth_smoothness(depth, valid),
        ),
    ]
    return terms + _input_depth_terms(rendered, batch, weights)


def _input_depth_terms(
    rendered: RenderedScenes, batch: ClipBatch, weights: ReconstructionLosses
) -> list[LossTerm]:
    depth = rendered.input_depth
    if depth is None:
        return []
    return [
        LossTerm(
            name="depth_log",
            weight=weights.depth_log,
            compute=lambda: depth_log_error(depth, batch.depth),
        )
    ]


def motion_term(
    offsets: Float[Tensor, "b m n 3"], batch: ClipBatch, weights: MotionLosses
) -> LossTerm:
    """The term of the tracked points' displacements at all target times."""
    return LossTerm(
        name="motion", weight=weights.weight, compute=lambda: _motion(offsets, batch, weights)
    )


def _motion(
    offsets: Float[Tensor, "b m n 3"], batch: ClipBatch, weights: MotionLosses
) -> Float[Tensor, " b"]:
    valid = batch.track_valid[:, None].expand(offsets.shape[:3])
    return track_motion(
        offsets.flatten(1, 2),
        batch.track_offset.flatten(1, 2),
        valid.flatten(1, 2),
        distance_weight=weights.distance,
        l1_weight=weights.displacement_l1,
        huber_delta=weights.huber_delta,
    )
