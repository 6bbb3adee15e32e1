"""Learned camera parameters in the parameter table of the scene."""

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.fitting.optics.camera_model import CameraModel, camera_model_of
from diff4splat.fitting.optics.parts import LearnedPart, make_part
from diff4splat.fitting.parameter_table import ParameterTable
from diff4splat.fitting.settings import LearningRates

_PREFIX = "camera_"


class LearnedOptics:
    """The learned camera parameters of a capture; may be empty."""

    def __init__(self, capture: Capture, names: Sequence[str] = ()) -> None:
        """``names`` are the parameters to learn.

        Raises:
            ConfigError: the capture has no initial value for one of them.
        """
        self._initial = camera_model_of(capture)
        self._parts: dict[str, LearnedPart] = {name: make_part(name, capture) for name in names}
        self._last_valid: dict[str, Tensor] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the tensors in the table."""
        return tuple(_PREFIX + name for name in self._parts)

    def shared(self, before: ParameterTable | None = None) -> dict[str, Tensor]:
        """Initial raw parameters, from the table of an earlier stage or from the capture."""
        if before is not None:
            return {name: before[name].detach() for name in self.names}
        return {_PREFIX + name: part.start() for name, part in self._parts.items()}

    def model(self, table: ParameterTable, learning: bool = True) -> CameraModel:
        """The current cameras, with gradients only if ``learning``."""
        model = self._initial
        for name, part in self._parts.items():
            raw = table[_PREFIX + name]
            model = part.apply(model, raw if learning else raw.detach())
        return model

    def rates(self, rates: LearningRates, progress: float) -> dict[str, float]:
        """Learning rate of every parameter."""
        return {_PREFIX + name: getattr(rates, name).at(progress) for name in self._parts}

    @torch.no_grad()
    def clamp(self, table: ParameterTable) -> None:
        """Clamp parameters; an invalid one returns to its last valid value, without moments."""
        for name, part in self._parts.items():
            key, raw = _PREFIX + name, table[_PREFIX + name]
            last = self._last_valid.get(key, torch.zeros_like(raw))
            if torch.equal(raw, last):
                continue
            clamped = part.clamped(raw) if bool(torch.isfinite(raw).all()) else None
            if clamped is None:
                table.rewrite_shared(key, last)
            else:
                raw.copy_(clamped)
            self._last_valid[key] = raw.detach().clone()

    def resume(self, tensors: Mapping[str, Tensor]) -> None:
        """Take the parameters of a checkpoint as valid."""
        self._last_valid = {name: tensors[name].clone() for name in self.names}

    def report(self, table: ParameterTable) -> dict[str, dict[str, object]]:
        """Initial and current value of every parameter, in its unit."""
        return {
            name: {
                "start": part.value(part.start()),
                "recovered": part.value(table[_PREFIX + name].detach()),
            }
            for name, part in self._parts.items()
        }
