"""Frame counts, rates and amplitudes that a path may have; imports no torch."""

import math

from diff4splat.errors import InputError

MAX_POSES = 100_000
"""More cameras than this are a mistake, not a film."""

MAX_AMPLITUDE = 100.0
"""Near depths or turns; beyond it sines lose their digits."""


def require_frames(frames: int, fps: float) -> None:
    """Refuse frame counts and rates that no film has.

    Raises:
        InputError: no frame, too many, or a rate that is not a finite number above 0.
    """
    if not 1 <= frames <= MAX_POSES:
        raise InputError(f"frames: expected 1 to {MAX_POSES}, got {frames}; choose another count")
    if not (math.isfinite(fps) and fps > 0):
        raise InputError(f"fps: expected a finite rate above 0, got {fps:g}; choose another rate")


def require_amplitude(amplitude: float, what: str) -> None:
    """Refuse amplitudes that are not finite or absurdly large.

    Raises:
        InputError: with the allowed range.
    """
    if not abs(amplitude) <= MAX_AMPLITUDE:
        raise InputError(
            f"{what}: expected an amplitude from -{MAX_AMPLITUDE:g} to {MAX_AMPLITUDE:g}, "
            f"got {amplitude:g}; choose a smaller one"
        )
