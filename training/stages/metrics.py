"""What evaluation during training and gates look at.

Axes: ``b`` batch, ``m p`` targets, ``n`` tracked points.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.io.pixels import unit_rgb
from diff4splat.metrics.depth import depth_pearson
from diff4splat.metrics.image import psnr
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.losses.depth import depth_correlation
from diff4splat.training.losses.motion import track_motion
from diff4splat.training.stages.scene_prediction import RenderedScenes

Metrics = dict[str, Float[Tensor, " b"]]


def reconstruction_metrics(rendered: RenderedScenes, batch: ClipBatch) -> Metrics:
    """``psnr``, ``depth_correlation`` and, with motion, ``track_error`` and its share of the truth.

    ``track_share`` is the error over that of no motion: 1 is no better than no motion. Where a
    measure does not apply (no moving point, no true depth that varies) it is NaN, and means leave
    it out; a rendered depth that does not vary counts as uncorrelated.
    """
    truth = batch.target_depth.flatten(1, 2)
    seen = psnr(rendered.rgb.clamp(0, 1), unit_rgb(batch.target_rgb)).flatten(1).mean(1)
    correlation = 1 - depth_correlation(rendered.depth.flatten(1, 2), truth, truth > 0)
    applies = ~depth_pearson(truth, truth, truth > 0).isnan().all(1)
    measures = {"psnr": seen, "depth_correlation": torch.where(applies, correlation, torch.nan)}
    if rendered.offsets is not None:
        measures |= _track_measures(rendered.offsets, batch)
    return measures


def _track_measures(offsets: Float[Tensor, "b m n 3"], batch: ClipBatch) -> Metrics:
    valid = batch.track_valid[:, None].expand(offsets.shape[:3])
    truth = batch.track_offset
    # Without its pull to standstill the motion loss is the mean distance.
    error, still = (
        track_motion(offset, truth, valid, distance_weight=1.0, l1_weight=0.0)
        for offset in (offsets, torch.zeros_like(truth))
    )
    share = torch.where(still > 0, error / still, torch.nan)
    return {"track_error": error, "track_share": share}
