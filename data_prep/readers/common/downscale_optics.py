"""Optics of downscaled images: only the read-out time changes.

Line r of H is read at t + (r / (H − 1) − ½) readout. A downscaled line has the mean time of its
n lines, so the read-out of H / n lines takes readout · (H − n) / (H − 1).
"""

from dataclasses import replace

from diff4splat.errors import ConfigError
from diff4splat.geometry.optics import Optics


def downscale_optics(optics: Optics, size_px: tuple[int, int], factor: int, name: str) -> Optics:
    """The optics of images of ``size_px``, downscaled by ``factor``.

    Raises:
        ConfigError: lines would be left over, or times are those of the first line, which is then
            another one.
    """
    shutter = optics.shutter
    if shutter is None or factor == 1:
        return optics
    lines = size_px[shutter.direction in ("left-to-right", "right-to-left")]
    if lines % factor or optics.timestamp != "middle":
        raise ConfigError(
            f"{name}: expected a downscale that {lines} lines can be divided by, and times of the "
            f"middle of frames, since lines have times of their own, got {factor} and "
            f"'{optics.timestamp}'; choose another downscale"
        )
    share = (lines - factor) / max(lines - 1, 1)
    return replace(optics, shutter=replace(shutter, readout_s=shutter.readout_s * share))
