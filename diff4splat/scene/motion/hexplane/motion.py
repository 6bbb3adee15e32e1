"""HexPlane motion: a field of space and time that moves, turns and stretches Gaussians.

Axes: ``n`` Gaussians, ``m`` moving Gaussians. Features come from six planes at the canonical mean
and the time, residuals from a small network, and residuals are added before the activations
(4D Gaussians, Wu et al., CVPR 2024, arXiv 2310.08528).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Literal

import torch
from jaxtyping import Bool, Int
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.hexplane import residuals
from diff4splat.scene.motion.hexplane.decoder import Layer, MotionDecoder
from diff4splat.scene.motion.hexplane.planes import PLANE_NAMES, HexPlanes
from diff4splat.scene.motion.times import require_time_s

_CHANGED_BY = {
    "means": "position",
    "quats": "rotation",
    "scales": "scale",
    "opacities": "opacity",
    "sh": "color",
}
"""Which head changes which part of a Gaussian."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HexPlaneMotion:
    """Deformation of the Gaussians at ``moving_index`` by a field; all others are static."""

    planes: HexPlanes
    decoder: MotionDecoder
    moving_index: Int[Tensor, " m"]
    rotation: Literal["product", "additive"] = "product"
    """``product`` turns the canonical rotation; ``additive`` is what 4DGaussians does."""

    def __post_init__(self) -> None:
        wanted = self.decoder.trunk[0].weight.shape[1]
        if wanted != self.planes.feature_count:
            raise ShapeError(
                f"HexPlaneMotion: expected a decoder of {self.planes.feature_count} features "
                f"(levels times channels), got one of {wanted}"
            )
        if bool((self.moving_index.diff() <= 0).any()):
            raise ShapeError(
                "HexPlaneMotion.moving_index: expected indices that strictly increase, got repeats "
                "or another order"
            )

    @property
    def time_range_s(self) -> tuple[float, float]:
        """The times that the planes span; the motion is constant outside."""
        return self.planes.time_range_s

    def state_at(self, gaussians: Gaussians, time_s: float) -> Gaussians:
        """The Gaussians at ``time_s``; static ones are passed through untouched."""
        require_time_s(time_s)
        return self.states_at(gaussians, (time_s,))[0]

    def states_at(self, gaussians: Gaussians, times_s: Sequence[float]) -> list[Gaussians]:
        """The Gaussians at several times, for less than one call per time."""
        for time_s in times_s:
            require_time_s(time_s)
        if len(self.moving_index) == 0:
            return [gaussians for _ in times_s]
        whole = len(self.moving_index) == len(gaussians)
        moving = gaussians if whole else gaussians.select(self.moving_index)
        features = self.planes.features_at_times(moving.means, times_s)
        predicted = self.decoder.residuals(features)
        at_times = [
            {name: rows[k] for name, rows in predicted.items()} for k in range(len(times_s))
        ]
        moved = [residuals.apply(moving, one, self.rotation) for one in at_times]
        return [self._placed(gaussians, state, predicted) for state in moved]

    def select(self, keep: Bool[Tensor, " n"]) -> "HexPlaneMotion":
        """Keep the moving Gaussians where ``keep`` is true, with indices into the smaller set."""
        survives = keep[self.moving_index]
        new_index = keep.long().cumsum(0)[self.moving_index[survives]] - 1
        return replace(self, moving_index=new_index)

    def to(self, target: torch.device | torch.dtype) -> "HexPlaneMotion":
        """Move or cast the field; a dtype leaves the index as it is."""
        index = self.moving_index
        if not isinstance(target, torch.dtype):
            index = index.to(target)
        planes, decoder = self.planes.to(target), self.decoder.to(target)
        return replace(self, planes=planes, decoder=decoder, moving_index=index)

    def tensors(self) -> dict[str, Tensor]:
        """What can be learned, by name: ``planes.0.xy``, ``trunk.0.weight``, ``scale.1.bias``."""
        named = {}
        for number, level in enumerate(self.planes.levels):
            for name, plane in zip(PLANE_NAMES, level, strict=True):
                named[f"planes.{number}.{name}"] = plane
        for group, layers in self._layers().items():
            for number, layer in enumerate(layers):
                named[f"{group}.{number}.weight"] = layer.weight
                named[f"{group}.{number}.bias"] = layer.bias
        return named

    def with_tensors(self, tensors: Mapping[str, Tensor]) -> "HexPlaneMotion":
        """The same motion with other tensors under the names that ``tensors`` gives.

        Raises:
            ShapeError: a name is missing or unknown, or a shape does not fit.
        """
        differing = sorted(self.tensors().keys() ^ tensors.keys())
        if differing:
            raise ShapeError(f"HexPlaneMotion.with_tensors: expected equal names, got {differing}")
        layers = {
            group: tuple(
                Layer(weight=tensors[f"{group}.{k}.weight"], bias=tensors[f"{group}.{k}.bias"])
                for k in range(len(old))
            )
            for group, old in self._layers().items()
        }
        levels = tuple(
            tuple(tensors[f"planes.{k}.{name}"] for name in PLANE_NAMES)
            for k in range(len(self.planes.levels))
        )
        decoder = MotionDecoder(trunk=layers.pop("trunk"), heads=layers)
        return replace(self, planes=replace(self.planes, levels=levels), decoder=decoder)

    def _layers(self) -> dict[str, tuple[Layer, ...]]:
        return {"trunk": self.decoder.trunk, **self.decoder.heads}

    def _placed(
        self, gaussians: Gaussians, moved: Gaussians, predicted: Mapping[str, Tensor]
    ) -> Gaussians:
        """``moved`` back among the static ones."""
        changed = {}
        for field in fields(gaussians):
            before, after = getattr(gaussians, field.name), getattr(moved, field.name)
            if _CHANGED_BY[field.name] in predicted:
                whole = len(self.moving_index) == len(gaussians)
                index = self.moving_index
                changed[field.name] = after if whole else before.index_copy(0, index, after)
        return replace(gaussians, **changed)
