"""Stage 1: does the clip keep its contract, and are its lenses plausible?"""

import numpy as np

from diff4splat.data.checks import require_valid_clip
from diff4splat.data.consistency.pixels import rotation_errors
from diff4splat.data_prep.curation.working_clip import WorkingClip


def score_integrity(working: WorkingClip) -> WorkingClip:
    """``frames``, ``fov_least_deg``, ``fov_most_deg`` (horizontal), ``rotation_error``.

    Raises:
        InputError: the clip contradicts its contract.
    """
    require_valid_clip(working.clip)
    focal = working.view.cameras.focal_px[:, 0].numpy()
    fov_deg = np.degrees(2 * np.arctan(working.clip.size_px[1] / (2 * focal)))
    return working.scored(
        frames=working.clip.frames,
        fov_least_deg=float(fov_deg.min()),
        fov_most_deg=float(fov_deg.max()),
        rotation_error=float(rotation_errors(working.view.cameras).max()),
    )
