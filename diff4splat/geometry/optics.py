"""What a camera does beyond a pinhole: its lens, its aperture, its shutter and its exposure.

Lengths are scene units, times seconds. A thin lens of radius A that is focused at a distance f
shows a point at depth z as a disc of radius f_x A |1/f − 1/z| pixels. Line r of H is read out at

    t_r = t + (r / (H − 1) − ½) readout,    and sees    t_r + (ε − ½) exposure,  ε in [0, 1]

around the frame's time t, the middle of everything; with ``timestamp="start"`` both ½ are 0 and t
is when the first line begins.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import InputError
from diff4splat.geometry.lenses.pinhole import Pinhole
from diff4splat.geometry.lenses.protocol import Lens

Number = float | Float[Tensor, ""]
"""A tensor gets a gradient."""
Direction = Literal["top-to-bottom", "bottom-to-top", "left-to-right", "right-to-left"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Aperture:
    """A thin lens: rays of one pixel start all over a disc and meet where the camera focuses.

    Raises:
        InputError: a radius below 0, or a focus distance of 0 or less.
    """

    radius: Number
    focus_distance: Number
    surface: Literal["plane", "sphere"] = "plane"
    """What is in focus: a plane across the optical axis, as with real lenses, or a sphere."""

    def __post_init__(self) -> None:
        _require("Aperture.radius", self.radius, least=0.0)
        _require("Aperture.focus_distance", self.focus_distance, least=0.0, above=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Shutter:
    """Lines that are read out one after another; ``direction`` is the order of them.

    Raises:
        InputError: a read-out below 0.
    """

    readout_s: Number
    """From the first line to the last."""
    direction: Direction = "top-to-bottom"

    def __post_init__(self) -> None:
        _require("Shutter.readout_s", self.readout_s, least=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Optics:
    """Everything that distinguishes a physical camera from a pinhole; the default is a pinhole.

    Raises:
        InputError: an exposure below 0.
    """

    lens: Lens = field(default_factory=Pinhole)
    aperture: Aperture | None = None
    shutter: Shutter | None = None
    exposure_s: Number = 0.0
    timestamp: Literal["middle", "start"] = "middle"
    """What of the exposure of all lines the time of a frame is."""

    def __post_init__(self) -> None:
        _require("Optics.exposure_s", self.exposure_s, least=0.0)

    @property
    def duration_s(self) -> float:
        """From the first light on the first line to the last on the last."""
        readout = 0.0 if self.shutter is None else as_float(self.shutter.readout_s)
        return readout + as_float(self.exposure_s)

    def window_s(self, time_s: float) -> tuple[float, float]:
        """Earliest and latest time that a frame of ``time_s`` sees."""
        start = time_s - (self.duration_s / 2 if self.timestamp == "middle" else 0.0)
        return start, start + self.duration_s

    def to(self, target: torch.device | torch.dtype) -> "Optics":
        """Move or cast every tensor."""
        aperture, shutter = self.aperture, self.shutter
        if aperture is not None:
            aperture = replace(
                aperture,
                radius=_moved(aperture.radius, target),
                focus_distance=_moved(aperture.focus_distance, target),
            )
        if shutter is not None:
            shutter = replace(shutter, readout_s=_moved(shutter.readout_s, target))
        return replace(
            self,
            lens=self.lens.to(target),
            aperture=aperture,
            shutter=shutter,
            exposure_s=_moved(self.exposure_s, target),
        )


def require_frame_holds(optics: Optics, frame_s: float, what: str) -> None:
    """Refuse optics that are still busy with a frame when the next one begins.

    Raises:
        InputError: read-out and exposure together last longer than ``frame_s``.
    """
    if optics.duration_s > frame_s * (1 + 1e-6):
        raise InputError(
            f"{what}: expected read-out and exposure of at most {frame_s:.4g} s together, the time "
            f"from frame to frame, got {optics.duration_s:.4g} s; shorten one of them"
        )


def is_learned(number: Number) -> bool:
    """Whether a gradient is wanted."""
    return isinstance(number, Tensor) and number.requires_grad


def as_float(number: Number) -> float:
    """The value, without a gradient."""
    return float(number.detach()) if isinstance(number, Tensor) else float(number)


def _require(name: str, number: Number, least: float, above: bool = False) -> None:
    value = as_float(number)
    if not math.isfinite(value) or value < least or (above and value == least):
        bound = f"a finite number {'above' if above else 'of at least'} {least:g}"
        raise InputError(f"{name}: expected {bound}, got {value:g}")


def _moved(number: Number, target: torch.device | torch.dtype) -> Number:
    return number.to(target) if isinstance(number, Tensor) else number
