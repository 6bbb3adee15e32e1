"""A HexPlane field as numbers to be learned; its planes span what moves."""

from collections.abc import Mapping
from dataclasses import replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.fitting.parameter_table import ParameterTable
from diff4splat.fitting.settings import LearningRates, LossWeights
from diff4splat.scene.motion.hexplane.decoder import DecoderSize, make_decoder
from diff4splat.scene.motion.hexplane.motion import HexPlaneMotion
from diff4splat.scene.motion.hexplane.planes import HexPlaneSize, make_planes
from diff4splat.scene.motion.hexplane.regularisers import penalties


class HexPlaneField:
    """Planes and decoder; nothing per Gaussian."""

    def __init__(
        self,
        size: tuple[HexPlaneSize, DecoderSize],
        bounds: Float[Tensor, "2 3"],
        time_range_s: tuple[float, float],
        seed: int,
    ) -> None:
        """A field in the dtype of ``bounds``."""
        generator = torch.Generator().manual_seed(seed)
        planes = make_planes(size[0], bounds, time_range_s, generator)
        decoder = make_decoder(planes.feature_count, size[1], generator)
        self._start = HexPlaneMotion(
            planes=replace(planes.to(bounds.dtype), bounds=bounds),
            decoder=decoder.to(bounds.dtype),
            moving_index=torch.zeros(0, dtype=torch.long),
        )
        self._names = tuple(self._start.tensors())

    def columns(self, count: int) -> Mapping[str, Tensor]:
        """None."""
        del count
        return {}

    def shared(self) -> Mapping[str, Tensor]:
        """Planes and decoder layers, named as in ``HexPlaneMotion``."""
        return self._start.tensors()

    def motion(
        self, table: ParameterTable, moving_index: Int[Tensor, " m"], degree: int
    ) -> HexPlaneMotion:
        """The current field."""
        del degree
        field = self._start.with_tensors({name: table[name] for name in self._names})
        return replace(field, moving_index=moving_index)

    def rates(self, rates: LearningRates, extent: float, progress: float) -> Mapping[str, float]:
        """Planes learn faster than layers; offset output scales with the extent."""
        planes, decoder = rates.planes.at(progress), rates.decoder.at(progress)
        rates_of = {n: planes if n.startswith("planes") else decoder for n in self._names}
        offsets = {n: decoder * extent for n in self._names if n.startswith("position.1")}
        return rates_of | offsets

    def penalty(self, table: ParameterTable, weights: LossWeights) -> Tensor | None:
        """Smoothness of the planes, and time planes close to 1."""
        planes = self._start.with_tensors({name: table[name] for name in self._names}).planes
        terms = penalties(planes)
        return (
            weights.smooth_space * terms.space
            + weights.smooth_time * terms.time
            + weights.time_planes * terms.static
        )

    def split_in_time(
        self, rows: Mapping[str, Tensor], selected: Tensor, generator: torch.Generator
    ) -> None:
        """None: there are no per-Gaussian times."""
        del rows, selected, generator
