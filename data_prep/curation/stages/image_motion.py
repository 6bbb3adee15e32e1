"""Stage 4: how much the image moves, by DIS flow of the reduced images."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from diff4splat.data_prep.alignment.opencv.dis_flow import flow_pair
from diff4splat.data_prep.curation.working_clip import WorkingClip


def score_image_motion(working: WorkingClip) -> WorkingClip:
    """``flow_mean`` and ``flow_p90``, medians over frames, and ``flow_most``, over the diagonal."""
    pairs = pairwise(working.images)
    flows = tuple(flow_pair(first, second) for first, second in pairs)
    if not flows:
        return working
    diagonal = float(np.hypot(*working.size_px))
    lengths = [np.linalg.norm(flow.forward, axis=-1) / diagonal for flow in flows]
    p90 = [float(np.quantile(length, 0.9)) for length in lengths]
    return replace(working, flows=flows).scored(
        flow_mean=float(np.median([length.mean() for length in lengths])),
        flow_p90=float(np.median(p90)),
        flow_most=max(p90),
        flow_consistent=float(np.mean([flow.consistent.mean() for flow in flows])),
    )
