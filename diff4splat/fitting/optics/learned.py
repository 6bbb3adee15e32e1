"""The camera among the numbers of a fit: its parts lie in the table of the scene."""

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.fitting.optics.camera_model import CameraModel, model_of
from diff4splat.fitting.optics.parts import Part, make
from diff4splat.fitting.parameter_table import ParameterTable
from diff4splat.fitting.settings import Rates

_PREFIX = "camera_"


class LearnedOptics:
    """What is learned of the cameras of a capture; nothing, where nobody asks for it."""

    def __init__(self, capture: Capture, names: Sequence[str] = ()) -> None:
        """Raises ConfigError where the capture does not say what to start from."""
        self._given = model_of(capture)
        self._parts: dict[str, Part] = {name: make(name, capture) for name in names}
        self._sound: dict[str, Tensor] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """Of the tensors in the table."""
        return tuple(_PREFIX + name for name in self._parts)

    def shared(self, before: ParameterTable | None = None) -> dict[str, Tensor]:
        """Raw numbers to set out with: those of an earlier stage, or of the capture."""
        if before is not None:
            return {name: before[name].detach() for name in self.names}
        return {_PREFIX + name: part.start() for name, part in self._parts.items()}

    def model(self, table: ParameterTable, learning: bool = True) -> CameraModel:
        """The camera as it is now; without gradients unless it is ``learning``."""
        model = self._given
        for name, part in self._parts.items():
            raw = table[_PREFIX + name]
            model = part.put(model, raw if learning else raw.detach())
        return model

    def rates(self, rates: Rates, progress: float) -> dict[str, float]:
        """The learning rate of every part."""
        return {_PREFIX + name: getattr(rates, name).at(progress) for name in self._parts}

    @torch.no_grad()
    def bound(self, table: ParameterTable) -> None:
        """Keep parts sound; one that is not goes back to where it last was, and starts anew."""
        for name, part in self._parts.items():
            key, raw = _PREFIX + name, table[_PREFIX + name]
            last = self._sound.get(key, torch.zeros_like(raw))
            if torch.equal(raw, last):
                continue
            kept = part.bounded(raw) if bool(torch.isfinite(raw).all()) else None
            if kept is None:
                table.rewrite_shared(key, last)
            else:
                raw.copy_(kept)
            self._sound[key] = raw.detach().clone()

    def resumed(self, tensors: Mapping[str, Tensor]) -> None:
        """Parts were sound when they were saved."""
        self._sound = {name: tensors[name].clone() for name in self.names}

    def facts(self, table: ParameterTable) -> dict[str, dict[str, object]]:
        """Start and present value of every part, in its own unit."""
        return {
            name: {
                "start": part.told(part.start()),
                "recovered": part.told(table[_PREFIX + name].detach()),
            }
            for name, part in self._parts.items()
        }
