"""Stage 6: how much depth there is, how near and far, and how well it was aligned."""

import numpy as np

from diff4splat.data_prep.curation.working_clip import WorkingClip

_QUANTILES = (0.001, 0.999)
"""Single pixels are no range."""


def score_depth_range(working: WorkingClip) -> WorkingClip:
    """``depth_share``, ``depth_near_m``, ``depth_far_m`` and ``alignment_*`` of the record."""
    depth = working.view.depth
    scale = working.clip.note.scale
    if scale is not None:
        working = working.scored(
            alignment_error=scale.relative_error, alignment_inliers=scale.inlier_share
        )
    if depth is None:
        return working
    values = depth.numpy()
    known = values[values > 0]
    near_far = np.quantile(known, _QUANTILES) if len(known) else (np.nan, np.nan)
    metric = working.clip.note.metric != "none"
    return working.scored(
        depth_share=len(known) / values.size,
        depth_near_m=float(near_far[0]) if metric else None,
        depth_far_m=float(near_far[1]) if metric else None,
    )
