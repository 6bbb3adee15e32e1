"""Colours with which the render of the input view is the photograph, not a blur of it.

Neighbouring footprints overlap, so Gaussians that carry the pixels' colours render a softened
photograph (25 to 33 dB). Blending is linear in colour, and a Gaussian that still sits on its own
pixel of the input view is what that pixel shows most of, so Richardson iteration on the render
itself undoes the blur:

    colour_i += photograph_i − render_i          (3 steps: 30 to 44 dB on the same photographs,
                                                  more where pixels are smaller: docs/adr/0023)

Colours stay in [0, 1]: what sharpens the input view must not ring in other views.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.generation.input_image import InputImage
from diff4splat.geometry.camera import Camera, project
from diff4splat.geometry.rays import pixel_centers
from diff4splat.progress.run_log import RunLog
from diff4splat.render.api import DEFAULTS, render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import color_from_dc, dc_from_color
from diff4splat.scene.scene import Scene

OWN_CELL = 0.5
"""A Gaussian farther than this from the middle of its cell shows a neighbour."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InputGrid:
    """Where Gaussians lie in the grid of the input view."""

    picture: InputImage
    stride: int
    """Pixels per cell side."""
    cells: Int[Tensor, " n"]
    """Cell of every Gaussian, counted over frames, rows and columns; the input view comes first."""

    @property
    def camera(self) -> Camera:
        """The input view with one pixel per cell."""
        height, width = self.picture.camera.size_px
        return self.picture.camera.resized((height // self.stride, width // self.stride))


def match_input_view(scene: Scene, grid: InputGrid, steps: int, log: RunLog) -> Scene:
    """Correct the colours of the Gaussians that lie on their own cell of the input view."""
    first = scene.state_at(scene.motion.time_range_s[0])
    settings = RenderSettings(dilation_px2=scene.dilation_px2)
    if steps == 0 or not _on_their_cell(first.means, grid).any():
        return scene
    with log.phases.phase("match colours", steps) as advance:
        sh = matched_colors(first, grid, steps, advance, settings)
    return replace(scene, gaussians=replace(scene.gaussians, sh=sh))


@torch.no_grad()
def matched_colors(
    gaussians: Gaussians,
    grid: InputGrid,
    steps: int,
    advance: Callable[[], None] = lambda: None,
    settings: RenderSettings = DEFAULTS,
) -> Float[Tensor, "n c 3"]:
    """Harmonics with which ``gaussians``, as they are at the first moment, show the picture."""
    own = _on_their_cell(gaussians.means, grid).nonzero()[:, 0]
    for _ in range(steps):
        seen = render(gaussians, grid.picture.camera, settings=settings).rgb
        residual = _per_cell(grid.picture.rgb.to(seen) - seen, grid.stride)
        gaussians = _add_color(gaussians, own, residual[grid.cells[own]])
        advance()
    return gaussians.sh


def _on_their_cell(means: Float[Tensor, "n 3"], grid: InputGrid) -> Bool[Tensor, " n"]:
    camera = grid.camera
    centers = pixel_centers(camera.size_px, means).flatten(0, 1)
    in_view = grid.cells < len(centers)
    pixels, depth = project(camera, means)
    away = (pixels - centers[grid.cells.clamp_max(len(centers) - 1)]).abs().amax(-1)
    return in_view & (depth > 0) & (away < OWN_CELL)


def _per_cell(picture: Float[Tensor, "h w 3"], stride: int) -> Float[Tensor, "c 3"]:
    """Mean over the pixels of each cell."""
    means = torch.nn.functional.avg_pool2d(picture.movedim(-1, 0)[None], stride)[0]
    return means.flatten(1).mT


def _add_color(
    gaussians: Gaussians, own: Int[Tensor, " m"], change: Float[Tensor, "m 3"]
) -> Gaussians:
    sh = gaussians.sh.clone()
    sh[own, 0] = dc_from_color((color_from_dc(sh[own, 0]) + change).clamp(0, 1))
    return replace(gaussians, sh=sh)
