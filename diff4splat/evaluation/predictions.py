"""What a system under test, or a baseline, answers with: pictures, depth, and where points go.

Axes: ``h w`` pixels, ``n`` followed points, ``t`` times. Scene flow of a scene: the offset of every
Gaussian from the source time to a later one is blended like a colour at the source time and divided
by the coverage, so a pixel moves as the surface does that it shows. Cells that show (almost)
nothing stand still.
"""

from dataclasses import dataclass
from typing import Protocol as Interface
from typing import runtime_checkable

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

LEAST_COVERAGE = 0.05
"""Below it a pixel shows nothing that could move."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """What one camera sees."""

    rgb: Float[Tensor, "h w 3"]
    depth: Float[Tensor, "h w"] | None
    """z; None where a system has no idea of depth."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PointQuery:
    """Pixels of one picture whose surface is followed."""

    camera: Camera
    source_s: float
    cells: Int[Tensor, "n 2"]
    """(row, column)"""
    times_s: tuple[float, ...]


@runtime_checkable
class Answer(Interface):
    """How anything that is judged answers; None for what it cannot."""

    def look(self, camera: Camera, time_s: float, frame: int) -> Look | None:
        """A judged picture: its camera, its time, and the frame of that time."""
        ...

    def offsets(self, query: PointQuery) -> Float[Tensor, "t n 3"] | None:
        """World-space offsets of the points from the source time to each time."""
        ...

    @property
    def scene(self) -> Scene | None:
        """The scene, if there is one."""
        ...


@dataclass(frozen=True, slots=True)
class SceneAnswer:
    """A 4D scene."""

    scene: Scene

    def look(self, camera: Camera, time_s: float, frame: int) -> Look:
        """Rendered colour and expected depth."""
        del frame
        seen = render(self.scene, camera, time_s, outputs=("rgb", "depth"))
        return Look(rgb=seen.rgb.clamp(0, 1), depth=seen.depth)

    def offsets(self, query: PointQuery) -> Float[Tensor, "t n 3"]:
        """Scene flow at the cells."""
        flow = scene_flow(self.scene, query.camera, query.source_s, query.times_s)
        rows, columns = query.cells.unbind(-1)
        return flow[:, rows, columns]


def scene_flow(
    scene: Scene, camera: Camera, source_s: float, times_s: tuple[float, ...]
) -> Float[Tensor, "t h w 3"]:
    """Where the surface behind every pixel goes, in world space."""
    height, width = camera.size_px
    if isinstance(scene.motion, StaticMotion) or not times_s:
        return torch.zeros(len(times_s), height, width, 3)
    start = scene.state_at(source_s)
    moved = [scene.state_at(time_s).means - start.means for time_s in times_s]
    settings = RenderSettings(features=torch.cat(moved, -1), dilation_px2=scene.dilation_px2)
    seen = render(start, camera, outputs=("features", "alpha"), settings=settings)
    covered = seen.alpha > LEAST_COVERAGE
    share = torch.where(covered, seen.alpha, 1.0)[..., None]
    flow = torch.where(covered[..., None], seen.features / share, 0.0)
    return flow.unflatten(-1, (len(times_s), 3)).movedim(2, 0)
