"""Stage 11: perceptual hashes and features of three frames, and the group of a clip.

The hash is 64 bits: signs of the low frequencies of a 32 × 32 grey image against their median
(pHash). Which clips are duplicates of which is decided later, over all of them.
"""

from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import UInt8

from diff4splat.data_prep.curation.duplicates.features import clip_features, features_text
from diff4splat.data_prep.curation.working_clip import WorkingClip

_SIDE, _FREQUENCIES = 32, 8


def score_fingerprints(working: WorkingClip) -> WorkingClip:
    """Labels ``hash`` (three numbers of 16 hex digits), ``features`` and ``group``."""
    frames = working.images[[0, len(working.images) // 2, -1]]
    hashes = " ".join(f"{perceptual_hash(frame):016x}" for frame in frames)
    note = working.clip.note
    group = f"{note.dataset}/{note.scene or note.identifier}"
    labels = {"hash": hashes, "features": features_text(clip_features(frames)), "group": group}
    return replace(working, record=working.record.with_labels(**labels))


def perceptual_hash(image: UInt8[np.ndarray, "h w 3"]) -> int:
    """64 bits; small changes of the image change few of them."""
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    small = cv2.resize(grey, (_SIDE, _SIDE), interpolation=cv2.INTER_AREA).astype(np.float32)
    low = cv2.dct(small)[:_FREQUENCIES, :_FREQUENCIES].reshape(-1)
    bits = low > np.median(low[1:])
    return int("".join("1" if bit else "0" for bit in bits), 2)
