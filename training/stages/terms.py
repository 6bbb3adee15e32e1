"""The rendering losses of one batch, weighted as the recipe says (Diff4Splat, training losses).

    L = λ_photo (MSE + λ_p LPIPS) + λ_geo (1 − Pearson) + smoothness + λ_motion L_motion

Axes: ``b`` batch, ``m p`` targets, ``h w`` pixels. A weight of 0 leaves the term's work out.
"""

from jaxtyping import Float
from torch import Tensor

from diff4splat.io.pixels import unit_rgb
from diff4splat.metrics.features.protocol import PerceptualFeatures
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.losses.depth import depth_correlation, depth_log_error, depth_smoothness
from diff4splat.training.losses.motion import track_motion
from diff4splat.training.losses.photometric import perceptual_error, squared_error
from diff4splat.training.recipe import LossWeights
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.prediction import Rendered

Terms = dict[str, Float[Tensor, " b"]]


def rendering_terms(
    rendered: Rendered, batch: ClipBatch, weights: LossWeights, features: PerceptualFeatures
) -> Terms:
    """Every term by name, and their weighted sum as ``total``."""
    rgb, truth = rendered.rgb.flatten(1, 2), unit_rgb(batch.target_rgb).flatten(1, 2)
    depth = rendered.depth.flatten(1, 2)
    true_depth = batch.target_depth.flatten(1, 2)
    valid = true_depth > 0
    terms = {"photometric": squared_error(rgb, truth)}
    weighted = {"photometric": weights.photometric}
    if weights.photometric * weights.perceptual:
        terms["perceptual"] = perceptual_error(rgb, truth, features)
        weighted["perceptual"] = weights.photometric * weights.perceptual
    if weights.depth:
        terms["depth"] = depth_correlation(depth, true_depth, valid)
        weighted["depth"] = weights.depth
    if weights.depth * weights.smoothness:
        terms["smoothness"] = depth_smoothness(depth, valid)
        weighted["smoothness"] = weights.depth * weights.smoothness
    if weights.depth_log and rendered.own_depth is not None:
        terms["depth_log"] = depth_log_error(rendered.own_depth, batch.depth)
        weighted["depth_log"] = weights.depth_log
    if weights.motion and rendered.offsets is not None:
        terms["motion"] = motion_term(rendered.offsets, batch, weights)
        weighted["motion"] = weights.motion
    return terms | {TOTAL: sum(weight * terms[name] for name, weight in weighted.items())}


def motion_term(
    offsets: Float[Tensor, "b m n 3"], batch: ClipBatch, weights: LossWeights
) -> Float[Tensor, " b"]:
    """The motion loss of the followed points at all target times, before its weight."""
    valid = batch.track_valid[:, None].expand(offsets.shape[:3])
    return track_motion(
        offsets.flatten(1, 2),
        batch.track_offset.flatten(1, 2),
        valid.flatten(1, 2),
        distance_weight=weights.motion_distance,
        size_weight=weights.motion_size,
        width=weights.motion_width,
    )
