"""Parts of a camera that can be learned, each as raw numbers that start at 0.

A length of time or space is its start times exp(raw); a lens is its start plus modes of a pixel
each (``coefficients``). Every part keeps its raw numbers where pictures can still be taken.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.errors import ConfigError, InputError
from diff4splat.fitting.optics import coefficients
from diff4splat.fitting.optics.camera_model import CameraModel
from diff4splat.geometry.optics import Optics

MOST_FACTOR = 20.0
"""From the start, in both directions."""
LEAST_SEEN = 0.9
"""Share of the places seen at the start that a lens must go on to see."""


@runtime_checkable
class Part(Protocol):
    """One thing that is learned."""

    def start(self) -> Tensor:
        """Raw numbers of what the capture says."""
        ...

    def put(self, model: CameraModel, raw: Tensor) -> CameraModel:
        """The camera with this part as ``raw`` says; differentiable."""
        ...

    def bounded(self, raw: Tensor) -> Tensor | None:
        """``raw`` as near as is sound; None where there is no such thing."""
        ...

    def told(self, raw: Tensor) -> float | list[float]:
        """In its own unit."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Factor:
    """A positive number, learned as the logarithm of a factor."""

    value: float
    set: Callable[[CameraModel, Tensor], CameraModel]

    def start(self) -> Float[Tensor, ""]:
        """The value itself."""
        return torch.zeros(())

    def put(self, model: CameraModel, raw: Tensor) -> CameraModel:
        """The changed value."""
        return self.set(model, self.value * raw.double().exp())

    def bounded(self, raw: Tensor) -> Tensor:
        """Within ``MOST_FACTOR``."""
        limit = math.log(MOST_FACTOR)
        return raw.clamp(-limit, limit)

    def told(self, raw: Tensor) -> float:
        """Scene units, seconds, or a factor of focal lengths."""
        return self.value * math.exp(float(raw))


class LensPart:
    """Coefficients of a lens."""

    def __init__(self, capture: Capture) -> None:
        self._lens, self._camera = capture.optics.lens, capture.cameras[int(capture.learnt[0])]
        self._modes = coefficients.modes(self._lens, self._camera)
        self._values = coefficients.taken(self._lens).detach()
        self._seen = self._count(self._lens)

    def start(self) -> Float[Tensor, " m"]:
        """No displacement."""
        return torch.zeros(self._modes.shape[1])

    def put(self, model: CameraModel, raw: Tensor) -> CameraModel:
        """The displaced lens."""
        lens = coefficients.placed(self._lens, self._at(raw))
        return replace(model, optics=replace(model.optics, lens=lens))

    def bounded(self, raw: Tensor) -> Tensor | None:
        """None for a lens that folds back within the picture."""
        try:
            lens = coefficients.placed(self._lens, self._at(raw))
        except InputError:
            return None
        return raw if self._count(lens) >= LEAST_SEEN * self._seen else None

    def told(self, raw: Tensor) -> list[float]:
        """Coefficients in the order of the lens's fields."""
        return self._at(raw).tolist()

    def _at(self, raw: Tensor) -> Tensor:
        return self._values + self._modes @ raw.double()

    def _count(self, lens) -> int:
        """Places of the picture that the lens sees."""
        return int(lens.to(torch.float64).directions(coefficients.grid(self._camera))[1].sum())


def make(name: str, capture: Capture) -> Part:
    """The part that ``--learn`` calls ``name``, starting from what the capture says.

    Raises:
        ConfigError: the capture says nothing of it.
    """
    optics = capture.optics if capture.optics is not None else Optics()
    if name == "focal":
        return Factor(value=1.0, set=_with_focal)
    if name == "lens":
        if not coefficients.learnable(optics.lens):
            raise _refused(name, "a lens with coefficients", type(optics.lens).__name__)
        return LensPart(capture)
    if name == "readout":
        if optics.shutter is None or not float(optics.shutter.readout_s) > 0:
            raise _refused(name, "a shutter with a read-out above 0", "none")
        return Factor(value=float(optics.shutter.readout_s), set=_with_readout)
    if optics.aperture is None or not float(optics.aperture.radius) > 0:
        raise _refused(name, "an aperture with a radius above 0", "none")
    if name == "focus":
        return Factor(value=float(optics.aperture.focus_distance), set=_with_focus)
    return Factor(value=float(optics.aperture.radius), set=_with_radius)


def _refused(name: str, expected: str, got: str) -> ConfigError:
    return ConfigError(
        f"--learn {name}: expected {expected} in the optics of the data, got {got}; write a first "
        "guess there"
    )


def _with_focal(model: CameraModel, value: Tensor) -> CameraModel:
    return replace(model, focal_factor=value)


def _with_focus(model: CameraModel, value: Tensor) -> CameraModel:
    aperture = replace(model.optics.aperture, focus_distance=value)
    return replace(model, optics=replace(model.optics, aperture=aperture))


def _with_radius(model: CameraModel, value: Tensor) -> CameraModel:
    aperture = replace(model.optics.aperture, radius=value)
    return replace(model, optics=replace(model.optics, aperture=aperture))


def _with_readout(model: CameraModel, value: Tensor) -> CameraModel:
    shutter = replace(model.optics.shutter, readout_s=value)
    return replace(model, optics=replace(model.optics, shutter=shutter))
