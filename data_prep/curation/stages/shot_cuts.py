"""Stage 2: cuts and fades inside the clip.

A cut is a pair of frames whose mean change of hue, saturation and value is at least 21 and three
times that of the pairs around it: the rules of PySceneDetect's content and adaptive detectors with
the thresholds of SpatialVID. The ratio keeps fast motion from passing for a cut.
"""

from itertools import pairwise

import cv2
import numpy as np
from jaxtyping import Float64, UInt8

from diff4splat.data_prep.curation.working_clip import WorkingClip

CONTENT, RATIO, WINDOW = 21.0, 3.0, 2
TRIM_S = 0.3
"""Cut off on both sides of a cut."""
_SIDE_PX = 32
_DARK, _FLAT = 12, 4.0
"""Mean and deviation of luma of a frame that is faded out."""


def score_shot_cuts(working: WorkingClip) -> WorkingClip:
    """``cuts``, ``cut_content`` (largest change), ``faded_share``, ``duration_s``, ``shot_s``."""
    change = content_change(working.images)
    cuts = cut_positions(change)
    grey = working.images.mean(-1)
    faded = (grey.mean((1, 2)) < _DARK) & (grey.std((1, 2)) < _FLAT)
    fps = working.clip.fps
    longest = longest_shot(cuts, working.clip.frames, fps)
    return working.scored(
        cuts=len(cuts),
        cut_content=float(change.max()) if len(change) else 0.0,
        faded_share=float(faded.mean()),
        duration_s=None if fps is None else working.clip.frames / fps,
        shot_s=None if fps is None else len(longest) / fps,
    )


def content_change(images: UInt8[np.ndarray, "t h w 3"]) -> Float64[np.ndarray, " s"]:
    """Mean absolute change of hue, saturation and value, per pair of frames."""
    hsv = [cv2.cvtColor(_small(image), cv2.COLOR_RGB2HSV).astype(np.int16) for image in images]
    return np.array([_change(first, second) for first, second in pairwise(hsv)], np.float64)


def _change(first: np.ndarray, second: np.ndarray) -> float:
    change = np.abs(second - first)
    # Hue is an angle of 180 steps: from 179 to 0 is one.
    change[..., 0] = np.minimum(change[..., 0], 180 - change[..., 0])
    return float(change.mean())


def _small(image: UInt8[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "h2 w2 3"]:
    """So small that what moves a little changes little, however fine its texture."""
    height, width = image.shape[:2]
    factor = min(1.0, _SIDE_PX / max(height, width))
    size = (max(1, round(width * factor)), max(1, round(height * factor)))
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)


def cut_positions(change: Float64[np.ndarray, " s"]) -> list[int]:
    """Frames that begin a new shot."""
    cuts = []
    for at, value in enumerate(change):
        around = np.r_[change[max(0, at - WINDOW) : at], change[at + 1 : at + 1 + WINDOW]]
        usual = around.mean() if len(around) else 0.0
        if value >= CONTENT and value >= RATIO * usual:
            cuts.append(at + 1)
    return cuts


def longest_shot(cuts: list[int], frames: int, fps: float | None) -> range:
    """Frames of the longest shot, trimmed where it touches a cut."""
    trim = 0 if fps is None else round(TRIM_S * fps)
    edges = [0, *cuts, frames]
    shots = [
        range(first + trim * (first > 0), last - trim * (last < frames))
        for first, last in pairwise(edges)
    ]
    return max(shots, key=len)
