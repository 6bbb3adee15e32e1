"""What can be asked of a physical camera, and what it answers.

Axes: ``h w`` pixels.
"""

import math
from dataclasses import dataclass, field

from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.render.settings import RenderSettings, require_accepted
from diff4splat.render.trace.settings import TraceSettings

OUTPUTS = ("rgb", "alpha", "depth", "median_depth", "distance", "time_s")
"""Every image that a physical camera can make; ``valid`` comes with all of them."""
GEOMETRY = frozenset({"depth", "median_depth", "distance", "time_s"})
"""Outputs of the one ray through the middle of pixel, lens and exposure."""
LENS_SAMPLES, EXPOSURE_SAMPLES, PIXEL_SAMPLES = 64, 16, 16
"""Rays per pixel where nobody says how many: powers of two, which Sobol's points fill best."""
MOST_SAMPLES = 1 << 16
_LEAST_MEMORY = 16 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class PhotoSettings:
    """How an image is taken."""

    samples: int | None = None
    """Rays per pixel; None is 64 with an aperture, 16 with an exposure or pixel areas, else 1. What
    needs no samples takes one whatever is said here."""
    seed: int = 0
    """Of the samples."""
    pixel_area: bool = False
    """Average over the square of a pixel; else all rays go through its middle."""
    smoothing_px2: float | None = None
    """Variance by which Gaussians are widened, in square pixels at their distance, as the
    rasteriser widens footprints; 0 switches it off. None is what a scene was made for
    (``Scene.dilation_px2``), and 0.3 for bare Gaussians."""
    tolerance_px: float = 0.1
    """How far anything may be from where it is at the time of a ray: sets the intervals of time in
    which Gaussians keep their shape and go straight."""
    rows_per_chunk: int | None = None
    """Lines that share one such interval, in place of the tolerance."""
    most_intervals: int = 256
    """Limit of their number; the remaining error is reported."""
    trace: TraceSettings = field(default_factory=TraceSettings)
    raster: RenderSettings = field(default_factory=RenderSettings)
    """For cameras that turn out to be pinholes."""
    memory_bytes: int = 1 << 30
    """For rays in flight. With gradients all rays are, else as many as fit are taken at a time."""

    def __post_init__(self) -> None:
        accepted = {
            "samples": self.samples is None or 1 <= self.samples <= MOST_SAMPLES,
            "smoothing_px2": self.smoothing_px2 is None or 0 <= self.smoothing_px2 < math.inf,
            "tolerance_px": 0 < self.tolerance_px < math.inf,
            "rows_per_chunk": self.rows_per_chunk is None or self.rows_per_chunk >= 1,
            "most_intervals": self.most_intervals >= 1,
            "memory_bytes": self.memory_bytes >= _LEAST_MEMORY,
        }
        require_accepted(self, accepted, _EXPECTED)


_EXPECTED = {
    "samples": f"1 to {MOST_SAMPLES}, or None",
    "smoothing_px2": "a finite number of at least 0, or None",
    "tolerance_px": "a finite number above 0",
    "rows_per_chunk": "at least 1, or None",
    "most_intervals": "at least 1",
    "memory_bytes": f"at least {_LEAST_MEMORY}",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Photograph:
    """The images asked for, None for the others. Pixels that see nothing through the lens are 0.

    Colour and alpha are means over the samples of a pixel. Depth, distance and time are those of
    the ray through the middle of pixel, lens and exposure: what is there, not how it is blurred.
    """

    valid: Bool[Tensor, "h w"]
    """Whether the lens maps the pixel to a ray."""
    rgb: Float[Tensor, "h w 3"] | None = None
    alpha: Float[Tensor, "h w"] | None = None
    depth: Float[Tensor, "h w"] | None = None
    """Expected z; 0 where nothing is seen, and where it is not in front of the camera."""
    median_depth: Float[Tensor, "h w"] | None = None
    distance: Float[Tensor, "h w"] | None = None
    """Expected distance along the ray; 0 where nothing is seen."""
    time_s: Float[Tensor, "h w"] | None = None
    """The middle of each pixel's exposure, relative to the frame's time."""
    backend: str = "trace"
    samples: int = 1
    """Rays per pixel."""
    intervals: int = 1
    """Into how many parts the time of the image was split."""
    interval_error_px: float = 0.0
    """How far anything was from its place at most, as far as it was looked at."""
    skipped_effects: tuple[str, ...] = ()
    """What this image did not need, in words."""
    dropped_nonfinite: int = 0
    """Gaussians left out because a parameter is NaN, infinite or too large."""
