"""A scene while it is learned: the table of numbers, its motion, and who takes part in the motion.

Axes: ``n`` Gaussians.
"""

from collections.abc import Mapping

import torch
from jaxtyping import Bool, Int
from torch import Tensor

from diff4splat.fitting.canonical import COLUMNS, activated, bound
from diff4splat.fitting.motions.protocol import LearnedMotion
from diff4splat.fitting.optics.camera_model import CameraModel
from diff4splat.fitting.optics.learned import LearnedOptics
from diff4splat.fitting.parameter_table import ParameterTable
from diff4splat.fitting.settings import Rates
from diff4splat.paths.camera_path import CameraPath
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.scene import Provenance, Scene

UNFINISHED = Provenance(generator="diff4splat fit")


class SceneModel:
    """Gaussians and a motion; ``moves`` says whom the motion carries."""

    def __init__(
        self,
        rows: Mapping[str, Tensor],
        motion: LearnedMotion,
        moves: Bool[Tensor, " n"],
        optics: LearnedOptics | None = None,
        before: ParameterTable | None = None,
    ) -> None:
        """``rows`` are canonical numbers; columns of the motion that they lack get its start.

        The cameras of ``optics`` set out as an earlier stage left them in the table ``before``.
        """
        count = len(moves)
        columns = {**motion.columns(count), **rows}
        wanted = (*COLUMNS, *motion.columns(0))
        shared = dict(motion.shared()) | ({} if optics is None else optics.shared(before))
        self.table = ParameterTable({name: columns[name] for name in wanted}, shared)
        self.learned, self.moves, self.optics = motion, moves, optics

    def __len__(self) -> int:
        return len(self.table)

    @property
    def moving_index(self) -> Int[Tensor, " m"]:
        """Of the Gaussians that the motion carries."""
        return self.moves.nonzero().flatten()

    def motion(self, degree: int) -> Motion:
        """The motion as it is now; differentiable."""
        return self.learned.motion(self.table, self.moving_index, degree)

    def canonical(self, degree: int) -> Gaussians:
        """The Gaussians without motion; differentiable."""
        return activated(self.table, degree)

    def state_at(self, time_s: float, degree: int) -> Gaussians:
        """The Gaussians at a time; differentiable."""
        return self.motion(degree).state_at(self.canonical(degree), time_s)

    def scene(self, degree: int, path: CameraPath) -> Scene:
        """Gaussians and motion in one, along any path; differentiable."""
        return Scene(
            gaussians=self.canonical(degree),
            motion=self.motion(degree),
            path=path,
            provenance=UNFINISHED,
        )

    def cameras(self, learning: bool) -> CameraModel | None:
        """The cameras as they are now; None is what the capture says."""
        return None if self.optics is None else self.optics.model(self.table, learning)

    def bound(self) -> None:
        """Pull numbers back to where values and gradients are finite."""
        bound(self.table)
        if self.optics is not None:
            self.optics.bound(self.table)

    def rates(self, rates: Rates, extent: float, progress: float) -> dict[str, float]:
        """The learning rate of every tensor."""
        found = {name: getattr(rates, name).at(progress) for name in COLUMNS}
        found["means"] *= extent
        own = {} if self.optics is None else self.optics.rates(rates, progress)
        return found | dict(self.learned.rates(rates, extent, progress)) | own

    def keep(self, kept: Bool[Tensor, " n"]) -> None:
        """Drop all other Gaussians."""
        self.table.keep(kept)
        self.moves = self.moves[kept]

    def append(self, rows: Mapping[str, Tensor], moves: Bool[Tensor, " m"]) -> None:
        """Add Gaussians."""
        self.table.append(rows)
        self.moves = torch.cat([self.moves, moves])

    def rows(self, index: Int[Tensor, " m"]) -> dict[str, Tensor]:
        """All numbers of some Gaussians, detached."""
        return {name: self.table[name].detach()[index] for name in self.table.columns}
