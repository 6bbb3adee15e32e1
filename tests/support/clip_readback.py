"""What worker processes do in tests; here, because they import it by name."""

from diff4splat.data.clip_folder import ClipFolder


def depth_sum(folder: ClipFolder, position: int) -> float:
    """Of the first view of a clip."""
    return float(folder.clip(position).views[0].depth.sum())
