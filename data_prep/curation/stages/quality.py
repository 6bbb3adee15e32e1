"""Stage 10: a user's quality or aesthetic model; without one there is no score.

Frames are the first, the middle and the last, as Open-Sora rates them.
"""

from diff4splat.data_prep.curation.hooks import load_hook
from diff4splat.data_prep.curation.working_clip import WorkingClip
from diff4splat.errors import InputError


def score_quality(working: WorkingClip) -> WorkingClip:
    """``quality``, in the scale of the model.

    Raises:
        ConfigError: the model cannot be loaded.
        InputError: it returns no number.
    """
    if not working.hooks.quality:
        return working
    frames = working.view.rgb.numpy()
    value = load_hook(working.hooks.quality)(frames[[0, len(frames) // 2, -1]])
    try:
        return working.scored(quality=float(value))
    except (TypeError, ValueError) as error:
        raise InputError(f"quality model: expected a number, got {value!r:.60}") from error
