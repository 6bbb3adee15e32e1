"""What can be asked of a renderer, and what it answers.

Axes: ``h w`` pixels. Depth is camera-space z in scene units, flow is in pixels (x, y).
"""

import math
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.geometry.camera import Camera
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import DILATION_PX2

OUTPUTS = ("rgb", "depth", "median_depth", "alpha", "flow", "features")
"""Every image that a renderer can make."""

_LEAST_MEMORY = 1 << 20
LEAST_LIGHT = 1e-30


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderSettings:
    """How an image is made; defaults as in gsplat, which follows Kerbl et al. 2023."""

    background: tuple[float, float, float] | Float[Tensor, "3"] = (0.0, 0.0, 0.0)
    """RGB behind the scene; a tensor gets a gradient."""
    dilation_px2: float | None = None
    """Variance added to both axes of every footprint, in square pixels; 0 switches it off. None is
    what a scene was made for (``Scene.dilation_px2``), and 0.3 for bare Gaussians."""
    antialias: bool = False
    """Scale opacities by sqrt(det / det_dilated): dilation adds no light (Yu et al. 2024)."""
    alpha_cutoff: float = 1 / 255
    """Contributions to a pixel below this are nothing; it also bounds the support."""
    alpha_max: float = 0.999
    """Largest opacity of one contribution; below 1 so that the light behind has a gradient."""
    light_cutoff: float | None = None
    """A pixel that sees less than this of what lies behind is done. None is the back end's own:
    1e-6 on a CPU, 1e-4 with gsplat. The reference goes on in any case."""
    near_depth: float = 0.01
    """Gaussians whose centre is nearer than this, in scene units, are not drawn."""
    tile_px: int | None = None
    """Edge of the square tiles that share one list of Gaussians; None is the back end's best."""
    memory_bytes: int = 256 << 20
    """What the compositing may allocate beyond its inputs and outputs."""
    flow_camera: Camera | None = None
    """Where the camera is at the end of the flow; None is the same camera."""
    flow_time_s: float | None = None
    """When the flow ends; None is the same time."""
    features: Float[Tensor, "n f"] | None = None
    """What the output ``features`` blends: any numbers per Gaussian."""

    def __post_init__(self) -> None:
        accepted = {
            "background": is_finite_rgb(self.background),
            "dilation_px2": self.dilation_px2 is None or 0 <= self.dilation_px2 < math.inf,
            "alpha_cutoff": 0 < self.alpha_cutoff < 1,
            "alpha_max": self.alpha_cutoff < self.alpha_max < 1,
            "near_depth": 0 < self.near_depth < math.inf,
            # Smaller ones would let the light underflow before a pixel is done.
            "light_cutoff": self.light_cutoff is None or LEAST_LIGHT <= self.light_cutoff < 1,
            "tile_px": self.tile_px is None or self.tile_px >= 1,
            "memory_bytes": self.memory_bytes >= _LEAST_MEMORY,
        }
        require_accepted(self, accepted, _EXPECTED)

    @property
    def added_px2(self) -> float:
        """The dilation, where no scene says another."""
        return DILATION_PX2 if self.dilation_px2 is None else self.dilation_px2


def require_accepted(settings: object, accepted: dict[str, bool], expected: dict[str, str]) -> None:
    """Every field of ``settings`` is ``accepted``.

    Raises:
        ConfigError: one is not; ``expected`` says what it should be.
    """
    for name, fine in accepted.items():
        if not fine:
            raise ConfigError(
                f"{type(settings).__name__}.{name}: expected {expected[name]}, "
                f"got {getattr(settings, name)}"
            )


def is_finite_rgb(background: tuple[float, ...] | Tensor) -> bool:
    """Whether a background is three finite numbers."""
    if isinstance(background, Tensor):
        return background.shape == (3,) and bool(torch.isfinite(background.detach()).all())
    return len(background) == 3 and all(map(math.isfinite, background))


_EXPECTED = {
    "background": "three finite numbers",
    "dilation_px2": "a finite number of at least 0",
    "alpha_cutoff": "a number above 0 and below 1",
    "alpha_max": "a number above alpha_cutoff and below 1",
    "light_cutoff": f"at least {LEAST_LIGHT} and below 1",
    "near_depth": "a finite number above 0",
    "tile_px": "at least 1",
    "memory_bytes": f"at least {_LEAST_MEMORY}",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderOutput:
    """The images asked for, None for the others; ``b`` is there for batches of cameras."""

    rgb: Float[Tensor, "*b h w 3"] | None = None
    depth: Float[Tensor, "*b h w"] | None = None
    """Expected z, Σ w z / Σ w; 0 where nothing is seen."""
    median_depth: Float[Tensor, "*b h w"] | None = None
    """z of the Gaussian behind which at most half of the light is left; 0 where more is left."""
    alpha: Float[Tensor, "*b h w"] | None = None
    flow: Float[Tensor, "*b h w 2"] | None = None
    """Where the surface goes, in pixels; 0 where nothing is seen."""
    features: Float[Tensor, "*b h w f"] | None = None
    """Σ w v; nothing lies behind."""
    dropped_nonfinite: int = 0
    """Gaussians left out because a parameter is NaN, infinite, or too large to be squared."""
    dropped_by_parameter: dict[str, int] = field(default_factory=dict)
    """The same, by the first such parameter."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderJob:
    """One image to make: what every back end gets. Tensors share one dtype and device."""

    gaussians: Gaussians
    camera: Camera
    outputs: frozenset[str]
    settings: RenderSettings
    flow_gaussians: Gaussians
    """The same Gaussians at the end of the flow."""
    flow_camera: Camera


def require_outputs(outputs: Collection[str], known: Collection[str] = OUTPUTS) -> frozenset[str]:
    """The set of ``outputs`` when all of them are ``known``.

    Raises:
        ConfigError: none is named, or a name is unknown.
    """
    names = ", ".join(known)
    if isinstance(outputs, str) or not outputs:
        raise ConfigError(f"outputs: expected a collection of names among {names}, got {outputs!r}")
    unknown = sorted(set(outputs) - set(known))
    if unknown:
        raise ConfigError(f"outputs: expected names among {names}, got {', '.join(unknown)}")
    return frozenset(outputs)


def stack_outputs(frames: list[RenderOutput]) -> RenderOutput:
    """Several images as one batch.

    A Gaussian that is left out of several counts in each of them.
    """
    images = {
        name: torch.stack([getattr(frame, name) for frame in frames])
        for name in OUTPUTS
        if getattr(frames[0], name) is not None
    }
    dropped: Counter[str] = Counter()
    for frame in frames:
        dropped.update(frame.dropped_by_parameter)
    return RenderOutput(
        **images, dropped_nonfinite=dropped.total(), dropped_by_parameter=dict(dropped)
    )
