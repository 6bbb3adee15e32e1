"""Predictions of a system or a baseline: images, depth and scene flow.

Axes: ``h w`` pixels, ``n`` tracked points, ``t`` times. Scene flow of a scene: the offsets of the
Gaussians from the source time to a later time are alpha-blended like a colour at the source time,
and divided by alpha. A pixel thus moves with its visible surface. Pixels with almost no alpha are
static.
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

MIN_COVERAGE = 0.05
"""Alpha below which a pixel is static."""
LEAST_SOLID, FAINT_WEIGHT = 0.6, 1e-3
"""Opacity of a Gaussian of a surface (shadows have at most 0.55), and the weight of others."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderedView:
    """Image and depth of one camera."""

    rgb: Float[Tensor, "h w 3"]
    depth: Float[Tensor, "h w"] | None
    """z; None if the system predicts no depth."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PointQuery:
    """Pixels of one image whose surface is tracked."""

    camera: Camera
    source_s: float
    cells: Int[Tensor, "n 2"]
    """(row, column)"""
    times_s: tuple[float, ...]


@runtime_checkable
class Prediction(Interface):
    """The output of a system; None for what it does not predict."""

    def render(self, camera: Camera, time_s: float, frame: int) -> RenderedView | None:
        """The image at a target camera, its time, and the frame of that time."""
        ...

    def offsets(self, query: PointQuery) -> Float[Tensor, "t n 3"] | None:
        """World-space offsets of the points from the source time to each time."""
        ...

    @property
    def scene(self) -> Scene | None:
        """The scene, if the system predicts one."""
        ...


@dataclass(frozen=True, slots=True)
class ScenePrediction:
    """A 4D scene."""

    scene: Scene

    def render(self, camera: Camera, time_s: float, frame: int) -> RenderedView:
        """Rendered colour and expected depth."""
        del frame
        rendered = render(self.scene, camera, time_s, outputs=("rgb", "depth"))
        return RenderedView(rgb=rendered.rgb.clamp(0, 1), depth=rendered.depth)

    def offsets(self, query: PointQuery) -> Float[Tensor, "t n 3"]:
        """Scene flow at the cells."""
        flow = scene_flow(self.scene, query.camera, query.source_s, query.times_s)
        rows, columns = query.cells.unbind(-1)
        return flow[:, rows, columns]


def scene_flow(
    scene: Scene, camera: Camera, source_s: float, times_s: tuple[float, ...]
) -> Float[Tensor, "t h w 3"]:
    """World-space displacement of the surface at every pixel, from the source time.

    What is less opaque than ``LEAST_SOLID`` hardly counts before a surface: a shadow that slides
    over the ground does not move it.
    """
    height, width = camera.size_px
    if isinstance(scene.motion, StaticMotion) or not times_s:
        return torch.zeros(len(times_s), height, width, 3)
    start = scene.state_at(source_s)
    offsets = [scene.state_at(time_s).means - start.means for time_s in times_s]
    weight = torch.where(start.opacities < LEAST_SOLID, FAINT_WEIGHT, 1.0)[:, None]
    features = torch.cat([torch.cat(offsets, -1) * weight, weight], -1)
    settings = RenderSettings(features=features, dilation_px2=scene.dilation_px2)
    rendered = render(start, camera, outputs=("features", "alpha"), settings=settings)
    is_covered = (rendered.alpha > MIN_COVERAGE)[..., None]
    found, share = rendered.features[..., :-1], rendered.features[..., -1:]
    flow = torch.where(is_covered, found / torch.where(is_covered, share, 1.0), 0.0)
    return flow.unflatten(-1, (len(times_s), 3)).movedim(2, 0)
