"""Learnable camera parameters, each as raw values that start at 0.

A duration or length is its initial value times exp(raw). A lens is its initial coefficients plus
displacement modes of one pixel each (``coefficients``). Every parameter clamps its raw values to a
range in which images can be rendered.
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

MAX_FACTOR = 20.0
"""Largest factor between initial and current value, in both directions."""
MIN_VISIBLE_SHARE = 0.9
"""Share of the initially visible grid points that a lens must keep visible."""


@runtime_checkable
class LearnedPart(Protocol):
    """One learned camera parameter."""

    def start(self) -> Tensor:
        """Initial raw values."""
        ...

    def apply(self, model: CameraModel, raw: Tensor) -> CameraModel:
        """The cameras with the value of ``raw``; differentiable."""
        ...

    def clamped(self, raw: Tensor) -> Tensor | None:
        """The nearest valid raw values; None if there are none."""
        ...

    def value(self, raw: Tensor) -> float | list[float]:
        """The value of ``raw`` in the unit of the parameter."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedFactor:
    """A positive number, learned as the logarithm of a factor."""

    initial: float
    set: Callable[[CameraModel, Tensor], CameraModel]

    def start(self) -> Float[Tensor, ""]:
        """The initial value."""
        return torch.zeros(())

    def apply(self, model: CameraModel, raw: Tensor) -> CameraModel:
        """The cameras with the scaled value."""
        return self.set(model, self.initial * raw.double().exp())

    def clamped(self, raw: Tensor) -> Tensor:
        """Within ``MAX_FACTOR``."""
        limit = math.log(MAX_FACTOR)
        return raw.clamp(-limit, limit)

    def value(self, raw: Tensor) -> float:
        """In scene units or seconds, or as a factor of focal lengths."""
        return self.initial * math.exp(float(raw))


class LearnedLens:
    """Coefficients of a lens, learned as displacement modes."""

    def __init__(self, capture: Capture) -> None:
        self._lens, self._camera = capture.optics.lens, capture.cameras[int(capture.learnt[0])]
        self._modes = coefficients.displacement_modes(self._lens, self._camera)
        self._values = coefficients.coefficient_vector(self._lens).detach()
        self._visible = self._visible_points(self._lens)

    def start(self) -> Float[Tensor, " m"]:
        """No displacement."""
        return torch.zeros(self._modes.shape[1])

    def apply(self, model: CameraModel, raw: Tensor) -> CameraModel:
        """The displaced lens."""
        lens = coefficients.with_coefficients(self._lens, self._at(raw))
        return replace(model, optics=replace(model.optics, lens=lens))

    def clamped(self, raw: Tensor) -> Tensor | None:
        """None for a lens that folds back within the image."""
        try:
            lens = coefficients.with_coefficients(self._lens, self._at(raw))
        except InputError:
            return None
        return raw if self._visible_points(lens) >= MIN_VISIBLE_SHARE * self._visible else None

    def value(self, raw: Tensor) -> list[float]:
        """Coefficients in the order of the lens's fields."""
        return self._at(raw).tolist()

    def _at(self, raw: Tensor) -> Tensor:
        return self._values + self._modes @ raw.double()

    def _visible_points(self, lens) -> int:
        """Number of grid points that the lens maps to a direction."""
        return int(
            lens.to(torch.float64).directions(coefficients.image_plane_grid(self._camera))[1].sum()
        )


def make_part(name: str, capture: Capture) -> LearnedPart:
    """The parameter ``name`` of ``--learn``, initialised from the capture.

    Raises:
        ConfigError: the capture has no initial value for it.
    """
    optics = capture.optics if capture.optics is not None else Optics()
    if name == "focal":
        return LearnedFactor(initial=1.0, set=_with_focal)
    if name == "lens":
        if not coefficients.learnable_indices(optics.lens):
            raise _missing(name, "a lens with coefficients", type(optics.lens).__name__)
        return LearnedLens(capture)
    if name == "readout":
        if optics.shutter is None or not float(optics.shutter.readout_s) > 0:
            raise _missing(name, "a shutter with a read-out above 0", "none")
        return LearnedFactor(initial=float(optics.shutter.readout_s), set=_with_readout)
    if optics.aperture is None or not float(optics.aperture.radius) > 0:
        raise _missing(name, "an aperture with a radius above 0", "none")
    if name == "focus":
        return LearnedFactor(initial=float(optics.aperture.focus_distance), set=_with_focus)
    return LearnedFactor(initial=float(optics.aperture.radius), set=_with_radius)


def _missing(name: str, expected: str, got: str) -> ConfigError:
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
