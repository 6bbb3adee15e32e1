"""MegaSaM's depth as reference, brought to metres or to the poses of the clip.

MegaSaM's lengths are metres times a normaliser that it does not keep. It comes from its inputs
(``tool_files.megasam.normaliser``), or from the poses of the clip, where those are metric already.
"""

import cv2
import numpy as np
from jaxtyping import Float32, Float64

from diff4splat.data.clip import Clip
from diff4splat.data_prep.alignment.references.reference import Reference, aligned_metric
from diff4splat.data_prep.alignment.tool_files.megasam import MegasamScene
from diff4splat.errors import InputError

_LEAST_SPREAD = 1e-6
"""Of camera centres, relative to the median depth: less is a camera that does not move."""


def megasam_reference(clip: Clip, scene: MegasamScene, normaliser: float | None) -> Reference:
    """Depth in metres (with ``normaliser``) or in the lengths of the clip's poses.

    Raises:
        InputError: other frames than the clip has, or the normaliser is lost.
    """
    if len(scene.depth) != clip.frames:
        raise InputError(
            f"reference megasam: expected {clip.frames} frames like the clip, got "
            f"{len(scene.depth)}; run MegaSaM on the frames of the clip"
        )
    depth = _resized(scene.depth, clip.size_px)
    ratio = _clip_over_megasam(clip, scene)
    if normaliser is not None:
        metres = depth / np.float32(normaliser)
        # Without motion no factor is measurable; a camera that does not move needs none.
        factor = 1.0 if ratio is None else 1 / (ratio * normaliser)
        return Reference(
            depth=metres, name="megasam", metric="aligned", factor=factor, normaliser=normaliser
        )
    if clip.note.metric == "none" or ratio is None:
        raise InputError(
            "reference megasam: expected its normaliser, or a clip with metric poses and a camera "
            "that moves, got neither; MegaSaM does not keep the normaliser, so give it, or the "
            "files that went in"
        )
    return Reference(
        depth=depth * np.float32(ratio),
        name="megasam",
        metric=aligned_metric(clip.note.metric),
        normaliser=1 / ratio,
    )


def _clip_over_megasam(clip: Clip, scene: MegasamScene) -> float | None:
    """Spread of the camera centres of the clip over that of the reconstruction."""
    mine = _spread(clip.views[0].cameras.position.numpy())
    theirs = _spread(scene.world_from_camera[:, :3, 3])
    known = scene.depth[scene.depth > 0]
    moves = len(known) and theirs > _LEAST_SPREAD * float(np.median(known)) and mine > 0
    return mine / theirs if moves else None


def _spread(centers: Float64[np.ndarray, "t 3"]) -> float:
    """Root mean square distance from the mean: no rotation changes it."""
    return float(np.sqrt(((centers - centers.mean(0)) ** 2).sum(1).mean()))


def _resized(
    depth: Float32[np.ndarray, "t h w"], size_px: tuple[int, int]
) -> Float32[np.ndarray, "t h2 w2"]:
    size = size_px[::-1]
    frames = [cv2.resize(each, size, interpolation=cv2.INTER_NEAREST_EXACT) for each in depth]
    return np.stack(frames)
