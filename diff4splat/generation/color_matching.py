"""Colours with which the render of the input view is the image, not a blur of it (ADR 5).

Neighbouring footprints overlap, so Gaussians that carry the pixels' colours render a softened image
(25 to 33 dB). Blending is linear in colour, and a Gaussian on its own pixel of the input view is
what that pixel shows most of. So iteration on the render itself undoes the blur:

    colour_i += step_i,    step = ρ step + σ (image − render)

The factors are those of the Chebyshev iteration for eigenvalues of the blur in [SMALLEST_SHARE, 1]
(Saad 2003, §12.3.2). Seven of its steps give what twelve plain ones do (σ = 1, ρ = 0). Colours stay
in [0, 1]: what sharpens the input view must not ring in other views.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.generation.layered_image.types import NO_PIXEL
from diff4splat.geometry.camera import Camera
from diff4splat.progress.run_log import RunLog
from diff4splat.render.api import DEFAULTS
from diff4splat.render.other_colors import open_view
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import color_from_dc, dc_from_color
from diff4splat.scene.scene import Scene

SMALLEST_SHARE = 0.3
"""Of a pixel's colour that its own Gaussian gives; below it the iteration converges more slowly."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InputView:
    """The image with the camera that took it, and which of its cells each Gaussian shows."""

    rgb: Float[Tensor, "h w 3"]
    camera: Camera
    pixel_index: Int[Tensor, " n"]
    """Cell, counted row by row; ``NO_PIXEL`` for Gaussians whose colour stays."""
    stride: int = 1
    """Pixels per cell side."""


def match_input_view(scene: Scene, view: InputView, steps: int, log: RunLog) -> Scene:
    """Correct the colours of the Gaussians that show a cell of the input view."""
    if steps == 0 or not bool((view.pixel_index != NO_PIXEL).any()):
        return scene
    first = scene.state_at(scene.motion.time_range_s[0])
    settings = RenderSettings(dilation_px2=scene.dilation_px2)
    with log.phases.phase("match colours", steps) as advance:
        sh = matched_colors(first, view, steps, advance, settings)
    return replace(scene, gaussians=replace(scene.gaussians, sh=sh))


@torch.no_grad()
def matched_colors(
    gaussians: Gaussians,
    view: InputView,
    steps: int,
    advance: Callable[[], None] = lambda: None,
    settings: RenderSettings = DEFAULTS,
) -> Float[Tensor, "n c 3"]:
    """Harmonics with which ``gaussians``, as they are at the first time, show the image."""
    rows = (view.pixel_index != NO_PIXEL).nonzero()[:, 0]
    sh = gaussians.sh.clone()
    draw = open_view(gaussians, view.camera, settings=settings)
    step = torch.zeros_like(sh[rows, 0])
    for momentum, rate in chebyshev_factors(steps):
        seen = draw(sh)
        residual = _per_cell(view.rgb.to(seen) - seen, view.stride)
        step = momentum * step + rate * residual[view.pixel_index[rows]]
        sh[rows, 0] = dc_from_color((color_from_dc(sh[rows, 0]) + step).clamp(0, 1))
        advance()
    return sh


def chebyshev_factors(steps: int) -> Iterator[tuple[float, float]]:
    """(momentum, rate) of every step for eigenvalues in [SMALLEST_SHARE, 1]."""
    middle, half = (1 + SMALLEST_SHARE) / 2, (1 - SMALLEST_SHARE) / 2
    previous = half / middle
    for index in range(steps):
        if index == 0:
            yield 0.0, 1 / middle
            continue
        current = 1 / (2 * middle / half - previous)
        yield current * previous, 2 * current / half
        previous = current


def _per_cell(image: Float[Tensor, "h w 3"], stride: int) -> Float[Tensor, "c 3"]:
    """Mean over the pixels of each cell."""
    means = torch.nn.functional.avg_pool2d(image.movedim(-1, 0)[None], stride)[0]
    return means.flatten(1).mT
