"""Stage 12: classes of motion and of camera paths, which quotas count.

Paths are relative to the median depth, so the limits hold in any unit.
"""

from dataclasses import replace

from diff4splat.data_prep.curation.working_clip import WorkingClip

LEAST_MOVING_SHARE = 0.005
_PATHS = ((0.02, "tripod"), (0.2, "short"), (0.8, "medium"), (float("inf"), "long"))
_FAST = 0.01
"""90th percentile of flow over the diagonal and frame."""


def score_classes(working: WorkingClip) -> WorkingClip:
    """Labels ``motion`` (static, slow, fast, unknown) and ``path`` (tripod to long, unknown)."""
    scores = working.record.scores
    labels = {
        "motion": motion_class(scores.get("moving_share"), scores.get("flow_p90", 0.0)),
        "path": path_class(scores.get("path_over_depth")),
    }
    return replace(working, record=working.record.with_labels(**labels))


def motion_class(moving_share: float | None, flow_p90: float) -> str:
    """By the share of moving pixels, and by how fast the image moves."""
    if moving_share is None:
        return "unknown"
    if moving_share < LEAST_MOVING_SHARE:
        return "static"
    return "fast" if flow_p90 > _FAST else "slow"


def path_class(path_over_depth: float | None) -> str:
    """By the length of the path over the median depth."""
    if path_over_depth is None:
        return "unknown"
    return next(name for limit, name in _PATHS if path_over_depth < limit)
