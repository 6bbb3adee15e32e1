"""The moving Gaussians of a scene, evaluated at a time and projected.

Key frames are projected by a kernel that evaluates them on the way. Any other motion is asked for
its state, and the rows that move are copied.
"""

from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from diff4splat.render.raster.forward import list_visible
from diff4splat.render.raster.projection.keyframes import keys_of, moment_at, project_keyframed
from diff4splat.render.raster.projection.project import project
from diff4splat.render.raster.raster_settings import RasterSettings
from diff4splat.render.raster.tables import (
    Cloud,
    Doubles,
    Floats,
    Integers,
    ProjectionInputs,
    ProjectionOutputs,
    View,
)
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.scene import Scene


class Moving:
    """Arrays of a scene whose moving rows follow the clock."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._keys = keys_of(scene.motion) if isinstance(scene.motion, KeyframeMotion) else None
        *points, self.sh = _arrays(scene.gaussians)
        self._canonical = Cloud(*points)
        # Key frames write moved means only; other motions write whole rows.
        copied = 1 if self._keys else 4
        self.cloud = Cloud(*(a.copy() if i < copied else a for i, a in enumerate(points)))
        if self._keys is None:
            self.sh = self.sh.copy()
        self.index: Integers = scene.motion.moving_index.detach().int().cpu().numpy()

    @property
    def recolors(self) -> bool:
        """Whether the motion may change harmonics."""
        return self._keys is None and len(self.index) > 0

    def project(
        self,
        plan: RasterSettings,
        view: View,
        time_s: float,
        prints: Doubles,
        depth: Floats,
        unusable: NDArray[np.int64],
    ) -> Integers:
        """Footprints at ``time_s``; returns the visible indices and adds to ``unusable``."""
        if len(self.index) == 0:
            return self.index
        numbers = self.sh.reshape(len(self.sh), self.sh.shape[1] * 3)
        if self._keys is not None:
            moment = moment_at(self._scene.motion, time_s)
            inputs = ProjectionInputs(self._canonical, numbers, view, plan.rules)

            def work(first: int, last: int, visible: Integers, faults: NDArray[np.int64]) -> int:
                outputs = ProjectionOutputs(prints, depth, visible, faults)
                means = self.cloud.means
                return project_keyframed(first, last, self._keys, moment, means, inputs, outputs)
        else:
            self._copy_state(self._scene.state_at(time_s))
            inputs = ProjectionInputs(self.cloud, numbers, view, plan.rules)

            def work(first: int, last: int, visible: Integers, faults: NDArray[np.int64]) -> int:
                outputs = ProjectionOutputs(prints, depth, visible, faults)
                return project(first, last, self.index, inputs, outputs)

        return list_visible(len(self.index), work, unusable)

    def _copy_state(self, state: Gaussians) -> None:
        for mine, theirs in zip((*self.cloud, self.sh), _arrays(state), strict=True):
            mine[self.index] = theirs[self.index]


def _arrays(gaussians: Gaussians) -> list[np.ndarray]:
    return [getattr(gaussians, f.name).detach().contiguous().numpy() for f in fields(gaussians)]
