"""The optimised scene: parameter table, motion, optics and the mask of moving Gaussians.

Axes: ``n`` Gaussians, ``m`` moving Gaussians.
"""

from collections.abc import Mapping

import torch
from jaxtyping import Bool, Int
from torch import Tensor

from diff4splat.fitting.model.canonical import COLUMNS, activate, clamp_params
from diff4splat.fitting.motions.protocol import LearnedMotion
from diff4splat.fitting.optics.camera_model import CameraModel
from diff4splat.fitting.optics.learned import LearnedOptics
from diff4splat.fitting.parameter_table import ParameterTable
from diff4splat.fitting.settings import LearningRates
from diff4splat.paths.camera_path import CameraPath
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.scene import Provenance, Scene

UNFINISHED = Provenance(generator="diff4splat fit")


class SceneModel:
    """Gaussians with a learned motion; ``moving_mask`` marks those that the motion deforms."""

    def __init__(
        self,
        rows: Mapping[str, Tensor],
        motion: LearnedMotion,
        moving_mask: Bool[Tensor, " n"],
        optics: LearnedOptics | None = None,
        before: ParameterTable | None = None,
        dtype: torch.dtype = torch.float32,
    ) -> None:
        """Columns of the motion that ``rows`` lacks get their initial values.

        The parameters of ``optics`` continue from ``before``, the table of an earlier stage. All
        parameters become ``dtype``.
        """
        count = len(moving_mask)
        columns = {**motion.columns(count), **rows}
        names = (*COLUMNS, *motion.columns(0))
        shared = dict(motion.shared()) | ({} if optics is None else optics.shared(before))
        self.table = ParameterTable({name: columns[name] for name in names}, shared, dtype)
        self.learned_motion, self.moving_mask, self.optics = motion, moving_mask, optics

    def __len__(self) -> int:
        return len(self.table)

    @property
    def moving_index(self) -> Int[Tensor, " m"]:
        """Indices of the moving Gaussians."""
        return self.moving_mask.nonzero().flatten()

    def motion(self, degree: int) -> Motion:
        """The current motion; differentiable."""
        return self.learned_motion.motion(self.table, self.moving_index, degree)

    def canonical(self, degree: int) -> Gaussians:
        """The Gaussians without motion; differentiable."""
        return activate(self.table, degree)

    def state_at(self, time_s: float, degree: int) -> Gaussians:
        """The Gaussians at a time; differentiable."""
        return self.motion(degree).state_at(self.canonical(degree), time_s)

    def scene(self, degree: int, path: CameraPath) -> Scene:
        """Gaussians and motion as a scene; differentiable."""
        return Scene(
            gaussians=self.canonical(degree),
            motion=self.motion(degree),
            path=path,
            provenance=UNFINISHED,
        )

    def cameras(self, learning: bool) -> CameraModel | None:
        """The current cameras, with gradients if ``learning``; None means those of the capture."""
        return None if self.optics is None else self.optics.model(self.table, learning)

    def clamp_params(self) -> None:
        """Clamp parameters to the range with finite values and gradients."""
        clamp_params(self.table)
        if self.optics is not None:
            self.optics.clamp(self.table)

    def rates(self, rates: LearningRates, extent: float, progress: float) -> dict[str, float]:
        """Learning rate of every tensor after the share ``progress`` of the stage."""
        canonical = {name: getattr(rates, name).at(progress) for name in COLUMNS}
        canonical["means"] *= extent
        optics = {} if self.optics is None else self.optics.rates(rates, progress)
        return canonical | dict(self.learned_motion.rates(rates, extent, progress)) | optics

    def keep(self, mask: Bool[Tensor, " n"]) -> None:
        """Remove all Gaussians outside ``mask``."""
        self.table.keep(mask)
        self.moving_mask = self.moving_mask[mask]

    def append(self, rows: Mapping[str, Tensor], moving_mask: Bool[Tensor, " m"]) -> None:
        """Add Gaussians."""
        self.table.append(rows)
        self.moving_mask = torch.cat([self.moving_mask, moving_mask])

    def rows(self, index: Int[Tensor, " m"]) -> dict[str, Tensor]:
        """All parameters of some Gaussians, detached."""
        return {name: self.table[name].detach()[index] for name in self.table.columns}
