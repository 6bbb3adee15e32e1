"""Settings and outputs of the tracer.

Axes: ``r`` rays. With D the distance of a ray from a mean in standard deviations, the response is
exp(-D² / 2) for kernel degree 2 and exp(-D⁴ / 18) for degree 4: both are exp(-4.5) at D = 3
(3D Gaussian Ray Tracing, SIGGRAPH Asia 2024).
"""

import math
from dataclasses import dataclass, field
from typing import Literal

from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.render.settings import is_finite_rgb, require_accepted

OUTPUTS = ("rgb", "distance", "median_distance", "alpha", "hits")
"""Everything that the tracer can answer per ray."""
KERNEL_DEGREES = (2, 4)
_LEAST_MEMORY, _LEAST_LIGHT = 1 << 20, 1e-30
_DARK_ROOM = 1 + 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceSettings:
    """Settings of the tracer. A scene must be traced with the settings it was fitted with."""

    kernel_degree: int = 2
    """2 for Gaussians, which rasterisers draw too; 4 for the flatter ones of 3DGRT."""
    alpha_cutoff: float = 1 / 255
    """Contributions to a ray below this are nothing; it also bounds the support."""
    alpha_max: float = 0.99
    """Largest opacity of one contribution; below 1 so that the light behind has a gradient."""
    light_cutoff: float = 1e-4
    """A ray that sees no more than this of what lies behind is done; (1 - alpha_max)² ends it
    behind two opaque Gaussians."""
    near_distance: float = 0.01
    """A Gaussian whose response peaks no further from the origin than this is not there."""
    min_response: float | None = None
    """Smaller responses are nothing whatever the opacity; None is no such rule."""
    color_direction: Literal["ray", "mean"] = "ray"
    """Harmonics are evaluated along the ray (3DGRT), or from its origin to the mean (as by the
    rasteriser)."""
    background: tuple[float, float, float] | Float[Tensor, "3"] = (0.0, 0.0, 0.0)
    """RGB behind the scene; a tensor gets a gradient."""
    memory_bytes: int = 256 << 20
    """What tracing may allocate beyond inputs, outputs, search tree and gradients."""

    def __post_init__(self) -> None:
        accepted = {
            "kernel_degree": self.kernel_degree in KERNEL_DEGREES,
            "alpha_cutoff": 0 < self.alpha_cutoff < 1,
            "alpha_max": self.alpha_cutoff < self.alpha_max < 1,
            "light_cutoff": _LEAST_LIGHT <= self.light_cutoff < 1,
            "near_distance": 0 <= self.near_distance < math.inf,
            "min_response": self.min_response is None or 0 < self.min_response < 1,
            "color_direction": self.color_direction in ("ray", "mean"),
            "background": is_finite_rgb(self.background),
            "memory_bytes": self.memory_bytes >= _LEAST_MEMORY,
        }
        require_accepted(self, accepted, _EXPECTED)

    @property
    def dark(self) -> float:
        """Light below this is none: a shade above the cutoff, so that rounding decides no pair."""
        return self.light_cutoff * _DARK_ROOM

    @classmethod
    def preset_3dgrt(cls) -> "TraceSettings":
        """The defaults that 3D Gaussian Ray Tracing trains with."""
        return cls(kernel_degree=4, min_response=0.0113, light_cutoff=1e-3)


_EXPECTED = {
    "kernel_degree": "2 or 4",
    "alpha_cutoff": "a number above 0 and below 1",
    "alpha_max": "a number above alpha_cutoff and below 1",
    "light_cutoff": f"at least {_LEAST_LIGHT} and below 1",
    "near_distance": "a finite number of at least 0",
    "min_response": "None or a number above 0 and below 1",
    "color_direction": "'ray' or 'mean'",
    "background": "three finite numbers",
    "memory_bytes": f"at least {_LEAST_MEMORY}",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceOutput:
    """The requested outputs, None for the rest. Invalid rays have 0 everywhere."""

    rgb: Float[Tensor, "r 3"] | None = None
    distance: Float[Tensor, " r"] | None = None
    """Expected distance along the ray, Σ w τ / Σ w; 0 where nothing is hit."""
    median_distance: Float[Tensor, " r"] | None = None
    """τ of the Gaussian behind which at most half of the light is left; 0 where more is left."""
    alpha: Float[Tensor, " r"] | None = None
    """Σ w"""
    hits: Int[Tensor, " r"] | None = None
    """How many Gaussians were blended before the light ran out."""
    dropped_nonfinite: int = 0
    """Gaussians left out because a parameter is NaN, infinite, or too large to be squared."""
    dropped_by_parameter: dict[str, int] = field(default_factory=dict)
    """The same, by the first such parameter."""
